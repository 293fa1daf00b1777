# SPDX-License-Identifier: Apache-2.0
"""How many frames of the fuzzer each planted bug lives (ONLY=name: one of them); `make fuzz-plants`.

    python -m campaigns.fuzz.planted [--seed N] [--count FRAMES] [--only NAME]

The bugs are those of tb/planted.toml for the fuzzer, each in the standard card. Exit 0: each was found; 1:
one lived through all frames; 2: an invalid command line. Other options: campaigns/engine.py.
"""

from __future__ import annotations

from argparse import Namespace

from campaigns.engine import Campaign, EngineError, Row, Store
from campaigns.fuzz.plants import PLANTS, PlantError, card_with, named
from campaigns.fuzz.trial import until
from rtl.command import Parser, run_main
from rtl.sources import SourcesError
from sim.harness.library import BuildError


class Planted(Campaign):
    every_dialect = True
    name, module = "fuzz-plants", "campaigns.fuzz.planted"
    unit = "frames for each bug"
    count = 20000

    def options(self, parser: Parser) -> None:
        parser.add_argument("--only", metavar="NAME", help="this bug")

    def cases(self, given: Namespace) -> list[str]:
        if given.config != "standard":
            raise EngineError("the bugs are planted in the standard card")
        plants = [named(given.only)] if given.only else PLANTS
        return [f"{plant.name}/{given.seed}/{given.count}" for plant in plants]

    def run(self, config: str, case: str) -> Row:
        name, seed, count = case.split("/")
        found = until(int(seed), int(count), card_with(named(name)), stop=True)
        return {
            "frames": found["frames"],
            "what": [what for each in found["differences"] for what in each["what"]],
        }

    def wrong(self, row: Row) -> str:
        return "" if row["what"] else f"not found in {row['frames']:,} frames"

    def said(self, rows: dict[str, Row]) -> str:
        lines = [f"{case:40} {row['frames']:6} frames  {row['what'][:1]}" for case, row in rows.items()]
        lived = sum(bool(self.wrong(row)) for row in rows.values())
        return "\n".join([f"{lived} planted bugs not found", *lines])

    def rows(self, store: Store) -> list[tuple[str, str, str]]:
        """For the page: each bug, its rules, and after how many frames it was found."""
        kept: dict[str, Row] = {}
        for case, row in store.rows(self.name, self.of("standard"), "standard").items():
            name = case.split("/")[0]
            kept[name] = max(row, kept.get(name, row), key=lambda one: (bool(one["what"]), one["frames"]))
        if lacking := [plant.name for plant in PLANTS if plant.name not in kept]:
            raise EngineError(f"no result of {', '.join(lacking)}; run `make {self.name}` first")
        found = [(plant, kept[plant.name]) for plant in PLANTS]
        return [
            (plant.name, f"{', '.join(plant.rules)}: {plant.what}", self.wrong(row) or f"{row['frames']:,}")
            for plant, row in found
        ]


CAMPAIGN = Planted()

if __name__ == "__main__":
    run_main("fuzz-plants", CAMPAIGN.main, BuildError, EngineError, PlantError, SourcesError)
