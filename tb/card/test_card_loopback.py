# SPDX-License-Identifier: Apache-2.0
"""Loop-back test of the manual (p13) at the pins: both ports wired to each other, switches set for it.

The transfers, 130 ms, run on both simulators. The verdict comes after the power-up show, 2 s, and stands for
12 s: at the 25000 clocks a second of Icarus that is 20 minutes, so it is seen on the Verilated card without
cocotb (`FastCard`), where sim/harness/line_player.h is the wire.
"""

from __future__ import annotations

import cocotb
import pytest
from cocotb.triggers import First, Timer, ValueChange

from tb.lib.bench import Bench
from tb.lib.card import MS, switch_word
from tb.lib.config import CLK_HZ, SLOW_HZ, boot_clocks
from tb.lib.fast_card import FastCard
from tb.lib.rs485 import DirectionMonitor
from tb.lib.runner import run
from tb.lib.supervision import Leds, Shown
from tb.lib.uart_agent import Format, Frame, UartMonitor
from tb.model import fc_telegram, rtu
from tb.model.crc16 import crc_good

SWITCHES = "111001111"
LINE = Format.named(9600, "8E1")
SHOW_MS, VERDICT_MS, FLASH_MS = 2000, 12_000, 500
ACCURACY = 0.01
READ_DRIVE_TIMEOUT = rtu.build(1, rtu.read_registers(2, 1))
DRIVE_TIMEOUT = rtu.build(1, bytes.fromhex("03 02 00 0F"))
CONTROL_BIT_10 = 0x0400


# ---------------------------------------------------------------- the transfers, on both simulators


async def wire(dut, sender: str, other: str) -> None:
    """One direction of a half-duplex pair: `other` receives the sender's tx while its DE is high, else 1."""
    tx, de = getattr(dut, f"{sender}_tx"), getattr(dut, f"{sender}_de")
    while True:
        await First(ValueChange(tx), ValueChange(de))
        getattr(dut, f"{other}_rx").value = 0 if str(de.value) == "1" and str(tx.value) == "0" else 1


class Port:
    """Monitors the sent and the received characters of one port."""

    def __init__(self, dut, name: str):
        self.sent = UartMonitor(getattr(dut, f"{name}_tx"), LINE)
        self.heard = UartMonitor(getattr(dut, f"{name}_rx"), LINE)
        self.direction = DirectionMonitor(getattr(dut, f"{name}_de"))

    def frame(self) -> Frame:
        """The single frame that the port sent."""
        assert len(self.direction.pulses) == 1, "one transmission each"
        (frame,) = self.sent.frames()
        assert frame.ok
        pulse = self.direction.pulses[0]
        assert pulse.rise_ps < frame.start_ps and frame.end_ps <= pulse.fall_ps + 0.02 * LINE.bit_ps
        return frame


@cocotb.test()
async def each_port_sends_a_pattern_that_the_other_receives(dut):
    bench = Bench(dut, CLK_HZ, sw_baud=switch_word(SWITCHES), sw_addr=1, modbus_rx=1, drive_rx=1)
    for sender, other in (("modbus", "drive"), ("drive", "modbus")):
        cocotb.start_soon(wire(dut, sender, other))
    network, drive = Port(dut, "modbus"), Port(dut, "drive")
    leds = Leds(dut)
    await bench.start(reset_clocks=8)
    # A start takes less than half of BOOT-1, the transfers 70 ms, the first step of the show 250 ms.
    await Timer(round(70 * MS + boot_clocks() / 2 * bench.period_ps), unit="ps")
    telegram, frame = drive.frame(), network.frame()
    for sent, other in ((telegram, network), (frame, drive)):
        assert [c.byte for c in other.heard.characters] == list(sent.data)
    ends = sorted([(telegram.start_ps, telegram.end_ps), (frame.start_ps, frame.end_ps)])
    assert ends[0][1] < ends[1][0], "one after the other"
    check_harmless(telegram.data)
    assert crc_good(frame.data)
    # The power-up show continues meanwhile (LED-1).
    assert leds.show("drive") == "red" and leds.show("modbus") == "off"


def check_harmless(telegram: bytes) -> None:
    """Checks a telegram that any drive may receive: well-formed and without a command (SAFE-1)."""
    parts = fc_telegram.parse(telegram)
    assert not parts.pcd1 & CONTROL_BIT_10
    assert parts.ak in (None, fc_telegram.AK_NONE)


# ---------------------------------------------------------------- the verdict


def run_to_verdict(card: FastCard) -> tuple[str, str]:
    """Runs until well after the power-up show; returns both LEDs (network, drive)."""
    card.run_until((SHOW_MS + 150) * MS)
    for telegram in card.drive.frames():
        check_harmless(telegram.data)
    return card.led("modbus"), card.led("drive")


def verdict_of(history: list[Shown]) -> tuple[Shown, Shown]:
    """The verdict and the colour after it."""
    at = next(i for i, shown in enumerate(history) if shown.since_ps > (SHOW_MS - 50) * MS)
    return history[at], history[at + 1]


