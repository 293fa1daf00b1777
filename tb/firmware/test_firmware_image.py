# SPDX-License-Identifier: Apache-2.0
"""The firmware's other tasks: image check, watchdog, loop-back test."""

from __future__ import annotations

import ctypes
import functools
import shutil
import struct
import subprocess
import time
from pathlib import Path

import pytest

from rtl.sources import ROOT
from sw.tools.seal import SUMS, seal
from tb.lib.rows import each_row
from tb.model.firmware import Build, image, library

ORANGE, RED = 0xF, 0b0101
SHOW_MS, VERDICT_MS = 2000, 12000
LISTEN_MS = 1000
# Milliseconds for the whole image: more than twice its words, because every second tick checks a word.
ONE_CHECK = 4096
# The loop-back test's patterns, and their bytes as the other port receives them.
TELEGRAM = bytes.fromhex("81 0000 0000 55AA FF01 0000 0000")
WRONG_BCC = bytes.fromhex("73")
HEARD_BY_NETWORK = bytes.fromhex("02 0E") + TELEGRAM + WRONG_BCC
FRAME = bytes.fromhex("02 1E") + TELEGRAM + WRONG_BCC
HEARD_BY_DRIVE = FRAME[3:] + bytes.fromhex("27 B7")  # and a wrong CRC
LGE = FRAME[1]


class BootedFirmware:
    """The firmware with a mailbox, with or without the switch setting of the loop-back test."""

    build = Build(on_card=True)

    def __init__(self, loopback: bool = False) -> None:
        self.mailbox = self.build.mailbox()
        self.mailbox.loopback = loopback
        self.machine = self.build.start(self.mailbox)

    def wait(self, ms: int) -> None:
        """Two rounds a millisecond: the round of the tick, and one that has time for other work."""
        self.machine.run(ms, rounds=2)


