# SPDX-License-Identifier: Apache-2.0
"""Starts of a whole card: from random register contents, and by a reset at any clock of its life (SAFE-5).

A start fails unless the card answers a request that ends with BOOT-1's time. A power-up also fails unless the
memory below the frame memory is the firmware image when the reset ends.
"""

from __future__ import annotations

import functools
import random

from regs.generated.mailbox import FRAMES_BYTES
from sw.tools.bin2hex import without_parity
from tb.agents import rtu
from tb.lib.card import MS
from tb.lib.fast_card import RESET_CLOCKS, FastCard
from tb.lib.runner import firmware
from tb.lib.supervision import control_pdu, process

READ = rtu.build(1, rtu.read_registers(2, 1))
ANSWER = rtu.build(1, bytes.fromhex("03 02 00 0F"))
START, START_REPLY = process(0x047C, 0x1999)
COMMAND = rtu.build(1, control_pdu(0x047C, 0x1999))
LONGEST_RESET = 5000  # clocks
LIFE_MS = 60  # after the release, in which the reset comes
KINDS = ("power-up", "reset")


class StartError(Exception):
    """The start failed; one line that says how."""


@functools.cache
def image(config: str) -> tuple[int, ...]:
    """The words of the firmware image below the frame memory, without parity."""
    words = [without_parity(int(line, 16)) for line in firmware(config).read_text().split()]
    return tuple(words[: len(words) - FRAMES_BYTES // 4])


def check_memory(card: FastCard) -> None:
    for number, word in enumerate(image(card.config)):
        if (found := card.memory_word(number)) != word:
            raise StartError(f"address {4 * number:04X}h holds {found:08X}h instead of {word:08X}h")


def check_start(card: FastCard, released_ps: float) -> None:
    """The first request ends with the boot time and is answered; nothing is sent unasked."""
    bit = card.modbus.fmt.bit_ps
    earlier = {line.name: len(line.de) for line in (card.modbus, card.drive)}
    card.run_until(released_ps + card.boot_ms * MS - len(READ) * card.modbus.fmt.character_ps)
    for line in (card.modbus, card.drive):
        if len(line.de) > earlier[line.name]:
            raise StartError(f"sends on the {line.name} line before any request")
    reply = card.request(READ, 200 * bit / MS)
    if reply is None or reply.data != ANSWER:
        raise StartError(f"does not answer; the LEDs show {card.led('modbus')}, {card.led('drive')}")


def power_up(config: str, seed: int) -> None:
    """Random contents, and a reset of 10 clocks or released late."""
    rng = random.Random(f"power-up {seed}")
    clocks = rng.choice((RESET_CLOCKS, rng.randint(RESET_CLOCKS, LONGEST_RESET)))
    with FastCard(config=config, seed=rng.randrange(1, 1 << 31), reset_clocks=clocks) as card:
        card.run_until(clocks * card.period_ps)
        check_memory(card)
        check_start(card, card.now_ps)


def reset(config: str, seed: int) -> None:
    """A reset at a random clock: while the card starts, idles, decodes, sends or waits for the drive."""
    rng = random.Random(f"reset {seed}")
    answers = rng.choice((START_REPLY, None))
    with FastCard(config=config, seed=rng.randrange(1, 1 << 31), drive=lambda telegram: answers) as card:
        booted = card.boot_ms * MS
        at = rng.choice((rng.uniform(0, booted), booted + rng.uniform(0, LIFE_MS * MS)))
        requests = rng.choice(((), (READ,) * 4, (COMMAND,) * 2))
        due = booted
        for adu in requests:
            card.run_until(min(at, due))
            if card.now_ps < at:
                due = card.modbus.send(adu) + rng.uniform(5, 25) * MS
        card.run_until(at)
        check_start(card, card.reset())


def start(kind: str, config: str, seed: int) -> str:
    """One start; empty if it is alive, else how it failed."""
    try:
        {"power-up": power_up, "reset": reset}[kind](config, seed)
    except StartError as error:
        return str(error)
    return ""
