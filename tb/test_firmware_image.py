# SPDX-License-Identifier: Apache-2.0
"""What the firmware does besides serving requests: image check, watchdog, loop-back test."""

from __future__ import annotations

import re
import struct
import subprocess

import pytest

from tb.lib.seeds import seeded
from tb.model.fake_mailbox import FakeMailbox
from tb.model.rv32i import Hung, Machine, image
from tools.seal import SUMS, seal
from tools.sources import ROOT

ORANGE, RED = 0xF, 0b0101
SHOW_MS, VERDICT_MS = 2000, 12000
# What the other port hears of each test frame.
TELEGRAM = bytes.fromhex("81 0000 0000 55AA FF01 0000 0000")
HEARD_BY_NETWORK = bytes.fromhex("02 0E") + TELEGRAM + bytes.fromhex("8C")
FRAME = bytes.fromhex("02 0E 81 55 AA 00 FF 01 80 7F FE 33 00 38")
HEARD_BY_DRIVE = FRAME[3:] + bytes.fromhex("E2")


class Card:
    """The card's image on a machine, behind a mailbox with or without the switches of the loop-back test."""

    def __init__(self, loopback: bool = False) -> None:
        self.mailbox = FakeMailbox()
        self.mailbox.loopback = loopback
        self.machine = Machine(self.mailbox.read, self.mailbox.write)

    def wait(self, ms: int) -> None:
        for _ in range(ms):
            self.mailbox.time += 1
            self.machine.poll()


def checked_bits() -> int:
    return 8 * (len(image()) - SUMS.size)


def the_check_itself() -> range:
    """Bytes of the image that are its check, and what halts the card."""
    command = ["riscv64-unknown-elf-nm", "-S", ROOT / "build/firmware.elf"]
    symbols = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    start, size = re.search(r"^(\w+) (\w+) t check\b", symbols, re.MULTILINE).groups()
    return range(int(start, 16), int(start, 16) + int(size, 16))


# ---------------------------------------------------------------- the image


def test_the_sums_are_of_the_words_and_of_their_running_sums():
    words = [1, 2, 0xFFFFFFFF]
    sealed = seal(struct.pack("<5I", *words, 0, 0))
    assert struct.unpack("<5I", sealed)[3:] == (2, 1 + 3 + 2)


@pytest.mark.rule("LED-5")
def test_a_whole_image_never_halts():
    card = Card()
    card.wait(1000)
    assert not card.mailbox.halted


