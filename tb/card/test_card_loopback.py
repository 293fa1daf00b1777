# SPDX-License-Identifier: Apache-2.0
"""Loop-back test of the manual (p13) at the pins: both ports wired to each other, switches set for it.

The verdict comes after the power-up show of 2 s and stands for 12 s; sim/harness/line_player.h is the wire.
"""

from __future__ import annotations

import pytest

from tb.agents import rtu
from tb.agents.crc16 import crc_good
from tb.agents.uart import Format
from tb.lib.card import MS
from tb.lib.fast_card import FastCard, Line, Shown
from tb.lib.nightly import first
from tb.model import fc_telegram

SWITCHES = "111001111"
LINE = Format.named(9600, "8E1")
SHOW_MS, VERDICT_MS = 2000, 12_000
LISTEN_MS, TRANSFERS_MS = 1000, 120
ACCURACY = 0.01
READ_DRIVE_TIMEOUT = rtu.build(1, rtu.read_registers(2, 1))
DRIVE_TIMEOUT = rtu.build(1, bytes.fromhex("03 02 00 0F"))
CONTROL_BIT_10 = 0x04
CRC_BYTES = 2
drive_first = pytest.mark.parametrize("name", first(["drive", "modbus"]))
network_first = pytest.mark.parametrize("name", first(["modbus", "drive"]))


def check_harmless(pattern: bytes) -> None:
    """Checks that no slave and no drive accepts any part of a pattern (LOOP-1, SAFE-1)."""
    for begin in range(len(pattern)):
        for end in range(begin + 2 + CRC_BYTES, len(pattern) + 1):
            assert not crc_good(pattern[begin:end]), "a Modbus frame"
        with pytest.raises(fc_telegram.TelegramError):
            fc_telegram.parse(pattern[begin : begin + 2 + (pattern[begin + 1 : begin + 2] or b"\0")[0]])
    assert not pattern[-5] & CONTROL_BIT_10, "a command, if its BCC were right"


def run_to_verdict(card: FastCard) -> tuple[str, str]:
    """Runs until well after the power-up show; returns both LEDs (network, drive)."""
    card.run_until((SHOW_MS + 150) * MS)
    for frame in card.drive.frames() + card.modbus.frames():
        assert frame.start_ps >= LISTEN_MS * MS
        check_harmless(frame.data)
    return card.led("modbus"), card.led("drive")


def check_transfers(card: FastCard) -> None:
    """Each port has sent one pattern, one after the other."""
    for line in (card.modbus, card.drive):
        line.check()
    (telegram,), (frame,) = card.drive.frames(), card.modbus.frames()
    assert telegram.end_ps < frame.start_ps or frame.end_ps < telegram.start_ps


def verdict_of(history: list[Shown]) -> tuple[Shown, Shown]:
    """The verdict and the colour after it."""
    at = next(i for i, shown in enumerate(history) if shown.since_ps > (SHOW_MS - 50) * MS)
    return history[at], history[at + 1]


def check_passed(card: FastCard) -> None:
    """Both LEDs are orange for the verdict's time, and nothing more is sent."""
    assert run_to_verdict(card) == ("orange", "orange")
    check_transfers(card)
    card.set(wired=0)
    card.run_until((SHOW_MS + VERDICT_MS + 700) * MS)
    check_transfers(card)
    for led in ("modbus", "drive"):
        verdict, then = verdict_of(card.shown[led])
        lasted = (then.since_ps - verdict.since_ps) / MS
        print(f"{led} LED {verdict.colour} for {lasted:.1f} ms, then {then.colour}")
        assert verdict.colour == "orange" and abs(lasted - VERDICT_MS) <= ACCURACY * VERDICT_MS


@pytest.mark.nightly
@pytest.mark.rule("LOOP-1", "LED-2")
def test_a_passed_loopback_test_is_orange_for_twelve_seconds_and_then_the_card_works(config):
    with FastCard(SWITCHES, config=config, wired=1) as card:
        check_passed(card)
        assert card.request(READ_DRIVE_TIMEOUT).data == DRIVE_TIMEOUT
        later = card.now_ps
        card.run(2500)
        flashing = {shown.colour for shown in card.shown["modbus"] if shown.since_ps > later + 1000 * MS}
        assert flashing == {"green", "off"}


@pytest.mark.nightly
@pytest.mark.rule("LOOP-1", "LINE-7", "LED-5")
def test_the_loopback_test_needs_no_address_but_the_start_after_it_does(config):
    with FastCard(SWITCHES, config=config, wired=1, address=0) as card:
        check_passed(card)
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
@pytest.mark.parametrize("fault", first(list(FAULTS)))
def test_a_wiring_fault_is_red(config, fault: str):
    with FastCard(SWITCHES, config=config, wired=1, **FAULTS[fault]) as card:
        assert run_to_verdict(card) == ("red", "red")


# Number of the character and its inverted data bits. Two bits of one character keep its parity right.
FLIPS = {"first data": (3, (0,)), "last": (15, (7,)), "parity stays right": (8, (2, 5))}


@pytest.mark.rule("LOOP-1")
@pytest.mark.parametrize("flips", first(list(FLIPS)))
@pytest.mark.parametrize("sender", first(["drive", "modbus"]))
def test_a_flipped_bit_on_the_wire_is_red(config, sender: str, flips: str):
    character, bits = FLIPS[flips]
    other = {"drive": "modbus", "modbus": "drive"}[sender]
    with FastCard(SWITCHES, config=config, wired=1) as card:
        assert card.run_until(1500 * MS, f"{sender}_de") and card.run_until(1500 * MS, f"{sender}_tx")
        start = card.now_ps + character * LINE.character_ps
        for bit in bits:
            card.plan(start + (1 + bit) * LINE.bit_ps, f"flip_to_{other}", 1)
            card.plan(start + (2 + bit) * LINE.bit_ps, f"flip_to_{other}", 0)
        assert run_to_verdict(card) == ("red", "red")


