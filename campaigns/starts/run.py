# SPDX-License-Identifier: Apache-2.0
"""Starts the card from random register contents and by resets at any clock (COUNT=); `make starts`.

    python -m campaigns.starts.run [--config NAME] [--count STARTS] [--seed FIRST]

Each seed is one start of each kind (tb/lib/starts.py). Exit 0: every start was alive and left the image as it
was (SAFE-5); 1: at least one did not; 2: an invalid command line. Other options: campaigns/engine.py.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable
from typing import Any

from campaigns.engine import Campaign, EngineError, Row, Store
from rtl.command import run_main
from tb.lib import bound, starts


class Starts(Campaign):
    name, module = "starts", "campaigns.starts.run"
    command = "make starts of both cards"
    unit = "starts"

    def cases(self, given: Namespace) -> list[str]:
        seeds = range(given.seed, given.seed + given.count)
        return [f"{kind}/{seed}" for kind in starts.KINDS for seed in seeds]

    def run(self, config: str, case: str) -> Row:
        kind, seed = case.split("/")
        return {"wrong": starts.start(kind, config, int(seed))}

    def context(self, store: Store) -> dict[str, Any]:
        cards = self.found(store)
        return {"cards": cards, "rows": [row(card, kind) for card in cards for kind in starts.KINDS]}


def spans(seeds: Iterable[int]) -> str:
    """Numbers with their gaps: 1 to 5, 9."""
    parts: list[list[int]] = []
    for seed in sorted(seeds):
        if parts and seed == parts[-1][-1] + 1:
            parts[-1][1:] = [seed]
        else:
            parts.append([seed])
    return ", ".join(" to ".join(map(str, part)) for part in parts) or "none"


def row(card: Namespace, kind: str) -> tuple:
    """One card and one kind of start."""
    found = {int(case.split("/")[1]): each for case, each in card.rows.items() if case.startswith(f"{kind}/")}
    failed = sum(bool(each["wrong"]) for each in found.values())
    seeds = spans(found)
    return card.config, kind, f"{len(found):,}", seeds, failed, bound.words(failed, len(found))


CAMPAIGN = Starts()

if __name__ == "__main__":
    run_main("starts", CAMPAIGN.main, EngineError)
