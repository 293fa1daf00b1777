# SPDX-License-Identifier: Apache-2.0
"""The rare outcomes of flips, as a table for build/reports/fuzz.md."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable

from campaigns.flips.trial import OUTCOMES, VALID
from tb.agents.crc16 import crc_good
from tb.model import fc_telegram

HEAD = ("| outcome | seen | flips | where most often |", "|---|---|---:|---|")
REGISTERS = 3
AGAIN, WRONG, MUTE = "telegram again or late", "wrong reply", "silent for good"
BYTES = r"((?:[0-9a-f]{2} ?)+)"
ONCE_MORE = re.compile(rf"{BYTES} once more")
# What the judge writes about a telegram that it found to be requested.
AS_ASKED = (
    (re.compile(rf"telegram {BYTES}, expected"), "as the newest request asked; the one before it was lost"),
    (re.compile(rf"telegram {BYTES}without a request"), "as requested, when the card may not send it"),
    (re.compile(rf"telegram {BYTES}: "), "as requested, with a flaw at which a drive drops it"),
)


def seen(outcome: str, why: str) -> str:
    """What a flip of this outcome did, by the line that the judge wrote about it."""
    if outcome == AGAIN:
        if found := ONCE_MORE.fullmatch(why):
            valid = bool(fc_telegram.parse(bytes.fromhex(found[1])).pcd1 & VALID)
            return f"its one repeat, before the time; bit 10 = {int(valid)}"
        return next((what for line, what in AS_ASKED if line.search(why)), "something else")
    if outcome == WRONG:
        found = re.search(rf"reply {BYTES}", why)
        good = bool(found) and crc_good(bytes.fromhex(found[1]))
        return "with a good CRC" if good else "with a wrong CRC, or cut short"
    if outcome == MUTE:
        return "nothing until the end of the run"
    return why


def rare_counts(notable: Iterable[dict]) -> dict[str, dict[str, Counter]]:
    """What was seen, by outcome, and how often in each register."""
    where: dict[str, dict[str, Counter]] = defaultdict(lambda: defaultdict(Counter))
    for entry in notable:
        path = entry["flip"].split("[", 1)[0]
        where[entry["what"]][seen(entry["what"], entry["why"])][path.removeprefix("core_i.")] += 1
    return where


def rare(counts: dict[str, dict[str, dict[str, int]]]) -> list[str]:
    """The table of rare_counts(), the worst outcome first."""
    rows = [
        f"| {outcome} | {what} | {sum(found.values()):,} | "
        + ", ".join(f"`{name}` {count}" for name, count in Counter(found).most_common(REGISTERS))
        + " |"
        for outcome in OUTCOMES
        for what, found in sorted(counts.get(outcome, {}).items())
    ]
    return [*HEAD, *rows]
