# SPDX-License-Identifier: Apache-2.0
"""Wireshark's decoding of recorded examples of the documents, on both lines.

The meaning of telegrams and frames comes from the Python models and the drives' tables, not from the
dissector's tables.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest

from regs.dialects import STANDARD, STANDARD_DRIVE
from rtl.sources import ROOT
from sim.card.run_card import Frame
from sim.view import tshark
from sim.view.test_recordings import Talk
from sim.view.wireshark import SCRIPT, environment
from sw.rtu2fc.drives import DRIVES
from sw.rtu2fc.fc import scaled
from tb.agents import rtu
from tb.agents.crc16 import with_crc
from tb.lib.recording import DRIVE, MODBUS, Recorder
from tb.model import fc_telegram
from tb.model.examples import EXAMPLES

pytestmark = pytest.mark.nightly("views")

WORDS = tomllib.loads((ROOT / "regs/fc.toml").read_text())
VLT6000 = DRIVES["vlt6000"]["parameters"]
BITS = {
    f"vltfc.{prefix}.{name}": bit["bit"]
    for prefix, word in (("ctw", "control"), ("stw", "status"))
    for name, bit in WORDS[word].items()
    if bit.get("only") in (None, "vlt_status", "one_ramp")
}
FIELDS = [
    *("frame.protocols", "frame.comment", "_ws.expert.message"),
    *(f"vltfc.{name}" for name in ("stx", "lge", "adr", "address", "broadcast", "reply", "pke", "ak", "pnu")),
    *(f"vltfc.{name}" for name in ("ak.words", "pnu.name", "ind", "index", "pwe", "pwe.signed", "value")),
    *(f"vltfc.{name}" for name in ("text", "fault", "fault.words", "ctw", "ref.percent", "stw")),
    *(f"vltfc.{name}" for name in ("freq.percent", "bcc", "bcc.good", "request_frame", "reply_frame")),
    *("vltfc.repeat_of", "vltfc.time"),
    *("mbrtu.unit_id", "mbrtu.crc16.status", "modbus.func_code", "modbus.exception_code"),
    *("rtu2fc_modbus.func_code", "rtu2fc_modbus.reference_num", "rtu2fc_modbus.crc.good"),
    *("rtu2fc_modbus.pnu", "rtu2fc_modbus.name", "rtu2fc_modbus.ctw", "rtu2fc_modbus.ref"),
    *BITS,
]
WITH_DRIVE = [name for name, example in EXAMPLES.items() if example["drive"]]


def read(capture: Path, settings: Path, *options: str) -> dict[int, dict[str, str]]:
    """Decoded fields of each packet, by its number from 1; two passes, as in Wireshark."""
    packets = tshark.fields(capture, *FIELDS, options=[*SCRIPT, "-2", *options], env=environment(settings))
    return dict(enumerate(packets, 1))


class Recorded(NamedTuple):
    """A recording of all examples, one after the other, and of a damaged frame.

    `frames`: those of the log. `packets`: for each example the numbers of its packets, from 1.
    """

    pcap: Path
    frames: list[Frame]
    packets: dict[str, range]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Recorded:
    sent: list[tuple[int, bool, bytes]] = []
    numbers = {}
    for name, one in EXAMPLES.items():
        first = len(sent) + 1
        parts = [(MODBUS, False, one["request"])]
        for exchange in one["drive"]:
            parts += [(DRIVE, True, exchange["telegram"]), (DRIVE, False, exchange["reply"])]
        parts.append((MODBUS, True, one["reply"]))
        sent += [(line, from_card, bytes.fromhex(part)) for line, from_card, part in parts if part]
        numbers[name] = range(first, len(sent) + 1)
    pcap = capture_of(tmp_path_factory.mktemp("examples"), *sent, (MODBUS, False, DAMAGED))
    log = pcap.with_suffix(".jsonl").read_text().splitlines()
    return Recorded(pcap, [Frame.of(json.loads(line)) for line in log], numbers)


@pytest.fixture(scope="module")
def packets(recorded, tmp_path_factory) -> dict[int, dict[str, str]]:
    return read(recorded.pcap, tmp_path_factory.mktemp("settings"))


def number(text: str) -> int:
    return int(text.split(" ")[0], 0)


def truth(text: str) -> bool:
    assert text in ("0", "1", "True", "False"), text
    return text in ("1", "True")


# ---------------------------------------------------------------- the drive line
def check_telegram(got: dict[str, str], telegram: bytes, reply: bool) -> None:
    """Every field of a good telegram."""
    parts = fc_telegram.parse(telegram, reply)
    word, share = ("stw", "freq") if reply else ("ctw", "ref")
    numbers = {"stx": 2, "lge": len(telegram) - 2, "adr": parts.adr, "address": int(not parts.broadcast)}
    numbers |= {"bcc": telegram[-1], word: parts.pcd1}
    if parts.kind != "process":
        numbers |= {"pke": parts.ak << 12 | parts.pnu, "ak": parts.ak, "pnu": parts.pnu}
        numbers |= {"ind": parts.ind, "index": parts.ind & 0xFF}
    if parts.kind == "parameter":
        numbers |= {"pwe": parts.pwe, "pwe.signed": (parts.pwe ^ 1 << 31) - (1 << 31)}
    assert {name: number(got[f"vltfc.{name}"]) for name in numbers} == numbers
    truths = {"broadcast": parts.broadcast, "reply": reply, "bcc.good": True}
    assert {name: truth(got[f"vltfc.{name}"]) for name in truths} == truths
    assert got["vltfc.ctw" if reply else "vltfc.stw"] == ""
    signed = parts.pcd2 - 0x10000 if parts.pcd2 & 0x8000 else parts.pcd2
    assert float(got[f"vltfc.{share}.percent"]) == pytest.approx(100 * signed / 0x4000)
    for name, bit in BITS.items():
        shown = got[name]
        assert shown == "" if word not in name else truth(shown) == bool(parts.pcd1 >> bit & 1), name
    if parts.kind == "process":
        assert got["vltfc.pke"] == got["vltfc.ind"] == got["vltfc.pwe"] == ""
        return
    assert got["vltfc.ak.words"] == WORDS["reply" if reply else "request"][str(parts.ak)]
    assert got["vltfc.pnu.name"] == VLT6000[parts.pnu][0]
    if parts.text is not None:
        assert got["vltfc.text"] == parts.text.decode()
        return
    fault = parts.fault if reply else None
    assert got["vltfc.fault"] == ("" if fault is None else str(fault))
    if fault is not None:
        assert got["vltfc.fault.words"] == WORDS["fault"][str(fault)]
    without = (0, fc_telegram.AK_TEXT) if reply else (0, fc_telegram.AK_TEXT, fc_telegram.AK_READ)
    has_value = fault is None and parts.ak not in without
    shown = scaled(DRIVES["vlt6000"], parts.pnu, parts.pwe) if has_value else ""
    assert got["vltfc.value"] == shown


@pytest.mark.rule("FC-1", "FC-2", "FC-3", "FC-4", "FC-7")
@pytest.mark.parametrize("name", WITH_DRIVE)
def test_drive_line_is_decoded_as_in_the_examples(recorded, packets, name):
    seen = [
        (packets[at], recorded.frames[at - 1].data)
        for at in recorded.packets[name]
        if recorded.frames[at - 1].line == "drive"
    ]
    expected = [
        (bytes.fromhex(part), part is exchange["reply"])
        for exchange in EXAMPLES[name]["drive"]
        for part in (exchange["telegram"], exchange["reply"])
        if part
    ]
    assert [data for _, data in seen] == [telegram for telegram, _ in expected]
    for (got, _), (telegram, reply) in zip(seen, expected, strict=True):
        check_telegram(got, telegram, reply)


@pytest.mark.rule("FC-9")
def test_request_and_reply_are_linked(recorded, packets):
    """Linked by number, with the time between them; a repeat is linked to the original."""
    pairs = 0
    for at, frame in enumerate(recorded.frames, 1):
        if (frame.line, frame.sender) != ("drive", "drive"):
            continue
        asked = at - 1
        assert recorded.frames[asked - 1].sender == "card"
        assert number(packets[at]["vltfc.request_frame"]) == asked
        assert number(packets[asked]["vltfc.reply_frame"]) == at
        taken = frame.start - recorded.frames[asked - 1].start
        assert float(packets[at]["vltfc.time"]) == pytest.approx(taken, abs=1e-9)
        pairs += 1
    assert pairs == sum(bool(part["reply"]) for one in EXAMPLES.values() for part in one["drive"])
    first = recorded.packets["timeout-255"][1]
    assert packets[first]["vltfc.reply_frame"] == packets[first + 1]["vltfc.reply_frame"] == ""
    assert number(packets[first + 1]["vltfc.repeat_of"]) == first
    assert "No reply before the next request" in packets[first]["_ws.expert.message"]
    broadcast = recorded.packets["bcast-start"][1]
    assert "No reply" not in packets[broadcast]["_ws.expert.message"]


# ---------------------------------------------------------------- the network line
@pytest.mark.rule("FRAME-4")
@pytest.mark.parametrize("name", EXAMPLES)
def test_network_line_is_decoded_as_in_the_examples(recorded, packets, name):
    """Wireshark's own dissector decodes it, except for broadcasts: those get their main fields from ours.

    It looks for the CRC of a request that is too long for its function where the CRC of a good one would be.
    """
    numbers = recorded.packets[name]
    request = bytes.fromhex(EXAMPLES[name]["request"])
    got = packets[numbers[0]]
    if request[0] == 0:
        assert number(got["rtu2fc_modbus.func_code"]) == request[1]
        assert number(got["rtu2fc_modbus.reference_num"]) == int.from_bytes(request[2:4], "big")
        assert truth(got["rtu2fc_modbus.crc.good"])
        assert number(got["rtu2fc_modbus.ctw"]) == 0x047C
        return
    for packet, adu in ((got, request), (packets[numbers[-1]], bytes.fromhex(EXAMPLES[name]["reply"]))):
        if adu[1] & 0x7F == 0x07:  # it knows no such function
            assert "function" in packet["frame.comment"]
            continue
        assert "mbrtu:modbus" in packet["frame.protocols"]
        assert number(packet["mbrtu.unit_id"]) == adu[0]
        assert number(packet["mbrtu.crc16.status"]) == (name != "bad-length" or packet is not got)
        assert number(packet["modbus.func_code"]) == adu[1] & 0x7F
        code = packet["modbus.exception_code"]
        assert code == (str(adu[2]) if adu[1] & rtu.EXCEPTION_BIT else "")


def test_requests_are_named_by_the_drive_s_parameters(recorded, packets):
    read_current = packets[recorded.packets["ex5-read-514"][0]]
    assert read_current["rtu2fc_modbus.pnu"] == "514"
    assert read_current["rtu2fc_modbus.name"] == VLT6000[514][0]
    local = packets[recorded.packets["appA-fc06"][0]]
    assert local["rtu2fc_modbus.pnu"] == "", "40002 is no parameter"


@pytest.mark.parametrize(
    ("request_", "bits", "reference"),
    [
        ("01 0F 00 00 00 20 04 7C 04 99 19", {"start": 1, "valid": 1, "reverse": 0}, 40.0),
        ("01 05 00 06 FF 00", {"start": 1, "valid": None}, None),
        ("00 05 00 0A FF 00", {"start": None, "valid": 1}, None),
        ("01 0F 00 06 00 05 01 11", {"start": 1, "valid": 1, "reset": 0, "reverse": None}, None),
        ("01 0F 00 0F 00 11 03 01 40 00", {"reverse": 1, "start": None}, 50.0),
        ("01 05 00 20 FF 00", {"start": None, "valid": None}, None),
        ("01 0F 00 00 00 20 04 7C 04", {"start": None}, None),
    ],
)
def test_every_write_of_control_word_coils_is_decoded(tmp_path, request_, bits, reference):
    frame = with_crc(bytes.fromhex(request_))
    (got,) = read(capture_of(tmp_path, (MODBUS, False, frame)), tmp_path / "settings").values()
    for name, value in bits.items():
        shown = got[f"vltfc.ctw.{name}"]
        assert shown == "" if value is None else truth(shown) == bool(value), name
    share = got["rtu2fc_modbus.ref"]
    assert share == "" if reference is None else float(share) == pytest.approx(reference, abs=0.01)


# ---------------------------------------------------------------- display: columns, colours
@pytest.fixture(scope="module")
def rows(recorded, tmp_path_factory) -> list[dict[str, str]]:
    """The packet list of the profile, column by column."""
    settings = tmp_path_factory.mktemp("columns")
    preferences = (ROOT / "sim/view/wireshark_profile/preferences").read_text().split("gui.column.format:")[1]
    names = re.findall(r'^\s*"([^"]*)", "', preferences, re.MULTILINE)
    text = tshark.rows(recorded.pcap, options=[*SCRIPT, "-2"], env=environment(settings))
    return [dict(zip(names, map(str.strip, line.split("\t")), strict=True)) for line in text]


def test_columns_equal_the_log(recorded, rows):
    assert len(rows) == len(recorded.frames)
    ends: dict[str, float] = {}
    for at, (row, frame) in enumerate(zip(rows, recorded.frames, strict=True), 1):
        assert int(row["No."]) == at
        assert float(row["Time"]) == pytest.approx(frame.start, abs=1e-9), "the log's time, from power-up"
        assert row["Line"] == frame.line
        assert row["Direction"] == ("Outbound" if frame.sender == "card" else "Inbound")
        assert row["Protocol"] == ("FC" if frame.line == "drive" else "Modbus RTU")
        assert int(row["Bytes"]) == len(frame.data)
        assert row["Comment"] == ("" if frame.ok else "bad frame: ") + frame.what
        replies = frame.sender == ("card" if frame.line == "modbus" else "drive")
        if replies:
            assert float(row["Reply after"]) == pytest.approx(frame.start - ends[frame.line], abs=2e-6)
        else:
            assert row["Reply after"] == ""
            ends[frame.line] = frame.end


def test_colour_filters_match_the_named_frames(recorded, tmp_path):
    def is_exception(frame: Frame) -> bool:
        if frame.line == "modbus":
            return frame.sender == "card" and bool(frame.data[1] & rtu.EXCEPTION_BIT)
        return frame.sender == "drive" and fc_telegram.parse(frame.data, True).fault is not None

    frames = dict(enumerate(recorded.frames, 1))
    expected = {
        "Bad frame": [len(frames)],
        "Exception or refused": [at for at, frame in frames.items() if is_exception(frame)],
        "Drive line": [at for at, frame in frames.items() if frame.line == "drive"],
        # Wireshark's own dissector does not know unit 0.
        "Network line": [at for at, frame in frames.items() if frame.line == "modbus"],
    }
    assert expected["Exception or refused"]
    found = {}
    lines = (ROOT / "sim/view/wireshark_profile/colorfilters").read_text().splitlines()[1:]
    for line in lines:
        name, chosen = re.fullmatch(r"@([^@]+)@([^@]+)@\[[\d,]+\]\[[\d,]+\]", line).groups()
        options = [*SCRIPT, "-2"]
        seen = tshark.fields(
            recorded.pcap, "frame.number", options=options, only=chosen, env=environment(tmp_path)
        )
        found[name] = [int(packet["frame.number"]) for packet in seen]
    assert len(found.pop("No reply")) >= 2
    assert found == expected


# ---------------------------------------------------------------- errors, and other drives
START = bytes.fromhex("02 06 81 04 7C 19 99 7D")
DAMAGED = bytes.fromhex("01 01 00 00 00 10 3D C7")


def capture_of(tmp_path: Path, *frames: tuple[int, bool, bytes], dialect: str = "card") -> Path:
    """Writes a recording with these frames: line, sent by the card, bytes."""
    with Recorder(tmp_path / "lines", dialect) as recorder:
        talk = Talk(recorder)
        for line, from_card, data in frames:
            talk.say(line, from_card, data)
            talk.silence(5)
    return recorder.pcap


@pytest.mark.rule("FC-1", "FC-8")
@pytest.mark.parametrize(
    ("line", "data", "message"),
    [
        (DRIVE, START[:-1] + b"\x7c", "BCC 7Ch, 7Dh would be right"),
        (DRIVE, b"\x03" + START[1:], "No STX"),
        (DRIVE, START[:-2], "LGE 6, but 6 bytes"),
        (MODBUS, DAMAGED, "Incorrect CRC"),
        (MODBUS, bytes.fromhex("00 05 00 00 FF 00 8D EC"), "Incorrect CRC"),
    ],
)
def test_bad_frames_are_marked(tmp_path, line, data, message):
    (got,) = read(capture_of(tmp_path, (line, line == DRIVE, data)), tmp_path / "settings").values()
    assert message in got["_ws.expert.message"]
    assert "bad frame: " in got["frame.comment"]


def test_reply_to_another_request_is_marked(tmp_path):
    ask, other = fc_telegram.build_parameter(1, 514), fc_telegram.build_parameter(1, 515)
    got = read(capture_of(tmp_path, (DRIVE, True, ask), (DRIVE, False, other)), tmp_path / "settings")
    assert "Reply to another request" in got[2]["_ws.expert.message"]
    assert got[2]["vltfc.request_frame"] == ""


@pytest.mark.parametrize("drive", ["vlt5000", STANDARD_DRIVE])
def test_the_preference_chooses_the_drive(tmp_path, drive):
    """Parameter names, and bits 2 and 6 of the status word, which later drives use differently."""
    name = DRIVES[drive]["parameters"].get(514, ("unknown",))[0]
    reply = fc_telegram.build_parameter(1, 514, pcd1=0x0044)
    capture = capture_of(tmp_path, (DRIVE, False, reply))
    got = read(capture, tmp_path / "settings", "-o", f"vltfc.drive:{drive}")[1]
    assert got["vltfc.pnu.name"] == name
    assert (got["vltfc.stw.stand_by"] == "") == (drive == STANDARD_DRIVE)


def test_capture_names_its_drive(tmp_path):
    pnu, motor = next(row for row in DRIVES[STANDARD_DRIVE]["parameters"].items() if row[0] > 2047)
    reply = fc_telegram.build_parameter(1, pnu)
    got = read(capture_of(tmp_path, (DRIVE, False, reply), dialect=STANDARD), tmp_path / "settings")[1]
    assert (got["vltfc.pnu"], got["vltfc.pnu.name"]) == (str(pnu), motor[0])


# ---------------------------------------------------------------- the command
def test_make_wireshark_without_a_display_prints_text(recorded):
    command = [sys.executable, "-m", "sim.view.wireshark", recorded.pcap, "-c", "4"]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        env=environment() | {"DISPLAY": "", "WAYLAND_DISPLAY": ""},
    )
    assert done.returncode == 0, done.stderr
    assert "so this is tshark's text" in done.stderr
    assert "Bit 10, Data valid" in done.stdout
    assert "Modbus RTU" in done.stdout
