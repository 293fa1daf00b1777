# SPDX-License-Identifier: Apache-2.0
"""What the firmware does besides serving requests: image check, watchdog, loop-back test."""

from __future__ import annotations

import ctypes
import functools
import re
import struct
import subprocess

import pytest

from rtl.sources import ROOT
from sw.tools.seal import SUMS, seal
from tb.lib.seeds import seeded
from tb.model.fake_mailbox import BY_OFFSET, FakeMailbox
from tb.model.firmware import Gateway, library
from tb.model.rv32i import Hung, Machine, image

ORANGE, RED = 0xF, 0b0101
SHOW_MS, VERDICT_MS = 2000, 12000
# What the other port hears of each test frame.
TELEGRAM = bytes.fromhex("81 0000 0000 55AA FF01 0000 0000")
HEARD_BY_NETWORK = bytes.fromhex("02 0E") + TELEGRAM + bytes.fromhex("8C")
FRAME = bytes.fromhex("02 0E 81 55 AA 00 FF 01 80 7F FE 33 00 38")
HEARD_BY_DRIVE = FRAME[3:] + bytes.fromhex("E2")


class Card:
    """The card's image on a machine, behind a mailbox with or without the switches of the loop-back test."""

    firmware: type = Machine

    def __init__(self, loopback: bool = False) -> None:
        self.mailbox = FakeMailbox()
        self.mailbox.loopback = loopback
        self.machine = self.firmware(self.mailbox.read, self.mailbox.write)

    def wait(self, ms: int) -> None:
        for _ in range(ms):
            self.mailbox.time += 1
            self.machine.poll()


