# SPDX-License-Identifier: Apache-2.0
"""What the image shows is what the drive was told (SAFE-8), judged from the two lines alone.

`not_told` is the rule, for any test that knows the card's telegrams and which of them had a good reply.
`judge` takes everything sent on both lines and asks the rule at each answered reading of coils 1-32 before
which both lines had come to rest. It also asks tb/model/kept.py for the order in which the writes left
(FRAME-7). Unit of time: clocks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from tb.agents.crc16 import crc_good
from tb.model.fc_telegram import is_broadcast
from tb.model.kept import kept
from tb.model.lines import NOTHING, Commit, Said, commits, exchanges, image_of, waits_for, words_of
from tb.model.wire import PAUSE_BITS, Burst, FarCharacter, LineFormat, NetworkReceiver, drive_line


def not_told(sent: Iterable[tuple[bytes, bool | None]], image: bytes) -> str:
    """SAFE-8 for the telegrams since the card's start, each with whether it had a good reply; "" if it holds.

    None: the rules leave that open. No drive replies to a broadcast, so a broadcast has to carry the image.
    """
    process = [(words_of(data), good or is_broadcast(data[2])) for data, good in sent if words_of(data)]
    told = [each for each in process if each[0] != NOTHING]
    if image == NOTHING and (not told or process[-1][0] == NOTHING):
        return ""
    if not told:
        return f"coils 1-32 show {image.hex(' ', 2)}, and the drive was told nothing (SAFE-8)"
    words, good = told[-1]
    if words == image or not good:
        return ""
    return f"coils 1-32 show {image.hex(' ', 2)}, and the drive was told {words.hex(' ', 2)} (SAFE-8)"


@dataclass
class Verdict:
    differences: list[str] = field(default_factory=list)
    asked: int = 0  # readings of coils 1-32 that were judged
    restless: int = 0  # and that were not, because something was still on its way


def readings(
    network: Sequence[FarCharacter], replies: Sequence[Burst], line: LineFormat, address: int
) -> Iterator[tuple[float, float, Burst]]:
    """Each answered reading of coils 1-32: end of what came before it, its start, its answer."""
    for reply in replies:
        heard = [c for c in network if c.end < reply.rise]
        first = len(heard) - 1
        while first > 0 and heard[first].start - heard[first - 1].end < line.t15_bits * line.bit:
            first -= 1
        asked = bytes(c.byte for c in heard[first:])
        whole = crc_good(asked) and crc_good(reply.data) and all(c.good for c in heard[first:])
        image = len(asked) == 8 and asked[:4] == bytes([address, 1, 0, 0]) and asked[5] >= 32
        if whole and image and reply.data[:2] == asked[:2]:
            yield (heard[first - 1].end if first else 0.0), heard[first].start, reply


def falsely_confirmed(
    committed: Sequence[Commit], said: Sequence[Said], replies: Sequence[Burst]
) -> Iterator[str]:
    """Each echo of a write of coils that the drive was not told, or did not confirm."""
    for reply in replies:
        asked = next((one for one in reversed(committed) if one.lo < reply.rise), None)
        if asked is None or asked.kind != "image" or asked.broadcast or not reply.data[1:2] < b"\x80":
            continue
        told = [e for e in said if asked.lo <= e.start < reply.rise and words_of(e.data)]
        if not told or told[-1].good is False or words_of(told[-1].data) != words_of(asked.telegram):
            yield f"{reply.data.hex(' ')} to a command that the drive did not confirm (MAP-3)"


def judge(
    network: Sequence[FarCharacter],
    drive: Sequence[FarCharacter],
    replies: Sequence[Burst],
    telegrams: Sequence[Burst],
    end: float,
    *,
    line: LineFormat,
    address: int,
    dialect: str,
    budget: float,
    strict_t15: bool = True,
) -> Verdict:
    """`budget`: the longest time that the firmware needs for anything. `end`: of the record."""
    verdict, far = Verdict(), drive_line(line.clk_hz)
    pause = (PAUSE_BITS + 1.5) * far.bit
    events = NetworkReceiver(line, address, strict_t15).events(network, replies)
    committed, until = commits(events, dialect, line, budget)
    waits = waits_for(telegrams, committed, network, until)
    said = list(exchanges(telegrams, drive, far, waits))
    for before, start, reply in readings(network, replies, line, address):
        earlier = [each for each in said if each.start < start]
        busy = [c.end for c in drive if c.start < reply.fall]
        quiet = max([before + line.t35_bits * line.bit, *busy, *(e.over for e in earlier[-1:])]) + pause
        later = [e for e in said if start <= e.start < max(reply.fall, start + budget + pause)]
        if quiet > start or any(words_of(each.data) != NOTHING for each in later):
            verdict.restless += 1
            continue
        verdict.asked += 1
        wrong = not_told([(each.data, each.good) for each in earlier], image_of(reply.data))
        if wrong:
            verdict.differences.append(f"at {reply.rise / line.clk_hz * 1000:.1f} ms: {wrong}")
            break
    verdict.differences += list(falsely_confirmed(committed, said, [r for r in replies if r.rise < until]))[
        :1
    ]
    busy = [(c.start, c.end) for c in drive] + [(each.start, each.end) for each in said]
    verdict.differences += kept(committed, said, busy, min(until, end), far, budget)
    return verdict
