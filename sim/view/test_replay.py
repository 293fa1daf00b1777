# SPDX-License-Identifier: Apache-2.0
"""The reader of recordings and `make replay`: edges read, rows printed, one line for each bad input.

tb/card/test_card_recorded_buses.py checks the card itself with the same recordings.
"""

from __future__ import annotations

import re
import subprocess
import zipfile
from itertools import pairwise
from pathlib import Path

import pytest
from vcd import VCDWriter

from regs.dialects import STANDARD
from rtl.sources import ROOT
from sim.harness.library import Target
from sim.view import replay
from sim.view.replay import IGNORED, REASONS, UNHEARD, main
from sw.rtu2fc.capture import characters, open_capture, pieces
from tb.agents import rtu
from tb.agents.crc16 import with_crc
from tb.model.wire import LineFormat

CAPTURES = ROOT / "tb/captures"
MODULE = CAPTURES / "brainchild-io-16do.sr"
US = 1_000_000  # the unit of time here, in Hz
METADATA = "[device 1]\ncapturefile=logic-1\nsamplerate=1 MHz\nprobe1=A\nprobe2=B\nunitsize=1\n"
VCD_HEADER = """$timescale 10 ns $end $scope module l $end $var wire 1 ! A $end $var wire 4 % V [3:0] $end
$scope module m $end $var wire 1 " A $end $upscope $end $upscope $end $enddefinitions $end
"""
READ = rtu.build(1, rtu.read_registers(1, 1))
SWAPPED = READ[:-2] + READ[:-3:-1]
ASKED = ["--unit", "1", "--baud", "19200", "--format", "8E1"]


def sigrok_file(path: Path, metadata: str = METADATA, **parts: bytes) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("version", "2")
        archive.writestr("metadata", metadata)
        for name, data in parts.items():
            archive.writestr(name.replace("_", "-"), data)
    return path


def vcd_file(path: Path, **channels: list[tuple[int, int]]) -> Path:
    changes = sorted((at, name, level) for name, edges in channels.items() for at, level in edges)
    with path.open("w") as file:
        writer = VCDWriter(file, timescale="1 us", date="")
        wires = {name: writer.register_var("logic", name, "wire", size=1, init="1") for name in channels}
        for at, name, level in changes:
            writer.change(wires[name], at, level)
        writer.close()
    return path


# ---------------------------------------------------------------- the reader


def test_parts_of_a_session_follow_by_number(tmp_path):
    """Ten parts, the tenth after the ninth; the level holds over their borders."""
    parts = {f"logic_1_{number}": bytes([number % 3 == 0, 2]) for number in range(1, 11)}
    capture = open_capture(sigrok_file(tmp_path / "a.sr", **parts))
    assert capture.names == ["A", "B"]
    changes = [(0, 0)]
    for number in (3, 6, 9):
        changes += [(2 * number - 2, 1), (2 * number - 1, 0)]
    assert capture.edges("A", US) == changes
    assert capture.edges("B", US)[:3] == [(0, 0), (1, 1), (2, 0)]
    assert capture.edges("B", 2 * US, invert=True)[:2] == [(0, 1), (2, 0)]


def test_a_vcd_file_has_the_same_edges(tmp_path):
    edges = open_capture(MODULE).edges("1", US)
    copy = open_capture(vcd_file(tmp_path / "a.vcd", bus=edges, other=[(0, 1)]))
    assert copy.edges("bus", US) == edges
    assert copy.names == ["bus", "other"] and copy.only_channel() == "bus"


def test_a_vcd_file_of_a_simulator(tmp_path):
    """Unknown levels, vectors, comments, a name in two scopes."""
    levels = '$dumpvars x! bxxxx % 1" $end #100 1! b1010 % $comment 0! $end #150 x! #300 0! 1! #400 0!'
    (tmp_path / "a.vcd").write_text(VCD_HEADER + levels)
    capture = open_capture(tmp_path / "a.vcd")
    assert capture.names == ["A", "l.m.A"]
    assert capture.edges("A", US) == [(1, 1), (3, 0), (3, 1), (4, 0)]
    assert capture.edges("l.m.A", US) == [(0, 1)]