@pytest.fixture(params=[Gateway, Machine], ids=["host", "card"])
def both(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same sources twice: compiled for the host, and the card's own image on an RV32I machine."""
    monkeypatch.setattr(Card, "firmware", request.param)


def checked_bits() -> int:
    return 8 * (len(image()) - SUMS.size)


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


class Check:
    """The check compiled for the host, over words of the test."""

    def __init__(self, words: list[int]) -> None:
        self.words = (ctypes.c_uint32 * len(words))(*words)
        self.state = ctypes.create_string_buffer(64)
        self.step = functools.partial(library().image_step, self.state)
        end = ctypes.addressof(self.words) + SUMMED_BYTES
        library().image_step.restype = ctypes.c_bool
        library().image_init(self.state, self.words, ctypes.c_void_p(end))


SUMMED = [0x00000013, 0xDEADBEEF, 0xFFFFFFFF, 0, 0x80000000, 1, 2]
SUMMED_BYTES = 4 * len(SUMMED)
SEALED = struct.unpack("<9I", seal(struct.pack("<9I", *SUMMED, 0, 0)))


@pytest.mark.rule("LED-5")
@pytest.mark.parametrize("words", [1, 2, 3, 4, 7, 8, 0xFFFFFFFF])
def test_a_whole_image_adds_up_in_every_round_and_step(words: int):
    check = Check(SEALED)
    assert all(check.step(words) for _ in range(50))


@pytest.mark.rule("LED-5", "SAFE-4")
@pytest.mark.parametrize("words", [1, 4, 0xFFFFFFFF])
def test_every_single_bit_and_every_swap_of_words_is_found_at_the_end_of_the_round(words: int):
    steps = -(-len(SUMMED) // min(words, len(SUMMED)))
    damaged = [
        [w ^ (1 << bit) * (i == at) for i, w in enumerate(SEALED)] for at in range(9) for bit in range(32)
    ]
    for at in range(6):
        swapped = list(SEALED)
        swapped[at], swapped[at + 1] = SEALED[at + 1], SEALED[at]
        damaged.append(swapped)
    for image_words in damaged:
        check = Check(image_words)
        for _ in range(2):
            assert [check.step(words) for _ in range(steps)] == [True] * (steps - 1) + [False]


class Halted(Exception):
    """The supervisor stops the soft core."""


class HaltingMailbox(FakeMailbox):
    """For damaged code: as on the card, nothing is read or written where there is no register."""

    def read(self, offset: int) -> int:
        return super().read(offset) if offset in BY_OFFSET else 0

    def write(self, offset: int, value: int) -> None:
        if offset in BY_OFFSET:
            super().write(offset, value)

    def _write_supervisor(self, halt: int, loopback: int, **_: int) -> None:
        if halt:
            raise Halted


@pytest.mark.rule("LED-5", "SAFE-4")
def test_an_image_damaged_before_the_start_ends_before_anything_is_served():
    """Halted by itself, or trapped or hung, which the watchdog turns into the same (WDG-1, LED-5).

    A few bits are those of the halt itself: with one of them wrong the card must serve as if nothing was.
    """
    rng = seeded("damaged bits")
    ends = {"halted": 0, "stopped": 0, "serves": 0}
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
            assert not mailbox.telegrams and not mailbox.replies
            mailbox.candidate(bytes.fromhex("03 0000 0003"))
            mailbox.commit()
            machine.poll()
            machine.poll()
            assert mailbox.replies == [bytes.fromhex("01 03 06 0000 03E8 000F")], f"bit {bit} of the image"
            ends["serves"] += 1
        assert not mailbox.telegrams
    print(ends)
    assert ends["serves"] <= 3
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
    to_network: bytes = HEARD_BY_NETWORK,
    to_drive: bytes = HEARD_BY_DRIVE,
    good: bool = True,
    lge: int | None = None,
    bank: int = 0,
) -> Card:
    """A card after both transfers, which arrived as said."""
    card = Card(loopback=True)
    card.mailbox.bank = bank
    card.wait(12)
    assert card.mailbox.telegrams == [TELEGRAM]
    card.mailbox.telegram_ends()
    card.mailbox._store(f"REQUEST_FRAME_{1 - card.mailbox.bank}", to_network)
    card.wait(45)
    assert card.mailbox.replies == [FRAME]
    card.mailbox.drive_data(to_drive, lge)
    card.mailbox.bcc(good)
    card.wait(45)
    return card


def shown(card: Card) -> int:
    """The LEDs in the middle of the verdict."""
    card.wait(SHOW_MS + 1000 - card.mailbox.time)
    assert card.mailbox.loopback
    return card.mailbox.led


@pytest.mark.rule("LOOP-1")
@pytest.mark.usefixtures("both")
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
@pytest.mark.usefixtures("both")
@pytest.mark.parametrize("place", range(len(HEARD_BY_NETWORK)))
def test_a_byte_wrong_on_the_way_to_the_network_port_is_red(place: int):
    wrong = bytearray(HEARD_BY_NETWORK)
    wrong[place] ^= 0x10
    assert shown(card_with(to_network=bytes(wrong))) == RED


@pytest.mark.rule("LOOP-1")
@pytest.mark.usefixtures("both")
@pytest.mark.parametrize("place", range(len(HEARD_BY_DRIVE)))
def test_a_byte_wrong_on_the_way_to_the_drive_port_is_red(place: int):
    wrong = bytearray(HEARD_BY_DRIVE)
    wrong[place] ^= 0x01
    assert shown(card_with(to_drive=bytes(wrong))) == RED


@pytest.mark.rule("LOOP-1")
@pytest.mark.usefixtures("both")
@pytest.mark.parametrize("bank", [0, 1])
def test_the_frame_may_come_into_either_bank(bank: int):
    assert shown(card_with(bank=bank)) == ORANGE


@pytest.mark.rule("LOOP-1")
@pytest.mark.usefixtures("both")
@pytest.mark.parametrize("lge", [0x0D, 0x0F, 0x06])
def test_a_wrong_length_on_the_way_to_the_drive_port_is_red(lge: int):
    assert shown(card_with(lge=lge)) == RED


@pytest.mark.rule("LOOP-1")
@pytest.mark.usefixtures("both")
def test_a_dead_wire_in_either_direction_is_red():
    assert shown(card_with(to_network=b"")) == RED
    assert shown(card_with(good=False)) == RED


@pytest.mark.rule("LOOP-1")
@pytest.mark.usefixtures("both")
def test_no_request_is_served_during_the_test_nor_after_it_if_it_came_before():
    card = card_with()
    card.mailbox.candidate(bytes.fromhex("03 0000 0001"))
    card.mailbox.commit()
    replies = len(card.mailbox.replies)
    card.wait(SHOW_MS + VERDICT_MS + 200 - card.mailbox.time)
    assert not card.mailbox.loopback and len(card.mailbox.replies) == replies
