# SPDX-License-Identifier: Apache-2.0
"""Waveform, capture and log of one run agree, from the virtual card and from the benches.

tshark reads the captures, pywellen the waveforms.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import cocotb
import pytest
from cocotb.triggers import Timer

from rtl.sources import ROOT, needed_files, rtl_files
from sim.card.run_card import RunningCard
from sim.harness.wave_rows import copies_with_rows
from sim.view import tshark
from sim.view.wave_file import WaveFile
from sim.view.waves import missing, save_file
from tb.agents import rtu
from tb.agents.crc16 import with_crc
from tb.agents.uart import Character, Format
from tb.lib.recording import DRIVE, MODBUS, Recorder
from tb.lib.runner import WAVES_FOLDER, run
from tb.model import fc_telegram

pytestmark = pytest.mark.nightly("views")

BAUD = 9600
PS_PER_S = 1_000_000_000_000
CHARACTER_PS = rtu.CHARACTER_BITS * rtu.bit_ps(BAUD)
READ_CONTROL = with_crc(bytes.fromhex("01 01 00 00 00 20"))
START = bytes.fromhex("02 06 81 04 7C 19 99 7D")
TSHARK_FIELDS = (
    *("frame.time_epoch", "frame.interface_name", "frame.packet_flags_direction", "frame.comment"),
    *("frame.len", "frame.packet_flags"),
)
# Bits of the capture's packet flags.
CRC_ERROR, TOO_SHORT, TOO_LONG, WRONG_GAP, NO_START, SYMBOL_ERROR = 24, 26, 25, 27, 29, 31
GAP = "gap: not complete after 5 bytes, then 2.00 characters of silence"
REVOKED = "revoked: good after 8 bytes, but 2.00 characters later the next one began"


# ---------------------------------------------------------------- the recorder alone
class Talk:
    """Sends characters one after the other into a recorder, on both lines at 9600 bit/s."""

    def __init__(self, recorder: Recorder) -> None:
        self.recorder = recorder
        self.now_ps = PS_PER_S / 100
        for line in (MODBUS, DRIVE):
            recorder.use(line, Format.named(BAUD, "8E1" if line == DRIVE else "8N2"))

    def silence(self, characters: float) -> None:
        self.now_ps += characters * CHARACTER_PS

    def say(self, line: int, from_card: bool, data: bytes, bad_parity: int = -1, bad_stop: int = -1) -> None:
        for number, byte in enumerate(data):
            start, self.now_ps = self.now_ps, self.now_ps + CHARACTER_PS
            heard = Character(
                byte, round(start), round(self.now_ps), number != bad_parity, number != bad_stop
            )
            self.recorder.character(line, from_card, heard)


def log_of(base: Path) -> list[dict]:
    return [json.loads(line) for line in Path(f"{base}.jsonl").read_text().splitlines()]


def check_capture(entries: list[dict], packets: list[dict]) -> None:
    """Line, direction, microsecond, length, description and mark of every frame of the log."""
    assert len(packets) == len(entries)
    times = [float(packet["frame.time_epoch"]) for packet in packets]
    assert times == sorted(times)
    for entry, packet in zip(entries, packets, strict=True):
        assert packet["frame.interface_name"] == entry["line"]
        sent = entry["from"] == "card"
        assert int(packet["frame.packet_flags_direction"], 16) == (2 if sent else 1)
        assert float(packet["frame.time_epoch"]) == pytest.approx(entry["t"], abs=1e-9)
        assert int(packet["frame.len"]) == len(bytes.fromhex(entry["bytes"]))
        assert packet["frame.comment"] == ("" if entry["ok"] else "bad frame: ") + entry["what"]
        assert (int(packet["frame.packet_flags"], 16) >> 24 == 0) == entry["ok"]


@pytest.mark.rule("FRAME-2", "FRAME-3", "FRAME-4", "FC-8")
@pytest.mark.parametrize(
    ("line", "pieces", "flaws", "words", "bit"),
    [
        (MODBUS, [READ_CONTROL[:-1] + b"\0"], {}, "CRC wrong", CRC_ERROR),
        (MODBUS, [READ_CONTROL], {"bad_parity": 2}, "parity wrong in byte 3", SYMBOL_ERROR),
        (MODBUS, [READ_CONTROL], {"bad_stop": 7}, "stop bit wrong in byte 8", SYMBOL_ERROR),
        (MODBUS, [READ_CONTROL[:3]], {}, "too short for a frame", TOO_SHORT),
        (MODBUS, [bytes(257)], {}, "too long for a frame", TOO_LONG),
        (MODBUS, [READ_CONTROL[:5], READ_CONTROL], {}, GAP, WRONG_GAP),
        (MODBUS, [READ_CONTROL, b"\x01"], {}, REVOKED, WRONG_GAP),
        (DRIVE, [START[:-1] + b"\0"], {}, "BCC wrong", CRC_ERROR),
        (DRIVE, [b"\3" + START[1:]], {}, "no STX", NO_START),
        (DRIVE, [START[:5]], {}, "gap: silence after 5 of 8 bytes", WRONG_GAP),
        (DRIVE, [START + b"\0"], {}, "LGE does not fit the length", TOO_LONG),
        (DRIVE, [START], {"bad_parity": 0}, "parity wrong in byte 1", SYMBOL_ERROR),
    ],
)
def test_bad_frame_is_described(tmp_path, line, pieces, flaws, words, bit):
    base = tmp_path / "lines"
    with Recorder(base) as recorder:
        talk = Talk(recorder)
        for piece in pieces:
            talk.say(line, False, piece, **flaws)
            talk.silence(2)
    entries = [entry for entry in log_of(base) if "line" in entry]
    packets = tshark.fields(Path(f"{base}.pcapng"), *TSHARK_FIELDS)
    check_capture(entries, packets)
    assert (entries[0]["ok"], entries[0]["what"]) == (False, words)
    assert int(packets[0]["frame.packet_flags"], 16) >> 24 == 1 << bit - 24
    # Only the bytes after a gap are a frame of their own (FRAME-2).
    assert [entry["ok"] for entry in entries[1:]] == ([True] if words == GAP else [])


# ---------------------------------------------------------------- the virtual card's three files
def check_wave(wave: Path, entries: list[dict], baud: int) -> None:
    """DE in the waveform rises and falls with every frame of the card, at the log's times."""
    pulses = WaveFile(wave).pulses
    for line in ("modbus", "drive"):
        own = [e for e in entries if e.get("line") == line and e["from"] == "card"]
        high = pulses(f"{line}_de")
        assert len(high) == len(own) > 0
        bit = 1 / (baud if line == "modbus" else 9600)
        for entry, (rise, fall) in zip(own, high, strict=True):
            assert 0 <= entry["t"] - rise <= bit
            assert -0.05 * bit <= fall - entry["end"] <= bit