def check_verdict(card: FastCard, shows: str) -> None:
    """Both LEDs show the verdict for its time; no request is served meanwhile."""
    assert run_to_verdict(card) == (shows, shows)
    sent = len(card.modbus.frames()), len(card.drive.frames())
    card.set(wired=0)
    assert card.request(READ_DRIVE_TIMEOUT) is None
    card.run_until((SHOW_MS + VERDICT_MS + 700) * MS)
    assert (len(card.modbus.frames()), len(card.drive.frames())) == sent
    for led in ("modbus", "drive"):
        verdict, then = verdict_of(card.shown[led])
        lasted = (then.since_ps - verdict.since_ps) / MS
        # Flashing red starts with its lit half, which looks like more of a red verdict.
        expected = VERDICT_MS + (FLASH_MS if then.colour == "off" else 0)
        print(f"{led} LED {verdict.colour} for {lasted:.1f} ms, then {then.colour}")
        assert verdict.colour == shows and abs(lasted - expected) <= ACCURACY * VERDICT_MS


@pytest.mark.rule("LOOP-1", "LED-2")
def test_a_passed_loopback_test_is_orange_for_twelve_seconds_and_then_the_card_works(config):
    with FastCard(SWITCHES, config=config, wired=1) as card:
        check_verdict(card, "orange")
        assert card.request(READ_DRIVE_TIMEOUT).data == DRIVE_TIMEOUT
        later = card.now_ps
        card.run(2500)
        flashing = {shown.colour for shown in card.shown["modbus"] if shown.since_ps > later + 1000 * MS}
        assert flashing == {"green", "off"}


@pytest.mark.rule("LOOP-1", "LED-2")
def test_a_failed_loopback_test_is_red_for_twelve_seconds_and_then_the_card_works(config):
    with FastCard(SWITCHES, config=config, wired=0) as card:
        check_verdict(card, "red")
        assert card.request(READ_DRIVE_TIMEOUT).data == DRIVE_TIMEOUT


@pytest.mark.rule("LOOP-1", "LINE-7", "LED-5")
def test_the_loopback_test_needs_no_address_but_the_start_after_it_does(config):
    with FastCard(SWITCHES, config=config, wired=1, address=0) as card:
        check_verdict(card, "orange")
        assert {card.led("modbus"), card.led("drive")} == {"red"}
        card.run(1000)
        for led in ("modbus", "drive"):
            assert card.shown[led][-1].since_ps < (SHOW_MS + VERDICT_MS + card.boot_ms) * MS, "solid"
        assert card.request(READ_DRIVE_TIMEOUT) is None


# For a receiver a wire stuck at 1 is the same as a cut one.
FAULTS = {
    "wire broken, or stuck at 1": {"cut_to_modbus": 1, "cut_to_drive": 1},
    "network to drive dead": {"cut_to_drive": 1},
    "drive to network dead": {"cut_to_modbus": 1},
    "wire stuck at 0": {"modbus_line": 0, "drive_line": 0},
    "network port stuck at 0": {"modbus_line": 0},
    "drive port stuck at 0": {"drive_line": 0},
    "network port hears the wires swapped": {"flip_to_modbus": 1},
    "drive port hears the wires swapped": {"flip_to_drive": 1},
}


@pytest.mark.rule("LOOP-1")
@pytest.mark.parametrize("fault", FAULTS)
def test_a_wiring_fault_is_red(config, fault: str):
    with FastCard(SWITCHES, config=config, wired=1, **FAULTS[fault]) as card:
        assert run_to_verdict(card) == ("red", "red")


# Number of the character and its inverted data bits. Two bits of one character keep its parity right.
FLIPS = {"first data": (3, (0,)), "last data": (11, (7,)), "parity stays right": (8, (2, 5))}


@pytest.mark.rule("LOOP-1")
@pytest.mark.parametrize("flips", FLIPS)
@pytest.mark.parametrize("sender", ["drive", "modbus"])
def test_a_flipped_bit_on_the_wire_is_red(config, sender: str, flips: str):
    character, bits = FLIPS[flips]
    other = {"drive": "modbus", "modbus": "drive"}[sender]
    with FastCard(SWITCHES, config=config, wired=1) as card:
        assert card.run_until(200 * MS, f"{sender}_de") and card.run_until(200 * MS, f"{sender}_tx")
        start = card.now_ps + character * LINE.character_ps
        for bit in bits:
            card.plan(start + (1 + bit) * LINE.bit_ps, f"flip_to_{other}", 1)
            card.plan(start + (2 + bit) * LINE.bit_ps, f"flip_to_{other}", 0)
        assert run_to_verdict(card) == ("red", "red")


@pytest.mark.rule("LOOP-1")
def test_other_switch_settings_do_not_start_the_loopback_test(config):
    for switch in range(9):
        moved = SWITCHES[:switch] + "10"[int(SWITCHES[switch])] + SWITCHES[switch + 1 :]
        with FastCard(moved, config=config, wired=1) as card:
            card.run(120)
            assert not card.modbus.de and not card.drive.de, moved


# ---------------------------------------------------------------- pytest


@pytest.mark.rule("LOOP-1", "SAFE-1")
def test_loopback_transfers(sim, config):
    parameters = {"CLK_HZ": SLOW_HZ[config]}
    run("rtu2fc", "tb.card.test_card_loopback", sim=sim, config=config, parameters=parameters)
