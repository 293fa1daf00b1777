# SPDX-License-Identifier: Apache-2.0
"""What the image shows is what the drive was told (SAFE-8), in random rounds with each firmware option.

The newest committed request is answered, too, unless a character came after it or its dialect is silent.

`make impatient` asks it at the pins, of the images without options. Here masters give up, the drive misses
telegrams, something jams its line, and the master is lost (SAFE-7); bytes are hex, times in ms.
"""

from __future__ import annotations

import random

import pytest

from regs.dialects import DIALECTS, OPTIONS
from tb.firmware.test_firmware_gateway import Bench, H
from tb.lib.seeds import cases, seeded
from tb.model.fc_telegram import build
from tb.model.firmware import Build
from tb.model.lines import image_of
from tb.model.told import not_told

STATUS = H("0F03 2000")
BUILDS = [*(Build(dialect=name) for name in DIALECTS), *(Build(option=name) for name in OPTIONS)]
REQUESTS = [
    *("0F 0000 0010 02 7C04", "0F 0000 0010 02 3C04", "05 0006 FF00", "05 0006 0000", "0F 0010 0010 02 9919"),
    *("05 0040 FF00", "05 0050 FF00", "06 040F 003C", "10 040F 0002 04 00000007", "10 1413 0001 02 4142"),
    *("03 1413 0002", "03 1413 0003", "03 0001 0001", "06 0002 0003", "06 0002 0028", "01 0020 0020"),
]
READ_IMAGE = H("01 0000 0020")
READ_PARAMETER = H("03 1413 0002")
FAULTS = (0, 5, 130)
STEP_MS = 5
SLACK_MS = 2 * STEP_MS
NEVER = float("inf")
LOSS_MS = 700  # longer than 40002 below, and than an exchange with its repeat


def fitting(telegram: bytes, fault: int | None) -> bytes:
    """A drive's reply to a telegram, without STX, LGE, ADR and BCC."""
    if len(telegram) == 5:
        return STATUS
    kind, low = telegram[1] >> 4, telegram[1] & 0xF
    if fault is not None:
        return bytes([0x70 | low, telegram[2], 0, 0, 0, 0, 0, fault]) + STATUS
    if kind == 15:
        return bytes([0xF0 | low, telegram[2], telegram[3], 0]) + b"ABCD" + STATUS
    return bytes([0x10 | low, telegram[2], 0, 0, 0, 0, 0, 7]) + STATUS