@pytest.mark.rule("LINE-1")
def test_wrong_parity_and_stop_bits_are_named(tmp_path):
    sent = ((0x55, ""), (0x03, "parity"), (0x00, "stop"), (0xF0, ""))
    file = bus_file(tmp_path, *((0.2, bytes([byte]), flaw) for byte, flaw in sent))
    line = LineFormat(19200, "8E1", US)
    heard = characters(open_capture(file).edges("bus", US), line)
    assert [(c.byte, c.fault) for c in heard] == [(0x55, ""), (3, "parity"), (0, "stop bit"), (0xF0, "")]
    assert pieces(heard, line)[0].fault == "parity of byte 2"


def test_a_glitch_costs_no_character():
    """It ends before the middle of its start bit; the character after it begins within ten bits."""
    line = LineFormat(9600, "8E1", US)
    character = [(round(1150 + i * line.bit), level) for i, level in enumerate(line.levels(0x55))]
    assert [edge[1] for edge in character[:3]] == [0, 1, 0]
    heard = characters([(0, 1), (1000, 0), (1020, 1), *character], line)
    assert [(c.start, c.byte, c.fault) for c in heard] == [(1150, 0x55, "")]


@pytest.mark.nightly("views")
@pytest.mark.parametrize(
    ("name", "channel", "baud", "form", "more"),
    [
        ("brainchild-io-16do", "0", 19200, "8E1", ":parity=even:invert_rx=yes"),
        ("flowmeter_target0_val0", "RXTX", 9600, "8N1", ""),
        ("wizmodbus", "TX", 9600, "8N1", ""),
    ],
)
def test_sigrok_decodes_the_same_characters(name, channel, baud, form, more):
    file = CAPTURES / f"{name}.sr"
    decoder = f"uart:rx={channel}:baudrate={baud}{more}"
    done = subprocess.run(
        ["sigrok-cli", "-i", file, "-P", decoder, "-A", "uart=rx-data"],
        capture_output=True,
        text=True,
        check=True,
    )
    theirs = [int(line.split()[-1], 16) for line in done.stdout.splitlines()]
    line = LineFormat(baud, form, 4 * US)
    ours = characters(open_capture(file).edges(channel, 4 * US, invert=bool(more)), line)
    assert [c.byte for c in ours] == theirs and len(theirs) > 100
    assert not any(c.fault for c in ours)


# ---------------------------------------------------------------- the command


def rows(text: str) -> list[list[str]]:
    return [re.split(r"  +", line.strip()) for line in text.splitlines()]


def bus_file(path: Path, *frames: tuple[float, bytes, str], baud: int = 19200, form: str = "8E1") -> Path:
    """Frames, each after so many characters of silence, with a flaw in each byte or none."""
    line = LineFormat(baud, form, US)
    edges, at = [(0, 1)], 5000.0
    for gap, data, flaw in frames:
        at += gap * 11 * line.bit
        for byte in data:
            levels = [0] * 11 if flaw == "low" else line.levels(byte, flaw)
            edges += [(round(at + i * line.bit), level) for i, level in enumerate(levels)]
            at += len(levels) * line.bit
        edges.append((round(at), 1))
    changed = [edge for last, edge in pairwise(edges) if edge[1] != last[1]]
    return vcd_file(path / "bus.vcd", bus=[edges[0], *changed])


