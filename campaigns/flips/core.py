# SPDX-License-Identifier: Apache-2.0
"""Flips bits of the core's registers while the firmware turns a write into a telegram.

    python -m campaigns.flips.core [--seed N] [--count FLIPS] [--image FILE]   # make core-flips

The card's image runs on the RV32I machine of the tests. Each flip inverts one bit of x1 to x31 before one
instruction between a candidate and its commit. A run of the card's own image writes
build/fuzz/core-flips.json. Exit 0: no telegram with control word bit 10 = 1 was altered (SAFE-4); 1: at least
one was; 2: an invalid command line.
"""

from __future__ import annotations

import json
import random
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from campaigns.bench import fingerprint
from campaigns.fuzz.run import FOLDER
from rtl.command import Parser, run_main
from tb.agents import rtu
from tb.lib.options import at_least
from tb.model.fake_mailbox import FakeMailbox
from tb.model.fc_telegram import TelegramError
from tb.model.rv32i import Hung, Machine

H = bytes.fromhex
# Coils 1-32, coil 11, coils 1-16, register 40081 by 06 and by 10.
WRITES = (
    H("0F 0000 0020 04 7C04 9919"),
    H("05 000A FF00"),
    H("0F 0000 0010 02 3C04"),
    rtu.write_register(2049, 0x1234),
    rtu.write_registers(2049, [0x1234]),
)
EARLIER = H("0F 0000 0020 04 7D04 1122")
DRIVE_SAYS = H("0F03 2000")
VALID = 0x04  # bit 10, in the control word's upper byte
RESULTS = ("as asked", "altered, bit 10 = 1", "altered, bit 10 = 0", "refused by its BCC", "none")
FILE = FOLDER / "core-flips.json"
KEYS = {"seed", "count", "card", "results"}  # keys of that file


@dataclass(frozen=True)
class Flip:
    at: int  # instructions since the candidate
    register: int
    bit: int


def play(write: bytes, flip: Flip | None = None, image: bytes | None = None) -> tuple[list[bytes], str, int]:
    """Returns the telegrams sent, the end state of the firmware, and the instructions up to the commit."""
    mailbox = FakeMailbox()
    machine = Machine(mailbox.read, mailbox.write, program=image)
    mailbox.candidate(EARLIER)
    for event in (mailbox.commit, mailbox.telegram_ends, lambda: mailbox.drive_data(DRIVE_SAYS), mailbox.bcc):
        machine.poll()
        machine.poll()
        event()
    machine.poll()
    machine.poll()
    before, start = len(mailbox.telegrams), machine.instructions
    mailbox.candidate(write)
    step = machine._step

    def flipping() -> None:
        if flip is not None and machine.instructions == start + flip.at:
            machine.x[flip.register] ^= 1 << flip.bit
        step()

    machine._step = flipping
    how, took = "goes on", 0
    try:
        machine.poll()
        machine.poll()
        took = machine.instructions - start
        mailbox.commit()
        machine.poll()
        machine.poll()
    except TelegramError:
        how = "refused by its BCC"
    except (Hung, AssertionError):
        how = "trap or watchdog"  # error of the machine
    return mailbox.telegrams[before:], how, took


def verdict(sent: list[bytes], how: str, wanted: list[bytes]) -> str:
    """`altered`: any telegram that is different or surplus."""
    beyond = list((Counter(sent) - Counter(wanted)).elements())
    if beyond:
        return f"altered, bit 10 = {int(any(telegram[-4] & VALID for telegram in beyond))}"
    if how == "refused by its BCC":
        return how
    return "as asked" if sent else "none"


def flip_registers(seed: int, count: int, image: bytes | None = None) -> tuple[Counter, list[str]]:
    rng = random.Random(f"core flips {seed}")
    sound = [play(write, image=image) for write in WRITES]
    results, altered = Counter(), []
    for _ in range(count):
        number = rng.randrange(len(WRITES))
        wanted, _, took = sound[number]
        flip = Flip(rng.randrange(took), rng.randrange(1, 32), rng.randrange(32))
        sent, how, _ = play(WRITES[number], flip, image)
        result = verdict(sent, how, wanted)
        results[result] += 1
        if result.startswith("altered"):
            found = " and ".join(telegram.hex(" ") for telegram in sent)
            altered.append(f"{flip}: {found} instead of {wanted[0].hex(' ')}")
    return results, altered


def main() -> int:
    parser = Parser(prog="core-flips", description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=at_least(0), default=random.randrange(1 << 31))
    parser.add_argument("--count", type=at_least(1), default=6000, help="flips (default: %(default)s)")
    parser.add_argument("--image", type=Path, help="another firmware.bin")
    options = parser.parse_args()
    try:
        image = options.image.read_bytes() if options.image else None
    except OSError as error:
        print(f"core_flips: {options.image}: {error.strerror}", file=sys.stderr)
        return 2
    results, altered = flip_registers(options.seed, options.count, image)
    if image is None:
        kept = {"seed": options.seed, "count": options.count, "card": fingerprint.shard(), "results": results}
        FILE.parent.mkdir(parents=True, exist_ok=True)
        FILE.write_text(json.dumps(kept, indent=1) + "\n")
    print(f"seed {options.seed}, {options.count} flips")
    for result in RESULTS:
        print(f"{results[result]:7}  {result}")
    print("\n".join(altered))
    return int(bool(results["altered, bit 10 = 1"]))


if __name__ == "__main__":
    run_main("core-flips", main)