class Rounds:
    """A card, what happened to it, and its telegrams, each with whether it had a good reply."""

    def __init__(self, made: Build, rng: random.Random) -> None:
        self.bench, self.rng = Bench(made), rng
        self.told: list[list] = []
        self.seen = 0
        self.log: list[str] = []
        self.timeout = NEVER  # register 40002
        self.heard = 0  # when the last good frame came
        self.late = ""  # a start that left after the master was lost
        self.replies_before: int | None = None  # the newest request, if it must be answered

    def count(self) -> None:
        new, self.seen = self.bench.telegrams[self.seen :], len(self.bench.telegrams)
        self.told += [[telegram, False] for telegram in new]
        silent = self.bench.mailbox.time - self.heard
        starts = [telegram.hex(" ") for telegram in new if len(telegram) == 5 and telegram[2] & 0x40]
        if starts and silent > self.timeout + SLACK_MS and not self.late:
            self.late = f"{starts[0]} after {silent} ms without a good frame (SAFE-7)"

    def set_timeout(self, tens: int) -> None:
        self.bench.local(H("06 0001") + bytes([0, tens]))
        self.timeout, self.heard = 10 * tens, self.bench.mailbox.time

    def wait(self, ms: int) -> None:
        for _ in range(0, ms, STEP_MS):
            self.bench.wait(min(ms, STEP_MS))
            self.count()

    def drive(self, good: bool, fault: int | None = None) -> None:
        self.count()
        if self.bench.mailbox.listening and self.told:
            self.told[-1][1] |= good
            self.bench.drive(fitting(self.told[-1][0], fault), good)

    def step(self) -> None:
        bench, rng = self.bench, self.rng
        what = rng.choices(
            ("ask", "character", "ends", "drive", "busy", "free", "wait", "restart"),
            (30, 4, 16, 16, 7, 6, 14, 1),
        )[0]
        self.log.append(what)
        if what in ("ask", "character", "restart"):
            self.replies_before = None
        if what == "ask":
            before = len(bench.replies)
            request, broadcast = rng.choice(REQUESTS), rng.random() < 0.25
            self.log.append(f"{request}{' to all' * broadcast}")
            bench.offer(H(request), broadcast)
            bench.wait(rng.choice((0, 0, 0, 1, 4)))
            if rng.random() < 0.85:
                bench.commit()
                self.heard = bench.mailbox.time
                self.replies_before = None if broadcast else before
            else:
                bench.character()
        elif what == "character":
            bench.character()
        elif what == "ends":
            bench.telegram_ends()
        elif what == "drive":
            self.drive(rng.random() < 0.8, rng.choice(FAULTS) if rng.random() < 0.15 else None)
        elif what == "busy":
            bench.mailbox.quiet = False
        elif what == "free":
            bench.mailbox.pause_over()
            bench.poll()
        elif what == "wait":
            self.wait(rng.choice((1, 5, 20, 160, 160, 400)))
        else:
            bench.restart()
            self.told.clear()
            self.timeout = NEVER
        self.count()

    def rest(self) -> None:
        """The line is free, and the drive answers all that comes."""
        self.bench.mailbox.pause_over()
        for _ in range(60):
            self.bench.wait(3)
            self.bench.telegram_ends()
            self.drive(good=True)

    def answers_a_reading(self) -> bool:
        before = len(self.bench.replies)
        self.bench.request(READ_PARAMETER)
        self.rest()
        return [reply[1:3] for reply in self.bench.replies[before:]] == [H("03 04")]

    def image(self) -> bytes:
        self.bench.request(READ_IMAGE)
        self.bench.wait(40)  # longer than REPLY_DELAY
        return image_of(self.bench.replies[-1])


@pytest.mark.rule("SAFE-7", "SAFE-8")
@pytest.mark.parametrize("made", BUILDS, ids=lambda made: made.option or made.dialect)
def test_at_rest_the_drive_was_told_what_the_image_shows(made: Build):
    rng = seeded(f"rounds {made}")
    for _ in range(cases(100, 400)):
        rounds = Rounds(made, random.Random(seed := rng.random()))
        if made.option == "MASTER_LOSS_STOP":
            rounds.set_timeout(rounds.rng.choice((3, 8, 20, 60)))
        for _ in range(rounds.rng.randint(8, 40)):
            rounds.step()
        rounds.rest()
        if made.option == "MASTER_LOSS_STOP":
            rounds.wait(LOSS_MS)
            rounds.rest()
        if DIALECTS[made.dialect].traits["drive_silent"] and rounds.replies_before is not None:
            more = len(rounds.bench.replies) - rounds.replies_before
            assert more == 1, f"{more} replies; seed {seed}: {'; '.join(rounds.log)}"
        assert not rounds.late, f"{rounds.late}; seed {seed}: {'; '.join(rounds.log)}"
        image = rounds.image()
        sent = [(build(telegram[1:], adr=telegram[0]), good) for telegram, good in rounds.told]
        what = f"seed {seed}: {'; '.join(rounds.log)}"
        assert not (wrong := not_told(sent, image)), f"{wrong}; {what}"
        if made.option == "MASTER_LOSS_STOP" and sent and "restart" not in rounds.log:  # that restores 40002
            assert not image[1] & 0x40, f"the lost master's start stays; {what}"
        assert rounds.answers_a_reading(), f"no answer from a drive that answers; {what}"