@pytest.mark.rule("LED-5", "SAFE-4")
@pytest.mark.parametrize("fate", ["revoked", "committed"])
def test_the_image_is_checked_on_after_a_request_of_any_fate(fate: str):
    card = Card()
    card.mailbox.candidate(bytes.fromhex("03 0000 0001"))
    card.wait(2)
    card.mailbox.character() if fate == "revoked" else card.mailbox.commit()
    card.wait(2)
    card.machine.memory[checked_bits() // 8 - 1] ^= 1
    card.wait(1000)
    assert card.mailbox.halted


@pytest.mark.rule("LED-5", "SAFE-4")
def test_an_image_damaged_while_idle_halts_within_a_second():
    rng = seeded("damaged bits")
    for _ in range(8):
        card = Card()
        card.wait(3)
        # Constants, not code: what the damage does to the running loop is not the question here.
        card.machine.memory[checked_bits() // 8 - 1 - rng.randrange(8)] ^= 1 << rng.randrange(8)
        card.wait(1000)
        assert card.mailbox.halted


class Halted(Exception):
    """The supervisor stops the soft core."""


class HaltingMailbox(FakeMailbox):
    def _write_supervisor(self, halt: int, loopback: int, **_: int) -> None:
        if halt:
            raise Halted


@pytest.mark.rule("LED-5", "SAFE-4")
def test_an_image_damaged_before_the_start_ends_before_anything_is_served():
    """Halted by itself, or trapped or hung, which the watchdog turns into the same (WDG-1, LED-5)."""
    rng = seeded("damaged bits")
    ends = {"halted": 0, "stopped": 0, "blind": 0}
    for _ in range(60):
        mailbox = HaltingMailbox()
        bit = rng.randrange(checked_bits())
        try:
            machine = Machine(mailbox.read, mailbox.write, damaged_bit=bit)
            for mailbox.time in range(1, 4):
                machine.poll()
        except Halted:
            ends["halted"] += 1
        except (AssertionError, Hung):
            ends["stopped"] += 1
        else:
            # A bit of the check can keep it from finding that very bit; it can do no more.
            ends["blind"] += 1
            assert bit // 8 in the_check_itself(), f"bit {bit} of the image is wrong and the firmware runs on"
        assert not mailbox.telegrams and not mailbox.replies
    print(ends)
    assert ends["halted"] > 40


# ---------------------------------------------------------------- the watchdog


@pytest.mark.rule("WDG-1", "SAFE-4")
def test_a_flipped_bit_of_what_was_written_leaves_the_firmware_to_the_watchdog():
    command = ["riscv64-unknown-elf-nm", ROOT / "build/firmware.elf"]
    symbols = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    settings = int(re.search(r"^(\w+) b gateway\.", symbols, re.MULTILINE).group(1), 16)
    for at in range(24):
        card = Card()
        card.wait(3)
        card.machine.memory[settings + at] ^= 0x10
        with pytest.raises(Hung):
            card.wait(3)
        assert not card.mailbox.halted


@pytest.mark.rule("WDG-1")
def test_every_round_kicks_the_watchdog():
    card = Card()
    before = card.mailbox.kicks
    card.wait(100)
    assert card.mailbox.kicks == before + 100


# ---------------------------------------------------------------- the loop-back test


def card_with(
    to_network: bytes = HEARD_BY_NETWORK, to_drive: bytes = HEARD_BY_DRIVE, good: bool = True
) -> Card:
    """A card after both transfers, which arrived as said."""
    card = Card(loopback=True)
    card.wait(12)
    assert card.mailbox.telegrams == [TELEGRAM]
    card.mailbox.telegram_ends()
    card.mailbox._store(f"REQUEST_FRAME_{1 - card.mailbox.bank}", to_network)
    card.wait(45)
    assert card.mailbox.replies == [FRAME]
    card.mailbox.drive_data(to_drive)
    card.mailbox.bcc(good)
    card.wait(45)
    return card


def shown(card: Card) -> int:
    """The LEDs in the middle of the verdict."""
    card.wait(SHOW_MS + 1000 - card.mailbox.time)
    assert card.mailbox.loopback
    return card.mailbox.led


@pytest.mark.rule("LOOP-1")
def test_both_ways_intact_is_orange_for_12_seconds_then_normal():
    card = card_with()
    assert shown(card) == ORANGE
    card.wait(SHOW_MS + VERDICT_MS - 10 - card.mailbox.time)
    assert card.mailbox.led == ORANGE and card.mailbox.loopback
    card.wait(40)
    assert not card.mailbox.loopback
    card.mailbox.candidate(bytes.fromhex("03 0000 0001"))
    card.wait(2)
    card.mailbox.commit()
    assert card.mailbox.replies[-1] == bytes.fromhex("01 03 02 0000")


@pytest.mark.rule("LOOP-1")
@pytest.mark.parametrize("place", range(len(HEARD_BY_NETWORK)))
def test_a_byte_wrong_on_the_way_to_the_network_port_is_red(place: int):
    wrong = bytearray(HEARD_BY_NETWORK)
    wrong[place] ^= 0x10
    assert shown(card_with(to_network=bytes(wrong))) == RED


@pytest.mark.rule("LOOP-1")
@pytest.mark.parametrize("place", range(len(HEARD_BY_DRIVE)))
def test_a_byte_wrong_on_the_way_to_the_drive_port_is_red(place: int):
    wrong = bytearray(HEARD_BY_DRIVE)
    wrong[place] ^= 0x01
    assert shown(card_with(to_drive=bytes(wrong))) == RED


@pytest.mark.rule("LOOP-1")
def test_a_dead_wire_in_either_direction_is_red():
    assert shown(card_with(to_network=b"")) == RED
    assert shown(card_with(good=False)) == RED


@pytest.mark.rule("LOOP-1")
def test_no_request_is_served_during_the_test_nor_after_it_if_it_came_before():
    card = card_with()
    card.mailbox.candidate(bytes.fromhex("03 0000 0001"))
    card.mailbox.commit()
    replies = len(card.mailbox.replies)
    card.wait(SHOW_MS + VERDICT_MS + 200 - card.mailbox.time)
    assert not card.mailbox.loopback and len(card.mailbox.replies) == replies
