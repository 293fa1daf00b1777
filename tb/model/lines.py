# SPDX-License-Identifier: Apache-2.0
"""The two lines as requests and exchanges: what was committed, and what the drive was told and replied.

For the judges of SAFE-8 (told.py) and FRAME-7 (kept.py), and written from the rules. Unit of time: clocks.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from tb.model.card import DRIVE_TIMEOUT, CardModel
from tb.model.fc_telegram import build, is_broadcast
from tb.model.wire import (
    GARBLED_BITS,
    UNSURE_BITS,
    Burst,
    DriveReceiver,
    FarCharacter,
    LineFormat,
    Unclear,
    heard_around,
)

NEVER = float("inf")
NOTHING = bytes(4)  # control word and reference of a card that was just switched on, and of STATUS_REFRESH
DEFAULT_WAIT = 15  # register 40003; FC-9: as long as a dead drive holds up a newer telegram
LATE_MS = (
    2.2 + 4.5
)  # ticks of the firmware's clock, and the last character of a reply that it still waits for
WAIT_WRITTEN = re.compile(rb"\x06\0\x02(..)|\x10\0\x02\0\x01\x02(..)|\x10\0\x01\0\x02\x04..(..)", re.DOTALL)


@dataclass(eq=False)
class Commit:
    """A committed request. The card knows of it at `lo` at the earliest, at `hi` at the latest.

    `telegram`: what it asks of the drive; `again`: as a text, if the drive refuses the number (section 8).
    `candidate`: from then on the card decided on it, and ordered nothing that waited.
    `must`: its telegram has to leave. `gone`: from then on it must not, for a newer one has taken its place.
    """

    lo: float
    hi: float
    kind: str  # image, write, read; local
    broadcast: bool
    telegram: bytes
    again: bytes
    wait: int  # register 40003 from then on
    candidate: float = NEVER
    must: bool = True
    gone: float = NEVER


@dataclass(frozen=True)
class Said:
    """A telegram of the card. `good`: it had a good reply. `over`: the latest end of its exchange."""

    start: float
    end: float
    data: bytes
    good: bool | None
    over: float


def words_of(telegram: bytes) -> bytes:
    """Control word and reference of a process telegram; of any other nothing."""
    return telegram[3:7] if len(telegram) == 8 and telegram[1] == 6 else b""


def image_of(reply: bytes) -> bytes:
    """The same of the answer to a reading of coils 1-32: address, 01, count, coils from the lowest, CRC."""
    return bytes([reply[4], reply[3], reply[6], reply[5]])


def commits(events: Iterable, dialect: str, line: LineFormat, budget: float) -> tuple[list[Commit], float]:
    """All commits, and the time from which the rules leave the rest of them open."""
    model, found, candidate = CardModel(name=dialect), [], NEVER
    try:
        for event in events:
            if event.what == "candidate":
                candidate = event.at - event.slack - UNSURE_BITS * line.bit
            if event.what != "commit":
                continue
            pdu, broadcast = event.frame.data[1:-2], event.frame.broadcast
            step = model.request(pdu, broadcast)
            text = model.question.again if model.question else None
            telegram, again = (build(t[1:], adr=t[0]) if t else b"" for t in (step.telegram, text))
            kinds = {0x05: "image", 0x0F: "image", 0x06: "write", 0x10: "write"}
            kind = kinds.get(pdu[0], "read") if telegram else "local"
            unsure = event.slack + UNSURE_BITS * line.bit
            wait = model.registers[DRIVE_TIMEOUT]
            found.append(
                Commit(
                    *(event.at - unsure, event.at + unsure + budget, kind),
                    *(broadcast, telegram, again, wait, candidate),
                )
            )
    except Unclear as unclear:
        return found, unclear.at
    return found, NEVER


def waits_for(
    telegrams: Sequence[Burst], committed: Sequence[Commit], network: Sequence[FarCharacter], until: float
) -> list[tuple[int, int]]:
    """Smallest and largest register 40003 that may count for each telegram; after `until`, of all seen."""
    stream, found = bytes(character.byte for character in network), []
    seen = {int.from_bytes(b"".join(value), "big") for value in WAIT_WRITTEN.findall(stream)} - {0}
    for number, burst in enumerate(telegrams):
        over = telegrams[number + 1].rise if number + 1 < len(telegrams) else NEVER
        values = [DEFAULT_WAIT, *(c.wait for c in committed if c.hi <= burst.rise)][-1:]
        values += [c.wait for c in committed if c.lo <= over and c.hi > burst.rise]
        values += [DEFAULT_WAIT, *seen] if over > until else []
        found.append((min(values), max(values)))
    return found


def fits(asked: bytes, reply: bytes) -> bool:
    """Whether a good telegram of the drive is a reply to this one (FC-8); both are ADR and data."""
    if 5 in (len(asked), len(reply)):
        return len(asked) == len(reply)
    ak, text = reply[1] >> 4, asked[1] >> 4 == 15
    number = len(reply) == 13 and (ak == 7 or (ak in (1, 2) and not text))
    return (number or (text and ak == 15)) and (asked[1] ^ reply[1]) & 15 == 0 and asked[2] == reply[2]


def exchanges(
    telegrams: Sequence[Burst],
    drive: Sequence[FarCharacter],
    line: LineFormat,
    waits: Iterable[tuple[int, int]],
) -> Iterator[Said]:
    """`waits`: smallest and largest register 40003 of each telegram; `line`: the drive's."""
    ms = line.clk_hz / 1000
    heard = [item for _, item in heard_around(drive, telegrams, line.bit) if isinstance(item, FarCharacter)]
    for number, (burst, (low, high)) in enumerate(zip(telegrams, waits, strict=True)):
        data, end = burst.data, float(burst.fall)
        until = telegrams[number + 1].rise if number + 1 < len(telegrams) else float("inf")
        good, over, doubt = False, end + (10 * high + LATE_MS) * ms, False
        if len(data) < 3 or is_broadcast(data[2]):
            yield Said(float(burst.rise), end, data, False, end)
            continue
        receiver = DriveReceiver(line, data[2], last_end=end)
        try:
            for character in heard:
                if end <= character.start < until:
                    reply = receiver.hears(character)
                    if reply and fits(data[2:-1], reply):
                        in_time = not doubt and character.end < end + 10 * low * ms
                        good = in_time or (None if character.end < over else False)
                        over = character.end if good else over
                        break
                    # The firmware is busy for a while after what does not fit, and a reply may be among
                    # characters that the card found at a bit that is no start bit.
                    garbled = character.slack >= GARBLED_BITS * line.bit
                    doubt |= bool(reply) or garbled
                    good = None if garbled else good
        except Unclear:
            good = None
        yield Said(float(burst.rise), end, data, good, over)
