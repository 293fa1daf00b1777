# SPDX-License-Identifier: Apache-2.0
# needs: bench-card bench-tiny card drive | setup-test
"""Measures turnaround on the card's pins (CONFIG=tiny: the small card's); `make bench`.

    python -m campaigns.bench.run [--config tiny] [--seed N] [--only KIND] [--fast yes]

A case is one kind of work at one rate in one format (cases.py). With --fast they are those of the tests.
Exit 1: a limit is missed; 2: something to measure is missing. Other options: campaigns/engine.py.
"""

from __future__ import annotations

import functools
from argparse import Namespace
from typing import Any

from campaigns.bench.card import BenchError, Build
from campaigns.bench.judge import Outcome
from campaigns.bench.report import REPORT_TABLES, CardResults, Image, printed, tables
from campaigns.bench.wave import FORMAT_NAMES
from campaigns.bench.work import (
    ALL_FORMS_FROM,
    EACH_SIZE_FROM,
    FORM,
    KINDS_OF_WORK,
    PHASES,
    PHASES_AT,
    Piece,
    fast,
    whole,
)
from campaigns.engine import Campaign, EngineError, Row, Store
from rtl.command import Parser, run_main
from rtl.sources import SourcesError
from sim.harness.library import BuildError
from sw.tools import stack

# A second of the small card takes three times as long to simulate; a slow line only gives its firmware time.
SMALL_CARD_FROM = 2400
ONE_FORM = ("sizes", "phases", "random", "conformance")


def is_asked(piece: Piece) -> bool:
    if piece.build.config == "standard":
        return True
    quick = piece.baud >= ALL_FORMS_FROM[piece.build.config]
    if piece.form != FORM:
        return quick and piece.kind not in ONE_FORM
    return piece.baud >= SMALL_CARD_FROM and (quick or piece.kind != "conformance")


@functools.cache
def pieces(seed: int, part: str = "") -> dict[str, Piece]:
    """By name, the longest first."""
    found = (fast if part == "fast" else whole)(seed)
    return {piece.name: piece for piece in sorted(found, key=lambda piece: -piece.cost)}


def piece_of(case: str) -> Piece:
    seed, *part, name = case.split("/")
    return pieces(int(seed), *part)[name]


class TurnaroundBench(Campaign):
    name, module = "bench", "campaigns.bench.run"
    command = "make bench of both cards"
    unit = "pieces"
    count = 0
    keep = REPORT_TABLES

    def options(self, parser: Parser) -> None:
        parser.add_argument("--only", metavar="KIND", choices=KINDS_OF_WORK, help=", ".join(KINDS_OF_WORK))
        parser.add_argument("--fast", choices=["yes"], help="the part that the tests run")

    def cases(self, given: Namespace) -> list[str]:
        part = "fast" if given.fast else ""
        return [
            "/".join(filter(None, (str(given.seed), part, name)))
            for name, piece in pieces(given.seed, part).items()
            if piece.build.config == given.config and given.only in (None, piece.kind) and is_asked(piece)
        ]

    def run(self, config: str, case: str) -> Row:
        outcome, most = piece_of(case).run(), image(config).stack
        if (seen := outcome.stack_bytes) > most:
            outcome.faults.append(f"{seen} bytes of stack seen, {most} by call graph")
        return outcome.row()

    def wrong(self, row: Row) -> str:
        return "; ".join(row["faults"])

    def said(self, rows: dict[str, Row]) -> str:
        results = results_of(rows)
        return f"{len(results.faults())} limits missed\n\n{printed(results)}\n"

    def context(self, store: Store) -> dict[str, Any]:
        cards = {card.config: card for card in self.found(store)}
        seeds, results = {}, {}
        for config, card in cards.items():
            seeds[config], rows = self.whole_run(card, only=None, fast=None)
            results[config] = results_of(rows)
        return {
            "measured_on": "; ".join(card.name for card in cards.values()),
            "commands": " and ".join(f"`make bench CONFIG={c} SEED={seed}`" for c, seed in seeds.items()),
            "formats": ", ".join(FORMAT_NAMES),
            "form": FORM,
            "all_forms_from": ALL_FORMS_FROM,
            "small_card_from": SMALL_CARD_FROM,
            "each_size_from": EACH_SIZE_FROM,
            "phases": PHASES,
            "phases_at": " and ".join(map(str, PHASES_AT)),
            "missed": [f"{config}: {fault}" for config, each in results.items() for fault in each.faults()],
            **{config: tables(each) for config, each in results.items()},
        }


@functools.cache
def image(config: str) -> Image:
    elf = Build(config).image_folder / "firmware.elf"
    return Image(*stack.sizes(elf), *stack.deepest(elf))


def results_of(rows: dict[str, Row]) -> CardResults:
    found = {case: (piece_of(case), Outcome.of(row)) for case, row in rows.items()}
    (config,) = {piece.build.config for piece, _ in found.values()}
    outcomes = dict(sorted((piece.name, (piece, outcome)) for piece, outcome in found.values()))
    return CardResults(config, outcomes, image(config))


CAMPAIGN = TurnaroundBench()

if __name__ == "__main__":
    run_main("bench", CAMPAIGN.main, BenchError, BuildError, EngineError, SourcesError, stack.StackError)
