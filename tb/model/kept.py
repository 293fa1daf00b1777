# SPDX-License-Identifier: Apache-2.0
"""No committed write is lost, and writes leave in their order (FRAME-7), judged from the two lines alone.

A committed write of coils 1-32 waits for one process telegram of the image, and that leaves before anything
else. A committed write of a parameter waits for its own telegram. Only a newer one of its kind (for this
card, for all) takes its place. Each has to be on the drive line as soon as that is free. Where the firmware
may or may not have seen a commit yet, either outcome is right. Unit of time: clocks.
"""

from __future__ import annotations

from collections.abc import Sequence

from tb.model.fc_telegram import ADR, ADR_BROADCAST, build, is_broadcast
from tb.model.lines import DEFAULT_WAIT, LATE_MS, NEVER, NOTHING, Commit, Said, words_of
from tb.model.wire import PAUSE_BITS, LineFormat


class Lost(Exception):
    """A write was lost, or left out of its order."""


class Order:
    """The writes that wait, followed through all commits and telegrams in order of time."""

    def __init__(
        self,
        busy: Sequence[tuple[float, float]],
        deciding: Sequence[tuple[float, float]],
        line: LineFormat,
        budget: float,
    ) -> None:
        self.busy, self.deciding, self.budget, self.ms = busy, deciding, budget, line.clk_hz / 1000
        self.pause = (PAUSE_BITS + 1.5) * line.bit
        self.waiting: list[Commit] = []
        self.asked: list[Commit] = []
        self.last: Said | None = None
        self.image_lo = -NEVER  # the newest write that the last telegram stands for, if it carries the image
        self.sends = 0

    def commit(self, new: Commit) -> None:
        self.is_in_time(new.lo)
        self.asked.append(new)
        for older in self.waiting if new.kind == "write" else ():
            if older.kind == "write" and older.broadcast == new.broadcast:
                older.must, older.gone = False, min(older.gone, new.hi)
        if new.kind in ("image", "write"):
            self.waiting.append(new)

    def is_in_time(self, now: float) -> None:
        """The first of those that have to leave must have left when the line was free for it."""
        must = sorted((one for one in self.waiting if one.must), key=lambda one: one.kind)  # an image first
        for one in must[:1]:
            free = max(one.hi, self._exchange_over(one))
            while free < (quiet := self._quiet_after(min(free, now))) or free < (
                quiet := self._decided_after(free)
            ):
                free = quiet
            if now > free + self.budget:
                raise Lost(free, f"{one.telegram.hex(' ')} is not on the free line (FRAME-7)")

    def _quiet_after(self, at: float) -> float:
        return max((end for start, end in self.busy if start < at), default=0.0) + self.pause

    def _decided_after(self, at: float) -> float:
        """While a candidate decides, what waits is not ordered: its commit may change the image (FRAME-6)."""
        return max(
            (end for start, end in self.deciding if start < at + self.budget and at < end), default=0.0
        )

    def _exchange_over(self, waiting: Commit) -> float:
        """A dead drive holds up nothing newer for longer than 150 ms (FC-9)."""
        if self.last is None or self.last.good:
            return self.last.over if self.last else 0.0
        if waiting.lo < self.image_lo:
            return self.last.over + self.budget
        given_up = max(self.last.end + 10 * DEFAULT_WAIT * self.ms, waiting.hi)
        return min(self.last.over, given_up + LATE_MS * self.ms) + self.budget

    def telegram(self, said: Said) -> None:
        self.is_in_time(said.start)
        data, last, at = said.data, self.last, said.start
        sure = [one for one in self.waiting if one.must and one.hi <= at]
        images = [one for one in sure if one.kind == "image"]
        again = last is not None and last.good is not True and data == last.data and not is_broadcast(data[2])
        again &= self.sends == 1
        fitting = self._images(data, at) if len(data) == 8 else self._writes(data, at)
        fitting = [one for one in fitting if len(data) != 8 or not images or one.lo >= images[-1].lo]
        read = self._reading(data, at)
        # What has to leave before this telegram: an image before all, an older write before a newer one, and
        # before a repeat what is newer than it (FC-9).
        first = images or [
            one
            for one in sure
            if (
                one.lo < fitting[0].lo
                if fitting and len(data) != 8
                else (again and not fitting and one.lo > self.image_lo) or (read and one.hi < read.lo)
            )
        ]
        if first and not (images and fitting and len(data) == 8):
            wanted = first[0].telegram
            if (
                images
            ):  # one telegram for all of them, to the drive's own address if one was for this card alone
                alone = any(not one.broadcast for one in images)
                wanted = build(words_of(images[-1].telegram), adr=ADR if alone else ADR_BROADCAST)
            raise Lost(at, f"{data.hex(' ')} before {wanted.hex(' ')} (FRAME-7)")
        if fitting:
            self.image_lo = fitting[-1].lo if len(data) == 8 else -NEVER
            self._left(fitting, at, again)
        elif not (again or read or words_of(data) == NOTHING):
            raise Lost(at, f"{data.hex(' ')}, which no write that waits asks for (FRAME-7)")
        if not (fitting or again):
            self.image_lo = -NEVER
        self.sends = 2 if again and not fitting else 1
        self.last = said

    def _images(self, data: bytes, at: float) -> list[Commit]:
        """Writes of coils after which the image is this one, with the right address."""
        found, alone, may_be_alone = [], False, False
        for one in self.waiting:
            if one.kind == "image" and one.lo <= at:
                alone |= one.must and not one.broadcast
                may_be_alone |= not one.broadcast
                if words_of(one.telegram) == words_of(data) and (
                    not alone if is_broadcast(data[2]) else may_be_alone
                ):
                    found.append(one)
        return found

    def _writes(self, data: bytes, at: float) -> list[Commit]:
        """Writes of a parameter that may leave as this telegram."""
        return [
            one
            for one in self.waiting
            if one.kind == "write" and data in (one.telegram, one.again) and one.lo <= at < one.gone
        ]

    def _reading(self, data: bytes, at: float) -> Commit | None:
        """The newest request that may ask for it: a reading, or the text that follows a refused number."""
        asked = [
            one
            for one in self.asked
            if one.lo <= at and (data == one.again or (one.kind == "read" and data == one.telegram))
        ]
        return asked[-1] if asked else None

    def _left(self, fitting: list[Commit], at: float, again: bool) -> None:
        """The first that fits has left, and an image stands for all before it. The others may have."""
        for one in fitting:
            one.must &= one.hi <= at
        left = fitting[0]
        older = [one for one in self.waiting if one.kind == left.kind == "image" and one.lo < left.lo]
        # It may be the repeat of equal words, but not while an older image has to leave.
        if again and left.hi > at and not any(one.must and one.hi <= at for one in older):
            return
        self.waiting = [one for one in self.waiting if one is not left and one not in older]


def kept(
    committed: Sequence[Commit],
    said: Sequence[Said],
    busy: Sequence[tuple[float, float]],
    until: float,
    line: LineFormat,
    budget: float,
) -> list[str]:
    """The first violation before `until`; `line`: the drive's, `busy`: when someone sends on it."""
    order = Order(busy, [(c.candidate, c.hi) for c in committed], line, budget)
    events = [(c.lo, 0, order.commit, c) for c in committed] + [(s.start, 1, order.telegram, s) for s in said]
    try:
        for at, _, follow, item in sorted(events, key=lambda event: event[:2]):
            if at > until:
                break
            follow(item)
        order.is_in_time(until)
    except Lost as lost:
        at, what = lost.args
        return [f"at {at / order.ms:.1f} ms: {what}"]
    return []
