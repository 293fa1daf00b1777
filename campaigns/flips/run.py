# SPDX-License-Identifier: Apache-2.0
"""Flips single bits of the running card under traffic (COUNT=, BAUD=, TRIAL=one flip); `make flips`.

    python -m campaigns.flips.run [--seed N] [--count FLIPS] [--baud RATE] [--config NAME]
    python -m campaigns.flips.run --trial SEED/NUMBER [--baud RATE] [--config NAME]  # one flip, with the
    traffic on both lines

The same seed, count, rate and card flip the same bits anywhere. Exit 0: no unrequested or altered telegram
and no driver that stays on (SAFE-4, SAFE-2); 1: at least one; 2: an invalid command line or a missing tool.
Other options: campaigns/engine.py. The page is that of the fuzzer.
"""

from __future__ import annotations

import functools
import os
import re
from argparse import Namespace
from collections import Counter

from campaigns.engine import Campaign, EngineError, Row, total
from campaigns.flips.group import GroupError, outcomes
from campaigns.flips.trial import (
    BAUDS,
    FORBIDDEN,
    FORMS,
    GROUP,
    OUTCOMES,
    PACES,
    PARTS,
    Places,
    flipped_card,
    trial,
)
from campaigns.fuzz.trial import story
from rtl.command import Parser, run_main
from sim.harness.library import BuildError
from sim.harness.registers import RegistersError
from tb.lib import bound

BOUND = f"first five rows together, at most, at {bound.SURE}"
# Effects that the report lists one by one.
WRONG = ("telegram again or late", "wrong reply", "silent for good")
NOTABLE = (*OUTCOMES[: OUTCOMES.index("driver stuck") + 1], *WRONG)


class Flips(Campaign):
    """A case is a group of flips in the same traffic: rate, seed and number of the first flip."""

    name, module = "flips", "campaigns.flips.run"
    unit = "flips"
    count = 500

    def options(self, parser: Parser) -> None:
        parser.add_argument("--baud", type=int, default=BAUDS[0], choices=BAUDS, help="network line")
        parser.add_argument("--trial", metavar="SEED/NUMBER", help="one flip again, with its traffic")

    def cases(self, given: Namespace) -> list[str]:
        return [f"{given.baud}/{given.seed}/{first}" for first in range(0, given.count, GROUP)]

    def run(self, config: str, case: str) -> Row:
        baud, seed, first = map(int, case.split("/"))
        there, began = places(config, baud), cpu_s()
        numbers = [f"{seed}/{number}" for number in range(first, first + GROUP)]
        found = list(zip(numbers, outcomes(numbers, there), strict=True))
        return {
            "flips": GROUP,
            "flips_at": {str(baud): GROUP},
            # At another clock the dividers have other widths, so the number of bits differs.
            "bits": {part: [there.bits(part)] for part in PARTS},
            "counts": Counter(f"{one.flip.part}: {one.what}" for _, one in found),
            "notable": [
                {"trial": number, "flip": str(one.flip), "what": one.what, "why": one.why}
                for number, one in found
                if one.what in NOTABLE
            ],
            "cpu_s": cpu_s() - began,
        }

    def instead(self, given: Namespace) -> int | None:
        if not given.trial:
            return None
        if not re.fullmatch(r"\d+/\d+", given.trial):
            raise EngineError(f"--trial {given.trial}: SEED/NUMBER")
        return tell(given.trial, places(given.config, given.baud))

    def wrong(self, row: Row) -> str:
        forbidden = (each for each in row["notable"] if each["what"] in FORBIDDEN)
        return "; ".join(
            f"{each['trial']} {each['flip']}: {each['what']}: {each['why']}" for each in forbidden
        )

    def said(self, rows: dict[str, Row]) -> str:
        return report(total(rows.values()))


@functools.cache
def places(config: str, baud: int) -> Places:
    return Places(flipped_card(config), baud)


def cpu_s() -> float:
    """Seconds of one core that this process and its copies have taken."""
    now = os.times()
    return now.user + now.system + now.children_user + now.children_system


def rates(merged: dict) -> str:
    """Number of flips at each rate, in words."""
    at = sorted((int(baud), count) for baud, count in merged["flips_at"].items())
    return ", ".join(f"{count} at {baud} bit/s {FORMS[baud]}" for baud, count in at)


def table(merged: dict) -> list[str]:
    """Effects by part, a row each."""
    parts = [part for part in PARTS if any(merged["bits"][part])]
    lines = ["| outcome | " + " | ".join(parts) + " | all |"]
    lines.append("|---|" + "---|" * (len(parts) + 1))
    for what in OUTCOMES:
        row = [merged["counts"].get(f"{part}: {what}", 0) for part in parts]
        lines.append(f"| {what} | " + " | ".join(map(str, [*row, sum(row)])) + " |")
    flips = [sum(n for k, n in merged["counts"].items() if k.startswith(f"{part}: ")) for part in parts]
    lines.append("| flips | " + " | ".join(map(str, [*flips, sum(flips)])) + " |")
    harm = [sum(merged["counts"].get(f"{part}: {what}", 0) for what in FORBIDDEN) for part in parts]
    harms = zip([*harm, sum(harm)], [*flips, sum(flips)], strict=True)
    lines.append(f"| {BOUND} | " + " | ".join(bound.words(seen, tries) for seen, tries in harms) + " |")
    there = [" or ".join(map(str, sorted(set(merged["bits"][part])))) for part in parts]
    return [*lines, "| bits there | " + " | ".join(there) + " | |"]


def report(merged: dict) -> str:
    """Table of the effects, and a line for each notable flip."""
    lines = [f"{merged['flips']} flips in {merged['cpu_s']:.0f} s of one core: {rates(merged)}", ""]
    lines += table(merged)
    lines += [f"{e['trial']}: {e['flip']}: {e['what']}: {e['why']}" for e in merged["notable"]]
    return "\n".join(lines)


def tell(name: str, places: Places) -> int:
    outcome, case, played, verdict = trial(name, places)
    print(f"{outcome.flip} ({outcome.flip.part}): {outcome.what}: {outcome.why}")
    print("\n".join(story(case, played, verdict, PACES[places.target.config])))
    return int(outcome.what in FORBIDDEN)


CAMPAIGN = Flips()

if __name__ == "__main__":
    run_main("flips", CAMPAIGN.main, BuildError, EngineError, GroupError, RegistersError)