def test_files_of_the_virtual_card_agree(tmp_path):
    wave, pcap = tmp_path / "card.fst", tmp_path / "card.pcapng"
    options = ("--drive", "example", "--speed", "max", "--wave", str(wave), "--pcap", str(pcap))
    start_40 = bytes.fromhex("01 0F 00 00 00 20 04 7C 04 99 19 37 43")
    with RunningCard(tmp_path, *options) as card:
        fd = os.open(card.link, os.O_RDWR | os.O_NOCTTY)
        for number, request in enumerate((start_40, READ_CONTROL[:-1] + b"\0", READ_CONTROL)):
            before = len(card.frames())
            os.write(fd, request)
            card.wait_for_frames(before, "modbus", "master" if number == 1 else "card")
        os.close(fd)
        assert card.stop() == 0
        entries = card.entries()
    frames = [e for e in entries if "line" in e]
    assert [e["ok"] for e in frames] == [True] * 4 + [False] + [True] * 2
    check_capture(frames, tshark.fields(pcap, *TSHARK_FIELDS))
    check_wave(wave, entries, BAUD)
    check_card_views(wave)
    command = [sys.executable, "-m", "sim.view.waves", wave]
    assert f"gtkwave {wave} {wave.with_suffix('.gtkw')}" in subprocess.check_output(
        command, cwd=ROOT, text=True
    )
    errors = [name for name in WaveFile(wave).signals if name.endswith(("parity_flaw", "framing_flaw"))]
    assert len(errors) == 4 and not any(map(WaveFile(wave).pulses, errors)), "every character was good"


def test_a_waveform_that_cannot_be_read_is_one_line(tmp_path):
    """The writer of a running card fills in the header at its end."""
    (tmp_path / "card.fst").write_bytes(bytes(329))
    command = [sys.executable, "-m", "sim.view.waves", tmp_path / "card.fst"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    words = "waves: the waveform is unfinished: its program still runs or was killed\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", words)


# ---------------------------------------------------------------- the views of a waveform
def check_views(wave: Path, view: Path) -> list[str]:
    """Every signal named by a view is in the waveform; returns the names."""
    there = {s.path: s.width for s in WaveFile(wave).signals.values()}
    lines = [line for line in view.read_text().splitlines() if line and line[0] not in "@-^[*"]
    shown = [line.split("} ", 1)[-1] for line in lines]
    assert shown
    for name in shown:
        path, bits = re.fullmatch(r"(.*?)(?:\[(\d+:\d+)\])?", name).groups()
        high, low = map(int, bits.split(":")) if bits else (0, 0)
        assert there.get(path) == high - low + 1, name
    return shown