@pytest.mark.rule("FRAME-5", "LINE-6")
def test_replay_names_the_fate_of_each_frame(tmp_path, capsys):
    """The frame in the reply begins 1.5 characters after it and ends before it."""
    read = rtu.build(1, rtu.read_coils(0, 128))
    file = bus_file(
        tmp_path,
        (0, READ, ""),
        (20, SWAPPED, ""),
        (20, READ, "parity"),
        (20, READ[:4], ""),
        (2, READ[4:], ""),
        (20, READ, ""),
        (2, b"\0", ""),
        (20, with_crc(b"\x07\x03\x00"), ""),
        (20, with_crc(bytes([1, 16, *range(254), 0])), ""),
        (20, read, ""),
        (5, rtu.build(2, rtu.read_coils(0, 1)), ""),
        (20, rtu.build(247, rtu.read_registers(1, 1)), ""),
    )
    assert main([str(file), *ASKED]) == 0
    text = capsys.readouterr().out
    assert [row[-2] for row in rows(text) if "bus" in row] == [
        "candidate, committed",
        "dropped: CRC wrong (CRC bytes swapped)",
        "dropped: parity (parity of byte 1)",
        "dropped: continued before 3.5 characters",
        "dropped: CRC wrong",
        "candidate, revoked",
        "ignored: no 3.5 characters before it (too short)",
        "for another unit",
        "dropped: more than 256 bytes (too long)",
        "candidate, committed",
        "not heard: the card was sending",
        "for another unit",
    ]
    assert text.splitlines()[0].startswith("suspicion: CRC bytes swapped in 1 of ")
    assert text.splitlines()[-3:] == [
        "12 frames or parts, 6 good; 2 for other units, 5 dropped",
        "unit 1: 3 candidates, 2 committed, 1 revoked",
        "sent: 2 replies, 0 telegrams",
    ]


# ---------------------------------------------------------------- suspicions
# That request in Modbus ASCII, without and with the even parity of seven bits in the eighth.
ASCII = b":010300010001FA\r\n"
ASCII_EVEN = bytes(byte | (byte.bit_count() & 1) << 7 for byte in ASCII)
# Sent, in which format, read in which format, and what is suspected.
SUSPICIONS = [
    ((SWAPPED, SWAPPED), "8E1", "8E1", "CRC bytes swapped in 2 of 2 frames: the low byte goes first"),
    ((ASCII,), "8E1", "8E1", "Modbus ASCII in 1 of 1 frames: the card serves Modbus RTU alone"),
    ((ASCII_EVEN,), "8N1", "8N1", "Modbus ASCII in 1 of 1 frames: the card serves Modbus RTU alone"),
    ((READ,), "8O1", "8E1", replay.NOT_HERE),
    ((b"\x55\xaa\x01\x02\x03",), "8E1", "8E1", replay.NOT_HERE),
    ((READ,), "8E1", "8E1"),
]


def test_frames_that_are_all_damaged_have_a_suspicion(tmp_path):
    for sent, form, read_as, *suspected in SUSPICIONS:
        file = bus_file(tmp_path, *((20, data, "") for data in sent), form=form)
        edges = open_capture(file).edges("bus", US)
        assert replay.suspicions(edges, LineFormat(19200, read_as, US)) == suspected


def test_the_guide_explains_every_fate_and_suspicion():
    guide = (ROOT / "docs/guide/recordings.md").read_text()
    for text in (*REASONS.values(), UNHEARD, IGNORED, replay.LEFT_OUT, "not answered in time", "revoked"):
        word = text.split(":")[0] if text in (UNHEARD, IGNORED, replay.LEFT_OUT) else text
        assert re.search(rf"^\| `{re.escape(word)}` \|", guide, re.MULTILINE), text
    for text in (*replay.MEANINGS, "no frame is good"):
        assert re.search(rf"^\| `{text}` \|", guide, re.MULTILINE), text