@pytest.fixture(params=[Build(), Build(on_card=True)], ids=["host", "card"])
def both(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same sources twice: compiled for the host, and as the card's image on an RV32I machine."""
    monkeypatch.setattr(BootedFirmware, "build", request.param)


# ---------------------------------------------------------------- the image


def test_checksums_cover_the_words_and_their_running_sums():
    words = [1, 2, 0xFFFFFFFF]
    sealed = seal(struct.pack("<5I", *words, 0, 0))
    assert struct.unpack("<5I", sealed)[3:] == (2, 1 + 3 + 2)


@pytest.mark.rule("LED-5", "SAFE-4")
@pytest.mark.parametrize("fate", ["revoked", "committed"])
def test_the_image_check_continues_after_a_revoked_or_committed_request(fate: str):
    card = BootedFirmware()
    card.mailbox.candidate(bytes.fromhex("03 0000 0001"))
    card.wait(2)
    card.mailbox.character() if fate == "revoked" else card.mailbox.commit()
    card.wait(2)
    card.machine.memory[len(image()) - SUMS.size - 1] ^= 1
    card.wait(ONE_CHECK)
    assert card.mailbox.halted


class Check:
    """The image check compiled for the host, on words of the test."""

    def __init__(self, words: list[int]) -> None:
        self.words = (ctypes.c_uint32 * len(words))(*words)
        self.state = ctypes.create_string_buffer(64)
        end = ctypes.c_void_p(ctypes.addressof(self.words) + SUMMED_BYTES)
        self.step = functools.partial(library().image_step, self.state, self.words, end)
        library().image_step.restype = ctypes.c_bool
        library().image_begin(self.state, self.words)


SUMMED = [0x00000013, 0xDEADBEEF, 0xFFFFFFFF, 0, 0x80000000, 1, 2]
SUMMED_BYTES = 4 * len(SUMMED)
SEALED = struct.unpack("<9I", seal(struct.pack("<9I", *SUMMED, 0, 0)))


@pytest.mark.rule("LED-5")
@each_row("words", [1, 2, 3, 4, 7, 8, 0xFFFFFFFF])
def test_an_intact_image_passes_every_round_at_every_step_size(words: int):
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


# ---------------------------------------------------------------- the loop-back test


def hear_at_drive(card: BootedFirmware, data: bytes, lge: int = LGE) -> None:
    """What the receiver stores of a telegram that never ends."""
    card.mailbox.store("DRIVE_LGE", bytes([lge]))
    card.mailbox.store("DRIVE_FRAME", data)


def card_with(
    to_network: bytes = HEARD_BY_NETWORK,
    to_drive: bytes = HEARD_BY_DRIVE,
    lge: int = LGE,
    bank: int = 0,
) -> BootedFirmware:
    """A card after both transfers, with the given bytes received."""
    card = BootedFirmware(loopback=True)
    card.mailbox.bank = bank
    card.wait(LISTEN_MS - 2)
    assert card.mailbox.telegrams == [], "a second of listening comes first"
    card.wait(5)
    assert card.mailbox.telegrams == [TELEGRAM + WRONG_BCC]
    card.wait(20)
    card.mailbox.telegram_ends()
    card.mailbox.store(f"REQUEST_FRAME_{1 - card.mailbox.bank}", to_network)
    card.wait(25)
    if card.mailbox.replies:
        assert card.mailbox.replies == [FRAME]
        hear_at_drive(card, to_drive, lge)
    card.wait(45)
    return card


def shown(card: BootedFirmware) -> int:
    """The LEDs in the middle of the verdict."""
    card.wait(SHOW_MS + 1000 - card.mailbox.time)
    assert card.mailbox.loopback == (card.mailbox.led == ORANGE), "after a failure the card works at once"
    return card.mailbox.led


@pytest.mark.rule("LOOP-1")
@pytest.mark.usefixtures("both")
def test_two_intact_transfers_are_orange_for_12_seconds_then_the_card_serves():
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
@each_row("bank", [0, 1])
def test_the_frame_may_arrive_in_either_bank(bank: int):
    assert shown(card_with(bank=bank)) == ORANGE


def with_wrong_bytes(heard: bytes) -> list[bytes]:
    """Each byte wrong, none at all, and one more."""
    return [heard[:n] + bytes([heard[n] ^ 0x11]) + heard[n + 1 :] for n in range(len(heard))] + [
        b"",
        heard + b"\x55",
    ]


FAULTS = [
    *({"to_network": heard} for heard in with_wrong_bytes(HEARD_BY_NETWORK)),
    *({"to_drive": heard} for heard in with_wrong_bytes(HEARD_BY_DRIVE)),
    *({"lge": lge} for lge in (0x0D, 0x0F, 0x06)),
]


@pytest.mark.rule("LOOP-1")
@pytest.mark.usefixtures("both")
@each_row("fault", FAULTS)
def test_a_wrong_transfer_is_red_and_ends_the_test(fault: dict):
    card = card_with(**fault)
    assert bool(card.mailbox.replies) == ("to_network" not in fault), "nothing more is sent"
    assert shown(card) == RED


def served(card: BootedFirmware) -> bool:
    replies = len(card.mailbox.replies)
    card.mailbox.candidate(bytes.fromhex("03 0000 0001"))
    card.wait(2)
    card.mailbox.commit()
    card.wait(2)
    return card.mailbox.replies[replies:] == [bytes.fromhex("01 03 02 0000")]


MOMENTS_MS = [500, LISTEN_MS + 35, 32, LISTEN_MS - 2, LISTEN_MS + 75, 1500, 9000]


@pytest.mark.rule("LOOP-1")
@pytest.mark.usefixtures("both")
@each_row("at_ms", MOMENTS_MS)
def test_a_character_of_somebody_else_ends_the_test_at_any_time(at_ms: int):
    card = BootedFirmware(loopback=True)
    card.mailbox.bank = 1
    for _ in range(at_ms):
        card.wait(1)
        if card.mailbox.sending and card.mailbox.time > LISTEN_MS + 22:
            card.mailbox.telegram_ends()
            card.mailbox.store("REQUEST_FRAME_0", HEARD_BY_NETWORK)
        if card.mailbox.replies and card.mailbox.listening:
            hear_at_drive(card, HEARD_BY_DRIVE)
            card.mailbox.listening = False
    assert card.mailbox.loopback
    sent = len(card.mailbox.telegrams), len(card.mailbox.replies)
    card.mailbox.heard = 1
    card.wait(2)
    assert not card.mailbox.loopback and served(card)
    sent = sent[0], sent[1] + 1
    card.wait(max(SHOW_MS, card.mailbox.time) + 100 - card.mailbox.time)
    assert card.mailbox.led == RED
    card.wait(VERDICT_MS - 300)
    assert card.mailbox.led == RED
    card.wait(ONE_CHECK)
    assert card.mailbox.led != RED
    assert (len(card.mailbox.telegrams), len(card.mailbox.replies)) == sent and served(card)


def test_an_image_is_built_again_for_other_options(tmp_path: Path):
    """FIRMWARE_DEFINES counts like a source: other options make the image anew, and so does their end."""
    for folder in ("sw", "regs"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "configs.toml", tmp_path)
    compiler = tmp_path / "fake-gcc"
    compiler.write_text('#!/bin/sh\necho "$@" >build/firmware.elf\n')
    compiler.chmod(0o755)

    def built(*defines: str) -> str:
        make = [
            "make",
            "-s",
            "-f",
            "sw/firmware.mk",
            f"FIRMWARE_CROSS={tmp_path}/fake-",
            "build/firmware.elf",
        ]
        time.sleep(0.05)  # the times of files count in ticks, and this compiler takes less than one
        subprocess.run([*make, *defines], cwd=tmp_path, check=True)
        return (tmp_path / "build/firmware.elf").read_text()

    plain = built()
    assert built("FIRMWARE_DEFINES=-DADR_SHORT=1") != plain
    assert built() == plain


@pytest.mark.rule("LINE-9")
def test_a_delay_is_never_shorter_than_asked(tmp_path):
    """REPLY_DELAY in ms becomes ticks of 1/1200 s, whole ones."""
    source, program = tmp_path / "ticks.c", tmp_path / "ticks"
    source.write_text(
        '#include <stdio.h>\n#include "ticks.h"\n'
        'int main(void) { for (int ms = 0; ms <= 250; ms++) printf("%d\\n", TICKS(ms)); return 0; }\n'
    )
    subprocess.run(["cc", "-I", ROOT / "sw/include", source, "-o", program], check=True)
    ticks = subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()
    assert all(0 <= 5 * int(found) - 6 * ms < 5 for ms, found in enumerate(ticks))