# ---------------------------------------------------------------- a live bus

REQUEST = rtu.build(2, rtu.read_registers(5139, 2))
ANSWER = rtu.build(2, bytes.fromhex("03 04 0000 012C"))
FOREIGN = {
    "unit 2 polled": (REQUEST, ANSWER),
    "one character, the memory's filler": (b"\x5a",),
    "drive telegrams": (bytes.fromhex("02 06 82 0000 0000 86"), bytes.fromhex("02 06 82 0F03 2000 AA")),
    "our own pattern": (bytes.fromhex("02 0E 81 0000 0000 55AA FF01 0000 0000 73"),),
}
RATES = [
    (9600, "8E1"),
    (9600, "8N2"),
    (19200, "8E1"),
    (2400, "8O1"),
    (300, "8E1"),
    (38400, "8N2"),
    (115200, "8E1"),
]


def play_traffic(
    card: FastCard, name: str, fmt: Format, frames: tuple[bytes, ...], until_ms: float, period_ms: float = 150
) -> None:
    """Someone else's frames on a line, one after the other, until a time."""
    line = Line(card, name, fmt)
    while card.now_ps < until_ms * MS:
        for data in frames:
            line.send(data, 5 * fmt.character_ps)
        card.run_until(min(until_ms * MS, card.now_ps + period_ms * MS))


def check_untouched(card: FastCard) -> None:
    assert not card.modbus.de and not card.drive.de, "nothing is ever sent"
    assert run_to_verdict(card) == ("red", "red")


@pytest.mark.rule("LOOP-1")
@pytest.mark.parametrize("rate", first(RATES), ids=lambda rate: "{}-{}".format(*rate))
@network_first
def test_nothing_is_sent_into_a_live_bus_at_any_rate(config, name: str, rate: tuple[int, str]):
    with FastCard(SWITCHES, config=config) as card:
        play_traffic(card, name, Format.named(*rate), FOREIGN["unit 2 polled"], 1500)
        check_untouched(card)


@pytest.mark.rule("LOOP-1")
@pytest.mark.parametrize("kind", first(list(FOREIGN)))
@drive_first
def test_any_character_of_the_second_before_is_a_failure(config, name: str, kind: str):
    """It comes once, near the end of that second."""
    with FastCard(SWITCHES, config=config, wired=1) as card:
        card.run_until(940 * MS)
        Line(card, name, LINE).send(FOREIGN[kind][0])
        card.run_until(1500 * MS)
        check_untouched(card)


@pytest.mark.rule("LOOP-1")
def test_a_failed_test_is_over_at_once(config):
    """A bus that was silent for longer than the card listens: the first request is answered."""
    with FastCard(SWITCHES, config=config) as card:
        assert run_to_verdict(card) == ("red", "red")
        assert len(card.drive.frames()) == 1 and not card.modbus.de, "only what was heard goes on"
        assert card.request(READ_DRIVE_TIMEOUT).data == DRIVE_TIMEOUT


# Milliseconds from the fall of DE to the character: within t1.5, between t1.5 and t3.5, within the pause of
# the drive line, and long after it.
AFTER_MS = first([3.0, 0.3, 0.1, 1.2, 1.7, 6, 8, 17])


@pytest.mark.rule("LOOP-1")
@pytest.mark.parametrize("after_ms", AFTER_MS)
@drive_first
def test_a_character_between_the_transfers_stops_the_test(config, name: str, after_ms: float):
    with FastCard(SWITCHES, config=config, wired=1) as card:
        wait_for_end_of_pattern(card, "drive")
        Line(card, name, LINE).send(b"\x55", after_ms * MS)
        assert run_to_verdict(card) == ("red", "red")
        assert not card.modbus.de


@pytest.mark.rule("LOOP-1")
@pytest.mark.parametrize("after_ms", AFTER_MS)
@network_first
def test_a_character_after_both_transfers_is_a_failure(config, name: str, after_ms: float):
    with FastCard(SWITCHES, config=config, wired=1) as card:
        wait_for_end_of_pattern(card, "modbus")
        Line(card, name, LINE).send(b"\x55", after_ms * MS)
        assert run_to_verdict(card) == ("red", "red")


def wait_for_end_of_pattern(card: FastCard, sender: str) -> None:
    """Runs until the sender's DE falls."""
    assert card.run_until(1500 * MS, f"{sender}_de")
    assert getattr(card, sender).driven and card.run_until(1500 * MS, f"{sender}_de")


@pytest.mark.rule("LOOP-1", "SAFE-1")
@drive_first
def test_a_character_after_a_passed_test_makes_it_a_failed_one(config, name: str):
    with FastCard(SWITCHES, config=config, wired=1) as card:
        assert run_to_verdict(card) == ("orange", "orange")
        check_transfers(card)
        Line(card, name, LINE).send(b"\x55")
        card.run(50)
        assert (card.led("modbus"), card.led("drive")) == ("red", "red")
        card.set(wired=0)
        card.run(50)
        assert card.request(READ_DRIVE_TIMEOUT).data == DRIVE_TIMEOUT


@pytest.mark.rule("LOOP-1")
@pytest.mark.parametrize("step", first([3, 1]))
def test_other_switch_settings_do_not_start_the_loopback_test(config, step: int):
    for switch in range(9)[::step]:
        moved = SWITCHES[:switch] + "10"[int(SWITCHES[switch])] + SWITCHES[switch + 1 :]
        with FastCard(moved, config=config, wired=1) as card:
            card.run(LISTEN_MS + TRANSFERS_MS)
            assert not card.modbus.de and not card.drive.de, moved
