# SPDX-License-Identifier: Apache-2.0
"""The sigrok decoder of FC telegrams, run by sigrok-cli on recordings of the card and on spoilt telegrams.

The meaning of telegrams comes from the Python model and the drives' tables, not from the decoder's tables.
"""

from __future__ import annotations

import ast
import itertools
import json
import os
import random
import re
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import pytest
from vcd import VCDWriter

from sim.card.example_run import ExampleRun, Recorded
from sim.card.run_card import ROOT
from sim.drive.drive_table import read_capacity, read_profile
from sim.view.lines_vcd import SAMPLE_S, write_vcd
from tb.model import fc_telegram

pytestmark = pytest.mark.nightly("views")

DECODERS = ROOT / "sim/view/sigrok"
PLAYED = ("ex1-start-40", "ex4-write-104", "ex5-read-514", "ex6b-text-533", "refused-17")
VLT6000 = {p.pnu: p for p in read_profile(ROOT / "sim/drive/vlt6000.csv", read_capacity()).parameters}
BIT = 1e6 / 9600  # in samples
CHARACTER = 11 * BIT
START = bytes.fromhex("02 06 81 04 7C 19 99 7D")
STATUS = bytes.fromhex("02 06 81 0F 03 20 00 A9")
READ_514 = fc_telegram.build_parameter(1, 514)
IS_300 = fc_telegram.build_parameter(2, 514, pwe=300, pcd1=0x0F03, pcd2=0x2000)


# ---------------------------------------------------------------- lines, drawn as sigrok reads them
@dataclass(frozen=True)
class Sent:
    """A telegram on the line `on`: characters of silence before it, gaps before bytes, bytes with a flaw."""

    data: bytes
    after: float = 20.0
    gaps: tuple[tuple[int, float], ...] = ()
    bad_parity: tuple[int, ...] = ()
    bad_stop: tuple[int, ...] = ()
    on: str = "drive"
    at: float | None = None  # in seconds; instead of `after`


def draw(vcd: Path, sent: Iterable[Sent], lines: tuple[str, ...] = ("drive",), end: float = 10.0) -> Path:
    """Writes 8E1 characters at 9600 bit/s, one sample a microsecond."""
    edges, now = [], 0.0
    for telegram in sent:
        now = now + telegram.after * CHARACTER if telegram.at is None else telegram.at / SAMPLE_S
        for at, byte in enumerate(telegram.data):
            now += dict(telegram.gaps).get(at, 0.0) * CHARACTER
            parity = byte.bit_count() % 2 ^ (at in telegram.bad_parity)
            bits = [0, *(byte >> bit & 1 for bit in range(8)), parity, int(at not in telegram.bad_stop)]
            edges += [(round(now + bit * BIT), telegram.on, level) for bit, level in enumerate(bits)]
            now += CHARACTER
            edges.append((round(now), telegram.on, 1))
    with vcd.open("w") as file:
        writer = VCDWriter(file, timescale="1 us", date="")
        channels = {name: writer.register_var("card", name, "wire", size=1, init="1") for name in lines}
        for at, name, level in edges:
            writer.change(channels[name], at, str(level))
        writer.close(round(now + end * CHARACTER))
    return vcd


@dataclass(frozen=True)
class Shown:
    """An annotation of the decoder."""

    start_s: float
    end_s: float
    name: str
    text: str


