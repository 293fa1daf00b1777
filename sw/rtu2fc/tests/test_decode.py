# SPDX-License-Identifier: Apache-2.0
"""`rtu2fc decode`: the recordings of the debugging guide, drawn lines, and files that are none.

The virtual card's own words (`what` of its logs) and tb/model are the reference.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from vcd import VCDWriter

from sim.card.run_card import ROOT
from sw.rtu2fc import cli
from sw.rtu2fc.tests.test_fc import IS_300, READ_514, START, STATUS
from sw.rtu2fc.words import Words
from tb.agents.line import Flaws, Format, waveform
from tb.agents.rtu import build, read_registers

RECORDINGS = sorted((ROOT / "docs/recordings").glob("*.jsonl"))
DRIVE = Format(9600, "E", 1)


def vcd(path: Path, *sent: tuple[str, float, Format, bytes, Flaws], invert: bool = False) -> Path:
    """Frames at their times in s, one sample in 100 ns."""
    edges = [
        (round((at * 1e12 + ps) / 1e5), name, level)
        for name, at, fmt, data, flaws in sent
        for ps, level in waveform(fmt, data, flaws)[0]
    ]
    with path.open("w") as file, VCDWriter(file, timescale="100 ns", date="") as writer:
        names = sorted({name for name, *_ in sent})
        lines = {name: writer.register_var("l", name, "wire", 1, init=int(not invert)) for name in names}
        for at, name, level in sorted(edges):
            writer.change(lines[name], at, level ^ invert)
        writer.close(at + 1_000_000)
    return path


def telegrams(path: Path, **how: bool) -> Path:
    """A request without a reply, a cut reply, a request with its reply."""
    sent = [(0.1, START), (0.112, STATUS[:5]), (1.0, READ_514), (1.0215, IS_300)]
    return vcd(path, *(("D0", at, DRIVE, data, Flaws()) for at, data in sent), **how)


@pytest.fixture
def decoded(capsys):
    def run(*words: object, code: int = 0) -> list[str]:
        found = cli.main(["decode", *map(str, words)])
        output, errors = capsys.readouterr()
        assert found == code, errors
        return (output or errors).splitlines()

    return run


@pytest.fixture(autouse=True)
def _no_signals(monkeypatch):
    monkeypatch.setattr(cli.signal, "signal", lambda *_: None)


def entries(log: Path) -> list[dict]:
    return [json.loads(line) for line in log.read_text().splitlines()]


def frames(log: Path) -> list[dict]:
    return [entry for entry in entries(log) if "line" in entry]


# ---------------------------------------------------------------- logs and captures


def test_a_log_is_a_table(decoded):
    log = ROOT / "docs/recordings/crc-errors.jsonl"
    assert len(decoded(log)) == 1 + len(entries(log))
    assert len(decoded(log, "--frames")) == 1 + len(frames(log))
    bad = decoded(log, "--bad")
    assert len(bad) == 1 + 3 and all(" BAD " in row for row in bad[1:])
    assert bad[2].split()[1] == "60.00", "silence since the frame before, even if that one is not shown"
    assert len(decoded(log, "--frames", "--bytes")) == 1 + 2 * len(frames(log))


@pytest.mark.parametrize("log", RECORDINGS, ids=lambda log: log.stem)
def test_a_capture_says_what_its_log_says(log, decoded, capsys):
    def shown(path: Path) -> list[dict]:
        cli.main(["decode", str(path), "--json"])
        return json.loads(capsys.readouterr().out)["frames"]

    assert shown(log.with_suffix(".pcapng")) == shown(log)


def normal(text: str) -> str:
    """Without the raw number beside a scaled one; exceptions by their number."""
    text = re.sub(r"= -?\d+ \((-?[\d.]+(?: \w+)?)\)$", r"= \1", text)
    return re.sub(r"(exception \d+): .*", r"\1", text)


@pytest.mark.parametrize("log", RECORDINGS, ids=lambda log: log.stem)
def test_the_words_of_the_network_line_are_those_of_the_virtual_card(log):
    words, seen = Words("vlt6000", "card"), 0
    for frame in frames(log):
        if frame["line"] == "modbus" and frame["ok"]:
            reply, said = words.said(bytes.fromhex(frame["bytes"]), frame["from"] == "card")
            assert (reply, normal(said)) == (frame["from"] == "card", normal(frame["what"]))
            seen += 1
    assert seen or "led-fault" in log.stem


# ---------------------------------------------------------------- channels of a logic analyser


@pytest.mark.parametrize("invert", [False, True])
def test_the_drive_line_is_found_and_said_in_words(tmp_path, decoded, invert):
    shown = decoded(telegrams(tmp_path / "mine.vcd", invert=invert))
    assert shown[0] == f"D0: FC protocol at 9600 8E1{', low when idle' * invert}"
    rows = [re.sub(r" +", " ", row) for row in shown[2:]]
    assert rows[0] == " 0.1000 D0 card control 047Ch (start, data valid), reference 40.0 %"
    assert rows[1] == " 0.1000 D0 ! No reply"
    assert rows[2].endswith(" BAD cut after 5 of 8 bytes")
    assert rows[3].startswith(" 1.0000 ") and " card read 514 Readout: Motor current; " in rows[3]
    assert (
        " drive double word 514 Readout: Motor current = 3.00 A; status 0F03h (" in rows[4] and len(rows) == 5
    )


def test_fields_and_names_can_be_chosen(tmp_path, decoded):
    path = telegrams(tmp_path / "mine.vcd")
    shown = "\n".join(decoded(path, "--fields", "--drive-type", "vlt5000", "--drive-line", "D0"))
    assert len(re.findall(r" BCC [0-9A-F]{2}h right$", shown, re.MULTILINE)) == 3


@pytest.mark.parametrize("line", [(19200, "8E1"), (2400, "8O1"), (9600, "8N2")])
def test_rate_and_format_of_the_network_line_are_found(tmp_path, decoded, line):
    fmt = Format.named(*line)
    asks, answers = build(1, read_registers(5139, 2)), build(1, bytes.fromhex("03 04 0000012C"))
    path = vcd(
        tmp_path / "bus.vcd",
        ("A", 0.1, fmt, asks, Flaws()),
        ("B", 0.2, fmt, answers, Flaws()),
        ("A", 0.4, fmt, asks, Flaws(gaps={4: 30})),
    )
    shown = decoded(path)
    assert shown[:2] == [f"{name}: Modbus RTU at {line[0]} {line[1]}" for name in "AB"]
    assert shown[3].endswith("master  unit 1: read parameter 514 (Readout: Motor current)")
    assert shown[4].endswith("slave   unit 1: parameter 514 (Readout: Motor current) = 3.00 A")
    assert [" BAD " in row for row in shown[5:]] == [True, True], "two parts of one frame"


def test_recordings_of_real_buses_are_decoded(decoded):
    shown = decoded(ROOT / "tb/captures/brainchild-io-16do.sr")
    assert shown[0].startswith("0: Modbus RTU at 19200 8E1, low when idle")
    assert any(row.endswith("slave   unit 1: coil 4 = on") for row in shown)


# ---------------------------------------------------------------- what is no recording


@pytest.mark.parametrize(
    ("file", "says"),
    [
        ("docs/recordings/nothing.jsonl", "nothing.jsonl: No such file or directory"),
        ("nothing.sr", "nothing.sr: No such file or directory"),
        ("VERSION", "VERSION is no recording: neither a sigrok session (.sr) nor a VCD file"),
    ],
)
def test_a_file_that_is_not_there_is_one_line(file, says, decoded):
    assert decoded(ROOT / file, code=2)[0].endswith(says)


@pytest.mark.parametrize("suffix", [".jsonl", ".pcapng", ".sr", ".vcd"])
@pytest.mark.parametrize("content", [b"{}\n", b"$nothing", b"PK\3\4" + bytes(40), bytes(range(40))])
def test_a_file_of_something_else_is_one_line(tmp_path, suffix, content, decoded):
    (tmp_path / f"a{suffix}").write_bytes(content)
    assert len(decoded(tmp_path / f"a{suffix}", code=2)) == 1


def test_a_channel_that_is_not_there_or_silent_is_said(tmp_path, decoded):
    path = telegrams(tmp_path / "mine.vcd")
    assert decoded(path, "--modbus", "D7", code=2)[0].endswith(f"{path} has no channel D7; there are: D0")
    shown = decoded(path, "--modbus", "D0", code=2)
    assert shown[0].endswith(f"{path}: no good frame on D0") and shown[1] == "  Channels: D0"