def check_card_views(wave: Path) -> None:
    """Every entry of the list is found; states and addresses have names."""
    view = save_file(wave, "rtu2fc")
    assert missing("rtu2fc", WaveFile(wave).signals) == []
    shown = check_views(wave, view)
    for wanted in (
        "modbus_de",
        "drive_de",
        "candidate",
        "commit",
        "revoke",
        "led_drive_green",
        "core_addr[31:0]",
    ):
        assert any(name.endswith(f".{wanted}") for name in shown), wanted
    names = (wave.parent / "firmware.txt").read_text()
    for name in ("main", "REQUEST", "gateway_poll"):
        assert re.search(rf"^[0-9A-F]{{8}} .*\b{name}\b", names, re.MULTILINE), name


@pytest.mark.parametrize("top", sorted(path.stem for path in rtl_files()))
def test_every_module_has_a_view_of_its_ports_and_states(tmp_path, top):
    """Each module with an idle waveform."""
    dumper, wave = tmp_path / "dump.v", tmp_path / f"{top}.fst"
    dumper.write_text(
        f'module dump; initial begin $dumpfile("{wave}"); $dumpvars(0, {top}); #1 $finish; end\nendmodule\n'
    )
    program = tmp_path / "sim"
    build = ["iverilog", "-g2005", "-s", top, "-s", "dump", "-o", program]
    build += [*copies_with_rows(needed_files(top), tmp_path / "sources"), dumper]
    for command in (build, ["vvp", program, "-fst"]):
        done = subprocess.run(
            list(map(str, command)), cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
    shown = check_views(wave, save_file(wave, top))
    if top != "rtu2fc":
        source = next(path for path in rtl_files() if path.stem == top).read_text()
        ports = re.findall(r"^ +(?:input|output)\b.*?(\w+),?$", source, re.MULTILINE)
        assert ports
        assert {re.sub(r"\[.*", "", name) for name in shown} >= {f"{top}.{port}" for port in ports}
        for leaf in ("state_name", "frame_text"):
            there = {s.path for s in WaveFile(wave).signals.values() if s.leaf == leaf}
            assert {re.sub(r"\[.*", "", name) for name in shown if leaf in name} == there


# ---------------------------------------------------------------- the benches' three files
FAST = 38_400
CLK_HZ = 2_000_000
BENCH_WAVE = WAVES_FOLDER / "test_recordings.test_files_of_a_bench_agree.fst"


@cocotb.test
async def good_damaged_revoked_and_refused(dut):
    """One transaction of each kind, on a whole card."""
    from tb.agents.uart import Flaws
    from tb.lib.card import MS, CardBench

    start, status = fc_telegram.build_process(0x047C, 0x1999), fc_telegram.build_process(0x0F03, 0x2000)
    card = await CardBench(dut, CLK_HZ, {start: status}.get, baud=FAST, form="8E1").boot()
    done = await card.master.request(bytes.fromhex("01 0F 00 00 00 20 04 7C 04 99 19 37 43"), 100 * MS)
    assert done.data == bytes.fromhex("01 0F 00 00 00 20 54 13")
    await card.master.send(READ_CONTROL, Flaws(bad_parity=(3,)))
    await Timer(3 * MS, unit="ps")
    await card.master.send(
        READ_CONTROL + b"\1", Flaws(gaps={len(READ_CONTROL): 2 * rtu.t15_ps(FAST) / 1.5 / rtu.bit_ps(FAST)})
    )
    await Timer(3 * MS, unit="ps")
    done = await card.master.request(with_crc(bytes.fromhex("01 01 00 80 00 01")), 10 * MS)
    assert done.data == with_crc(bytes.fromhex("01 81 40"))


def test_files_of_a_bench_agree(monkeypatch):
    monkeypatch.setenv("WAVES", "1")
    run("rtu2fc", __name__, sim="icarus", parameters={"CLK_HZ": CLK_HZ})
    entries = log_of(BENCH_WAVE.with_suffix(""))
    frames = [e for e in entries if "line" in e]
    check_capture(frames, tshark.fields(BENCH_WAVE.with_suffix(".pcapng"), *TSHARK_FIELDS))
    check_wave(BENCH_WAVE, entries, FAST)
    check_card_views(BENCH_WAVE)
    assert [(e["line"], e["from"], e["what"]) for e in frames] == [
        ("modbus", "master", "unit 1: write coils 1-32 = 047Ch 1999h"),
        ("drive", "card", "control 047Ch, reference 1999h (40.0 %)"),
        ("drive", "drive", "status 0F03h, frequency 2000h (50.0 %)"),
        ("modbus", "card", "unit 1: write done"),
        ("modbus", "master", "parity wrong in byte 4"),
        ("modbus", "master", REVOKED),
        ("modbus", "master", "unit 1: read coil 129"),
        ("modbus", "card", "unit 1: exception 64: no such coil or register"),
    ]
    assert [e["shows"] for e in entries if e.get("led") == "drive"] == ["off"]