def sigrok_cli(vcd: Path, options: str, wires: str, *more: str) -> subprocess.CompletedProcess[str]:
    stack = f"uart:{wires}:baudrate=9600:parity=even,vltfc{options}"
    return subprocess.run(
        ["sigrok-cli", "-I", "vcd", "-i", str(vcd), "-P", stack, "-A", "vltfc", *more],
        env=os.environ | {"SIGROKDECODE_DIR": str(DECODERS), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def decode(vcd: Path, options: str = "", wires: str = "rx=drive") -> list[Shown]:
    # Log level 4 adds the class of each annotation, and its shorter texts.
    done = sigrok_cli(vcd, options, wires, "--protocol-decoder-samplenum", "-l", "4")
    assert done.returncode == 0, done.stderr
    rows = re.findall(r'^(\d+)-(\d+) vltfc-1: ([\w-]+): "(.*?)"(?: ".*")?$', done.stdout, re.MULTILINE)
    assert len(rows) == done.stdout.count("vltfc-1: ")
    return sorted(
        (Shown(int(a) * SAMPLE_S, int(b) * SAMPLE_S, name, text) for a, b, name, text in rows),
        key=lambda shown: shown.start_s,
    )


FIELDS = ("stx", "lge", "adr", "pke", "ind", "pwe", "text", "pcd1", "pcd2", "bcc-right", "bcc-wrong")
TELEGRAMS = ("request", "reply", "bad")


def telegrams(shown: list[Shown]) -> list[Shown]:
    return [s for s in shown if s.name in TELEGRAMS]


def warnings(shown: list[Shown]) -> list[tuple[str, str]]:
    return [(s.name, s.text) for s in shown if s.name not in FIELDS + TELEGRAMS]


def fields_of(shown: list[Shown], telegram: Shown) -> dict[str, str]:
    """The field annotations of one telegram, each at most once."""
    inside = [s for s in shown if telegram.start_s <= s.start_s and s.end_s <= telegram.end_s]
    inside = [s for s in inside if s.name in FIELDS]
    names = [s.name for s in inside]
    assert len(names) == len(set(names)), names
    return {s.name: s.text for s in inside}


def hexadecimal(text: str) -> int:
    return int(re.search(r"\b([0-9A-F]+)h", text)[1], 16)


def percent(word: int) -> str:
    return f"{100 * (word - 0x10000 if word & 0x8000 else word) / 0x4000:.1f} %"


def check_telegram(shown: list[Shown], telegram: Shown, data: bytes, reply: bool) -> None:
    """Every field and the line of a good telegram, against the model."""
    parts = fc_telegram.parse(data, reply)
    assert telegram.name == ("reply" if reply else "request"), telegram
    assert telegram.text.startswith("Reply: " if reply else "To all: " if parts.broadcast else "Request: ")
    got = fields_of(shown, telegram)
    assert got.pop("stx") == "STX" and got.pop("lge") == f"LGE {len(data) - 2}"
    assert hexadecimal(got.pop("adr")) == parts.adr
    assert got.pop("bcc-right") == f"BCC {data[-1]:02X}h right"
    word, share = got.pop("pcd1"), got.pop("pcd2")
    assert word.startswith("PCD1 status" if reply else "PCD1 control") and hexadecimal(word) == parts.pcd1
    name = "frequency" if reply else "reference"
    assert share == f"PCD2 {parts.pcd2:04X}h: {name} {percent(parts.pcd2)}"
    assert telegram.text.endswith(f"{word.removeprefix('PCD1 ')}, {name} {percent(parts.pcd2)}")
    if parts.kind != "process":
        pke = re.fullmatch(r"PKE ([0-9A-F]{4})h: AK (\d+) .*, PNU (\d+) (.*)", got.pop("pke"))
        assert (int(pke[1], 16), int(pke[2])) == (fc_telegram.pke(parts.ak, parts.pnu), parts.ak)
        assert int(pke[3]) == parts.pnu and f" {parts.pnu} {pke[4]}" in telegram.text
        assert pke[4] == (VLT6000[parts.pnu].name if parts.pnu in VLT6000 else "unknown")
        assert hexadecimal(got.pop("ind")) == parts.ind
    if parts.kind == "parameter":
        assert hexadecimal(got.pop("pwe")) == parts.pwe
    if parts.kind == "text":
        said = parts.text.decode("latin-1")
        assert got.pop("text") == f"Text '{said}'" and f" = '{said}'; " in telegram.text
    assert got == {}


# ---------------------------------------------------------------- our own recordings
@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Recorded:
    folder = tmp_path_factory.mktemp("telegrams")
    with ExampleRun(folder, wave=True) as run:
        played = tuple(run.play(name) for name in PLAYED)
    return Recorded(played, tuple(run.card.frames()), run.pcap, run.card.log, run.wave)


@pytest.mark.rule("FC-1", "FC-3", "FC-4", "FC-7")
@pytest.mark.parametrize(
    ("wires", "options"),
    [("rx=drive", ""), ("rx=drive_unit:tx=card_drive", ":requests=tx")],
    ids=["one wire", "two wires"],
)
def test_a_recording_of_the_card_is_decoded_as_the_log_says(recorded, tmp_path, wires, options):
    write_vcd(recorded.wave, tmp_path / "lines.vcd")
    shown = decode(tmp_path / "lines.vcd", options, wires)
    frames = [frame for frame in recorded.frames if frame.line == "drive"]
    assert {len(frame.data) for frame in frames} > {8, 16} and all(frame.ok for frame in frames)
    found = telegrams(shown)
    assert len(found) == len(frames)
    for telegram, frame in zip(found, frames, strict=True):
        assert telegram.start_s == pytest.approx(frame.start, abs=3e-6)
        assert telegram.end_s == pytest.approx(frame.end, abs=0.1 * BIT * SAMPLE_S)
        check_telegram(shown, telegram, frame.data, frame.sender == "drive")
    assert warnings(shown) == []


def drive_frames(log: Path) -> list[dict]:
    return [e for e in map(json.loads, log.read_text().splitlines()) if e.get("line") == "drive"]


WITH_TELEGRAMS = [p.stem for p in sorted((ROOT / "docs/recordings").glob("*.jsonl")) if drive_frames(p)]


@pytest.mark.parametrize("name", WITH_TELEGRAMS)
def test_the_recordings_of_the_debugging_guide_are_decoded(tmp_path, name):
    """Their telegrams, drawn at the log's times; with repeated requests and damaged replies."""
    entries = drive_frames(ROOT / f"docs/recordings/{name}.jsonl")
    sent = [Sent(bytes.fromhex(entry["bytes"]), at=entry["t"]) for entry in entries]
    shown = decode(draw(tmp_path / "lines.vcd", sent))
    for telegram, entry in zip(telegrams(shown), entries, strict=True):
        data = bytes.fromhex(entry["bytes"])
        assert telegram.start_s == pytest.approx(entry["t"], abs=3e-6)
        if entry["ok"]:
            check_telegram(shown, telegram, data, entry["from"] == "drive")
        else:
            right = fc_telegram.bcc(data[:-1])
            assert entry["what"] == "BCC wrong"
            assert telegram.text == f"Bad: BCC {data[-1]:02X}h, {right:02X}h would be right"
    senders = [entry["from"] for entry in entries if entry["ok"]]
    unanswered = sum(pair == ("card", "card") for pair in itertools.pairwise(senders))
    assert warnings(shown) == [("no-reply", "No reply")] * unanswered


# ---------------------------------------------------------------- random telegrams, against the model
def some_telegram(rng: random.Random, reply: bool) -> bytes:
    words = (rng.getrandbits(16), rng.getrandbits(16))
    pnu = rng.choice([*VLT6000, rng.randrange(2048)])
    kind = rng.choice(("process", "parameter", "text"))
    if kind == "process":
        return fc_telegram.build_process(*words)
    if kind == "parameter":
        ak = rng.choice((0, 1, 2, 7) if reply else (0, 1, 2, 3, 13, 14))
        return fc_telegram.build_parameter(ak, pnu, rng.randrange(100), rng.getrandbits(32), *words)
    text = bytes(rng.choice(range(0x23, 0x7F)) for _ in range(rng.randrange(21)))
    return fc_telegram.build_text(pnu, text, pcd1=words[0], pcd2=words[1])


@pytest.mark.rule("FC-1", "FC-3", "FC-4")
def test_random_telegrams_agree_with_the_model(tmp_path):
    seed = os.environ.get("COCOTB_RANDOM_SEED") or "1"
    print("seed", seed)
    rng = random.Random(seed)
    sides = [number % 2 == 1 for number in range(80)]
    data = [some_telegram(rng, reply) for reply in sides]
    sent = [Sent(d, 2.1, on="unit" if reply else "card") for d, reply in zip(data, sides, strict=True)]
    vcd = draw(tmp_path / "lines.vcd", sent, ("unit", "card"))
    shown = decode(vcd, ":requests=tx", "rx=unit:tx=card")
    for telegram, d, reply in zip(telegrams(shown), data, sides, strict=True):
        check_telegram(shown, telegram, d, reply)
    assert {name for name, _ in warnings(shown)} <= {"other-reply", "no-reply"}


@pytest.mark.parametrize(
    ("word", "said"),
    [
        (0x047C, "start, data valid"),
        (0x1C7F, "Preset reference LSB, Preset reference MSB, start, data valid, Relay 1, Relay 2"),
        (0x007C, "ignored: data not valid"),
    ],
)
def test_the_control_word_is_said_in_words(tmp_path, word, said):
    data = fc_telegram.build_process(word, 0xE000)
    (line,) = telegrams(decode(draw(tmp_path / "lines.vcd", [Sent(data)])))
    assert line.text == f"Request: control {word:04X}h ({said}), reference -50.0 %"


@pytest.mark.parametrize(
    ("drive", "said"),
    [
        ("vlt6000", "Control ready, stand by, bit 6, local control, running"),
        ("hvac_basic", "Control ready, trip lock, local control, running"),
    ],
)
def test_the_status_word_is_that_of_the_chosen_drive(tmp_path, drive, said):
    data = fc_telegram.build_process(0x0845, 0x2000)
    vcd = draw(tmp_path / "lines.vcd", [Sent(START), Sent(data, 2.1)])
    assert telegrams(decode(vcd, f":drive={drive}"))[1].text == (
        f"Reply: status 0845h ({said}), frequency 50.0 %"
    )


@pytest.mark.parametrize(
    ("request_", "reply", "said"),
    [
        (READ_514, IS_300, "double word 514 Readout: Motor current = 3.00 A"),
        (
            fc_telegram.build_parameter(14, 104, pwe=60),
            fc_telegram.build_parameter(7, 104, pwe=17),
            f"refused 104 {VLT6000[104].name}: not possible in the present mode",
        ),
        (
            fc_telegram.build_parameter(1, 615, ind=3),
            fc_telegram.build_parameter(1, 615, ind=3, pwe=0xFFFF),
            f"word 615 {VLT6000[615].name} [3] = ",
        ),
    ],
)
def test_a_value_a_refusal_and_an_index_are_said_in_words(tmp_path, request_, reply, said):
    shown = decode(draw(tmp_path / "lines.vcd", [Sent(request_), Sent(reply, 2.1)]))
    assert telegrams(shown)[1].text.startswith(f"Reply: {said}")


SIGNED = [(211, 0xFFFF, "-0.01 %"), (225, 0x80000000, "-2147483.648 Hz"), (225, 0xFFFF, "65.535 Hz")]


@pytest.mark.rule("FC-4")
@pytest.mark.parametrize(("pnu", "pwe", "said"), SIGNED)
def test_negative_values_are_signed_by_the_type_of_the_parameter(tmp_path, pnu, pwe, said):
    assert VLT6000[pnu].type == {211: "int16", 225: "int32"}[pnu]
    request = fc_telegram.build_parameter(1, pnu)
    reply = fc_telegram.build_parameter(2 if pnu == 225 else 1, pnu, pwe=pwe)
    shown = decode(draw(tmp_path / "lines.vcd", [Sent(request), Sent(reply, 2.1)]))
    assert f" = {said};" in telegrams(shown)[1].text


def test_text_is_latin_1_with_dots_for_unprintable_characters(tmp_path):
    data = fc_telegram.build_text(533, b"HELLO\xe9\x00\x7f\x8012")
    (line,) = telegrams(decode(draw(tmp_path / "lines.vcd", [Sent(data)])))
    assert " = 'HELLOé...12'; " in line.text


# ---------------------------------------------------------------- spoilt telegrams
def sealed(body: str) -> bytes:
    data = bytes.fromhex(body)
    return data + bytes([fc_telegram.bcc(data)])


GAP = ("gap", "Gap of 3.0 characters in a telegram, at most 2")


@pytest.mark.rule("FC-1", "FC-8")
@pytest.mark.parametrize(
    ("reply", "said", "warned"),
    [
        pytest.param(Sent(STATUS[:-1] + b"\xa8", 2.1), "BCC A8h, A9h would be right", [], id="BCC"),
        pytest.param(
            Sent(STATUS, 2.1, bad_parity=(3,)),
            "parity wrong in byte 4",
            [("parity", "Parity error in 0Fh")],
            id="parity",
        ),
        pytest.param(
            Sent(STATUS, 2.1, gaps=((5, 3.0),)),
            "cut after 5 of 8 bytes",
            [GAP, ("no-stx", "No STX: 20 00 A9")],
            id="gap",
        ),
        pytest.param(Sent(STATUS[:1], 2.1), "cut after STX", [], id="STX alone"),
        pytest.param(
            Sent(STATUS, 2.1, gaps=((2, 1.5), (4, 1.5), (6, 1.9))),
            "took 1.61 times its nominal time, at most 1.5",
            [],
            id="slow",
        ),
        pytest.param(
            Sent(sealed("02 10 81 12 02 00 00 00 00 00 00 00 00 0F 03 20 00"), 2.1),
            "LGE 16 with AK 1",
            [],
            id="LGE of a text",
        ),
        pytest.param(Sent(b"\x03" + STATUS[1:], 2.1), None, [("no-stx", None)], id="no STX"),
    ],
)
def test_a_spoilt_reply_is_bad_and_the_next_telegram_is_good(tmp_path, reply, said, warned):
    """A reply is shown as bad if the model of the protocol refuses it or the line damaged it, only then."""
    shown = decode(draw(tmp_path / "lines.vcd", [Sent(START), reply, Sent(READ_514), Sent(IS_300, 2.1)]))
    lines = telegrams(shown)
    assert [s.text for s in lines if s.name == "bad"] == ([f"Bad: {said}"] if said else [])
    assert [s.name for s in lines if s.name != "bad"] == ["request", "request", "reply"]
    check_telegram(shown, lines[-2], READ_514, False)
    check_telegram(shown, lines[-1], IS_300, True)
    got = warnings(shown)
    assert ("no-reply", "No reply") in got
    got.remove(("no-reply", "No reply"))
    assert [
        (name, text if expected else None)
        for (name, text), (_, expected) in zip(sorted(got), sorted(warned), strict=True)
    ] == sorted(warned)
    if not (reply.gaps or reply.bad_parity or reply.bad_stop):
        with pytest.raises(fc_telegram.TelegramError):
            fc_telegram.parse(reply.data, True)


@pytest.mark.rule("FC-8")
def test_after_a_bad_telegram_the_decoder_waits_for_silence(tmp_path):
    """As the card's receiver: an STX without a pause may be a byte of the bad telegram."""
    bad = Sent(STATUS[:-1] + b"\xa8")
    shown = decode(draw(tmp_path / "lines.vcd", [bad, Sent(START, 1.0), Sent(START, 2.2)]))
    assert [s.name for s in telegrams(shown)] == ["bad", "request"]
    assert warnings(shown) == [("no-stx", "No STX: 02 06 81 04 7C 19 99 7D")]


@pytest.mark.rule("FC-8")
@pytest.mark.parametrize(
    ("reply", "warned"),
    [
        pytest.param([Sent(STATUS, 2.1, gaps=((5, 2.0),))], [], id="gap of 2"),
        pytest.param(
            [Sent(STATUS, 1.5)],
            [("gap", "Pause of 1.5 characters before a telegram, at least 2")],
            id="pause of 1.5",
        ),
        pytest.param(
            [Sent(b"\x00", 1.0), Sent(STATUS, 0.5)], [("phantom", "Phantom before STX: 00")], id="phantom"
        ),
    ],
)
def test_a_reply_is_good_with_short_gaps_and_after_phantom_characters(tmp_path, reply, warned):
    shown = decode(draw(tmp_path / "lines.vcd", [Sent(START), *reply]))
    lines = telegrams(shown)
    assert [s.name for s in lines] == ["request", "reply"]
    check_telegram(shown, lines[-1], STATUS, True)
    assert warnings(shown) == warned


def test_noise_ends_nothing_and_no_character_is_lost(tmp_path):
    """Random bytes, many of them of telegrams: each is in exactly one telegram or outside of all."""
    seed = os.environ.get("COCOTB_RANDOM_SEED") or "1"
    print("seed", seed)
    rng = random.Random(seed)
    usual = [*b"\x02\x02\x06\x0e\x81\xf2\x72\x05", *START]
    sent = [
        Sent(
            bytes(rng.choice([*usual, rng.randrange(256)]) for _ in range(rng.randrange(1, 30))),
            rng.choice((0.5, 1.9, 2.2, 5.0, 140.0)),
            bad_parity=(rng.randrange(60),),
        )
        for _ in range(60)
    ]
    shown = decode(draw(tmp_path / "lines.vcd", sent))
    spans = [s for s in shown if s.name in (*TELEGRAMS, "phantom", "no-stx")]
    ends, now = [], 0.0
    for telegram in sent:
        now += telegram.after * CHARACTER
        for _ in telegram.data:
            ends.append((now + CHARACTER / 2) * SAMPLE_S)
            now += CHARACTER
    assert [sum(s.start_s < middle < s.end_s for s in spans) for middle in ends] == [1] * len(ends)
    assert {s.name for s in spans} >= {"bad", "no-stx"}


# ---------------------------------------------------------------- request and reply on one wire
def names_of(tmp_path: Path, sent: list[Sent], end: float = 10.0) -> list[str]:
    shown = decode(draw(tmp_path / "lines.vcd", sent, end=end))
    return [s.name for s in shown if s in telegrams(shown) or s.name in ("no-reply", "other-reply")]


def test_a_repeated_request_is_no_reply(tmp_path):
    sent = [Sent(READ_514), Sent(READ_514, 60), Sent(IS_300, 2.1)]
    assert sorted(names_of(tmp_path, sent)) == ["no-reply", "reply", "request", "request"]


def test_a_telegram_after_150_ms_is_a_new_request(tmp_path):
    """131 characters at 9600 bit/s; the card waits 150 ms (FC-9)."""
    assert names_of(tmp_path, [Sent(START), Sent(STATUS, 130)]) == ["request", "reply"]
    late = names_of(tmp_path, [Sent(START), Sent(STATUS, 133)])
    assert sorted(late) == ["no-reply", "request", "request"]


@pytest.mark.rule("FC-2")
@pytest.mark.parametrize("adr", [0x80, 0x3F])
def test_a_broadcast_has_no_reply(tmp_path, adr):
    to_all = fc_telegram.build_process(0x047C, 0x1999, adr)
    shown = decode(draw(tmp_path / "lines.vcd", [Sent(to_all), Sent(START, 2.1)], end=100))
    assert [s.text.split(":")[0] for s in telegrams(shown)] == ["To all", "Request"]
    assert warnings(shown) == []


def test_another_parameter_is_a_new_request_on_one_wire_and_marked_on_two(tmp_path):
    other = fc_telegram.build_parameter(1, 515, pcd1=0x0F03)
    sent = [Sent(READ_514, on="card"), Sent(other, 2.1, on="unit"), Sent(IS_300, 2.1, on="unit")]
    vcd = draw(tmp_path / "lines.vcd", sent, ("unit", "card"))
    shown = decode(vcd, ":requests=tx", "rx=unit:tx=card")
    assert [s.name for s in telegrams(shown)] == ["request", "reply", "reply"]
    assert warnings(shown) == [("other-reply", "Reply to another request")]
    assert sorted(names_of(tmp_path, [Sent(READ_514), Sent(other, 2.1)])) == [
        "no-reply",
        "request",
        "request",
    ]


# ---------------------------------------------------------------- options, tables, installation
def test_the_decoder_has_the_syntax_of_an_old_python():
    files = sorted(DECODERS.rglob("*.py"))
    assert len(files) == 4
    for path in files:
        ast.parse(path.read_text(), str(path), feature_version=(3, 4))


# ---------------------------------------------------------------- the waveform's lines
def test_a_waveform_that_cannot_be_read_is_one_line(recorded, tmp_path):
    """The writer of a running card fills in the header at its end."""
    wave, words = tmp_path / "card.fst", "the waveform is unfinished: its program still runs or was killed"
    wave.write_bytes(bytes(329) + recorded.wave.read_bytes()[329:])
    for name, *more in (("lines_vcd", tmp_path / "lines.vcd"), ("waves",)):
        command = [sys.executable, "-m", f"sim.view.{name}", wave, *more]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout, done.stderr) == (2, "", f"{name}: {words}\n")
    assert not (tmp_path / "lines.vcd").exists()


def test_the_documented_commands_show_the_telegrams(recorded, tmp_path):
    """In a plain shell without the tools of .venv."""
    write_vcd(recorded.wave, tmp_path / "lines.vcd")
    (tmp_path / "sim").symlink_to(ROOT / "sim")
    section = (ROOT / "docs/guide/recordings.md").read_text().split("### FC telegrams\n")[1]
    commands = re.findall(r"```\n(.*?)```", section, re.DOTALL)[1]
    done = subprocess.run(
        ["sh", "-e", "-c", commands],
        cwd=tmp_path,
        env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    senders = [frame.sender for frame in recorded.frames if frame.line == "drive"]
    assert done.stdout.count("vltfc-1: Reply: ") == 2 * senders.count("drive") > 0
    assert done.stdout.count("vltfc-1: Request: ") == 2 * senders.count("card") > 0
    assert done.stdout.count("vltfc-1: STX\n") == len(senders), "fields in one of both commands"
    assert "License: apache-2.0" in done.stdout