# ---------------------------------------------------------------- other builds of the card
@pytest.mark.nightly
@pytest.mark.rule("FRAME-2", "FRAME-3")
@pytest.mark.parametrize(
    ("option", "frames"),
    [
        (["--strict-t15", "no"], [(20, READ[:4], ""), (2, READ[4:], "")]),
        (["--break-tolerant", "yes"], [(20, READ, ""), (1, bytes(20), "low")]),
    ],
)
def test_a_card_with_an_option_of_the_firmware_answers_what_the_other_drops(option, frames, tmp_path, capsys):
    file = bus_file(tmp_path, *frames)
    for options, replies in ([], 0), (option, 1):
        assert main([str(file), *ASKED, *options]) == 0
        assert f"sent: {replies} replies" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "answer"),
    [
        (["--dialect", STANDARD], "01 C1 01 B0 50"),
        pytest.param(
            ["--config", "tiny"], "01 C1 43 30 61", marks=pytest.mark.nightly
        ),  # Verilator builds it for some seconds
    ],
)
def test_dialect_and_configuration_can_be_chosen(options, answer, tmp_path, capsys, monkeypatch):
    made = []
    monkeypatch.setattr(replay, "Target", lambda **given: made.append(Target(**given)) or made[-1])
    file = bus_file(tmp_path, (20, rtu.build(1, b"\x41"), ""))
    assert main([str(file), *ASKED, *options]) == 0
    (reply,) = [row[-1] for row in rows(capsys.readouterr().out) if "reply" in row]
    assert reply == answer
    assert any(path.stem == "serv_top" for path in made[0].files()) == ("tiny" in options)
    assert (made[0].image_folder("card") == ROOT / "build/tiny") == ("tiny" in options)


def test_replies_of_the_unit_can_be_left_out(tmp_path, capsys):
    """Those of another unit stay."""
    reply = rtu.build(1, bytes.fromhex("03 02 03E8"))
    pair = ((20, READ, ""), (4, reply, ""))
    others = ((20, b"\2" + READ[1:-2], ""), (4, b"\2" + reply[1:-2], ""))
    file = bus_file(tmp_path, *pair, *((gap, with_crc(data), flaw) for gap, data, flaw in others), *pair)
    assert main([str(file), *ASKED, "--replies", "no"]) == 0
    text = capsys.readouterr().out
    assert [row[-2].split(":")[0] for row in rows(text) if "bus" in row] == [
        *("candidate, committed", "left out"),
        *("for another unit", "for another unit"),
        *("candidate, committed", "left out"),
    ]
    assert text.splitlines()[-1] == "sent: 2 replies, 0 telegrams"


# ---------------------------------------------------------------- bad input


@pytest.fixture
def never_played(monkeypatch):
    monkeypatch.setattr(replay, "Replay", None)


def refused(capsys, file: object, *options: str) -> str:
    try:
        code = main([str(file), *(options or ASKED)])
    except SystemExit as end:
        code = end.code
    said = capsys.readouterr()
    assert (code, said.out) == (2, "") and said.err.count("\n") == 1
    return said.err.strip()


def test_a_file_that_is_not_there(tmp_path, capsys, never_played):
    assert "No such file or directory" in refused(capsys, tmp_path / "bus.sr")


def test_damaged_samples(tmp_path, capsys, never_played):
    data = bytearray(MODULE.read_bytes())
    with zipfile.ZipFile(MODULE) as archive:
        info = archive.getinfo("logic-1-5")
    at = info.header_offset + 30 + len(info.filename) + 10
    data[at : at + 40] = bytes(40)
    file = tmp_path / "a.sr"
    file.write_bytes(data)
    assert refused(capsys, file, *ASKED, "--channel", "1").endswith("the recording is damaged")


@pytest.mark.rule("LINE-2")
def test_a_recording_without_a_character(tmp_path, capsys, never_played):
    """A whole frame at 115200 bit/s is shorter than half a bit at 300 bit/s."""
    file = bus_file(tmp_path, (20, READ, ""), baud=115200)
    said = refused(capsys, file, "--unit", "1", "--baud", "300")
    assert said.endswith(f"channel bus: no character at 300 8N2; {replay.NOT_HERE}")


@pytest.mark.rule("LINE-7")
@pytest.mark.parametrize("options", [["--unit", "248"], ["--baud", "9601"], ["--for", "nan"]])
def test_a_wrong_option(options, capsys, never_played):
    assert refused(capsys, MODULE, *ASKED, *options).startswith("replay: ")
