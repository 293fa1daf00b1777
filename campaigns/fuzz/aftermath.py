# SPDX-License-Identifier: Apache-2.0
"""Safety checks after the point where the judge had to stop because the rules leave the received frame open.

Each telegram that commands the drive or writes a parameter must have been requested before: at most two such
telegrams, one for a broadcast, none after an answer to that request or to a newer one (SAFE-1, FC-9). The
last requests, which are plain, must have their answers (SAFE-3). Unit of time: clocks.
"""

from __future__ import annotations

import copy
from collections import Counter
from dataclasses import dataclass, field

from tb.agents.crc16 import crc_good
from tb.model import fc_telegram
from tb.model.card import READS, CardModel
from tb.model.wire import (
    FRAME_MAX,
    FRAME_MIN,
    UNSURE_BITS,
    Burst,
    FarCharacter,
    LineFormat,
    drive_line,
    taken_by_a_drive,
)

VALID = 0x0400  # bit 10 of the control word: the drive takes the process data (FC-5)
WRITES = (
    fc_telegram.AK_WRITE_WORD,
    fc_telegram.AK_WRITE_DOUBLE,
    fc_telegram.AK_EEPROM_DOUBLE,
    fc_telegram.AK_EEPROM_WORD,
)
COIL_WRITES = (0x05, 0x0F)
STATES_MAX = 64  # possible states of the card; above, the checks end
EXCHANGE_S = 0.04  # the longest telegram


@dataclass
class Possible:
    """A frame that may have been committed. `answered`: start of a reply to it."""

    start: float
    end: float
    data: bytes
    answered: float = float("inf")
    telegrams: frozenset[bytes] = frozenset()
    sent: Counter = field(default_factory=Counter)  # number of each telegram

    @property
    def writes_coils(self) -> bool:
        return self.data[1] in COIL_WRITES


def possible_frames(network: list[FarCharacter], line: LineFormat, address: int) -> list[Possible]:
    """Every run of good characters between possible silences that is a frame for the card."""
    starts, ends = [], []
    for number, heard in enumerate(network):
        before, after = network[number - 1 : number], network[number + 1 : number + 2]
        unsure = heard.slack + UNSURE_BITS * line.bit
        if not before or heard.start - before[0].end > line.t15_bits * line.bit - unsure - before[0].slack:
            starts.append(number)
        if not after or after[0].start - heard.end > line.t35_bits * line.bit - unsure - after[0].slack:
            ends.append(number)
    found = []
    for end in ends:
        for start in starts:
            run = network[start : end + 1]
            if not FRAME_MIN <= len(run) <= FRAME_MAX or not all(heard.good for heard in run):
                continue
            data = bytes(heard.byte for heard in run)
            if data[0] in (0, address) and crc_good(data):
                found.append(Possible(run[0].start, run[-1].end, data))
    return found


def asked(frames: list[Possible], replies: list[Burst], dialect: str) -> bool:
    """Finds answer and possible telegrams of each frame; False if there are too many possibilities."""
    states = [CardModel(name=dialect)]
    for number, frame in enumerate(frames):
        until = frames[number + 1].start if number + 1 < len(frames) else float("inf")
        here = [reply for reply in replies if frame.end < reply.rise < until]
        # After exception 255 a write still leaves when the line is free at last (FRAME-7).
        if here and (frame.data[1] in READS or here[0].data[1:3] != bytes([0x80 | frame.data[1], 255])):
            frame.answered = here[0].rise
        confirmed = frame.data[0] != 0 and bool(here) and here[0].data[:2] == frame.data[:2]
        changed, telegrams = [], set()
        for state in states:
            after = copy.deepcopy(state)
            step = after.request(frame.data[1:-2], frame.data[0] == 0)
            changed.append(after)
            again = after.question and after.question.again
            telegrams |= {fc_telegram.build(t[1:], adr=t[0]) for t in (step.telegram, again) if t}
            # One telegram may stand for this write to all and for an earlier one to this card (FRAME-7).
            if step.telegram and frame.writes_coils and any(to_one(earlier) for earlier in frames[:number]):
                telegrams.add(fc_telegram.build(step.telegram[1:], adr=fc_telegram.ADR))
        frame.telegrams = frozenset(telegrams)
        kept = changed if confirmed else [*states, *changed]
        states = list({(tuple(c.coils), tuple(c.registers.items())): c for c in kept}.values())
        if len(states) > STATES_MAX:
            return False
    return True


def to_one(frame: Possible) -> bool:
    return frame.writes_coils and frame.data[0] != 0


def acts(data: bytes) -> bool:
    """Whether a telegram affects a motor or a setting."""
    telegram = fc_telegram.parse(data)
    text = telegram.ak == fc_telegram.AK_TEXT and telegram.text is not None
    return bool(telegram.pcd1 & VALID) or text or telegram.ak in WRITES


def unasked(
    frames: list[Possible],
    telegrams: list[Burst],
    drive: list[FarCharacter],
    clk_hz: int,
    since: float,
    wait: int,
) -> list[str]:
    """Telegrams from `since` on that no frame explains; `wait`: last value of register 40003."""
    # A write may wait for the exchange before it, with its repeat, for another write and the line (FRAME-7).
    waits = 4 * (wait / 100 + EXCHANGE_S) * clk_hz

    def may_wait(frame: Possible, at: float) -> bool:
        busy = sum(heard.end - heard.start for heard in drive if frame.end < heard.start < at)
        return frame.data[1] not in READS and at < frame.end + waits + busy

    found = []
    seen, _ = taken_by_a_drive(telegrams, drive_line(clk_hz))
    for at, data in seen:
        if not acts(data):
            continue
        before = [frame for frame in frames if frame.end < at]
        newest_answered = max((frame.end for frame in before if frame.answered < at), default=0.0)
        rightful = [
            frame
            for frame in before
            if data in frame.telegrams
            and frame.sent[data] < (1 if fc_telegram.is_broadcast(data[2]) else 2)
            and (frame.end > newest_answered or may_wait(frame, at))
            and frame.answered >= at
        ]
        if rightful:
            rightful[-1].sent[data] += 1
        elif at >= since:
            found.append(f"telegram {data.hex(' ')} that no request asked for (SAFE-1)")
    return found


def unanswered(
    last: list[bytes], network: list[FarCharacter], replies: list[Burst], until: float, count: int | None
) -> list[str]:
    """The first `count` of the last requests: each must have one fitting reply."""
    heard, found = list(network), []
    ends: list[tuple[float, float]] = []
    for pdu in reversed(last):
        heard, frame = heard[: -len(pdu) - 3], heard[-len(pdu) - 3 :]
        ends.insert(0, (frame[0].start, frame[-1].end))
    for number, pdu in list(enumerate(last))[:count]:
        over = ends[number + 1][0] if number + 1 < len(last) else until
        said = [reply.data for reply in replies if ends[number][1] < reply.rise < over]
        if [data[1] & 0x7F for data in said if crc_good(data)] != [pdu[0]]:
            shown = " and ".join(data.hex(" ") for data in said) or "nothing"
            found.append(f"{shown} to the good request {pdu.hex(' ')} (SAFE-3)")
    return found
