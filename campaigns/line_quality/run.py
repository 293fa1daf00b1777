# SPDX-License-Identifier: Apache-2.0
"""Measures line faults that the card tolerates, on its pins, and compares with theory; `make line-quality`.

    python -m campaigns.line_quality.run [--seed N]

A case is one rate, format and clock. Exit 1: a limit is below LINE-5 or away from theory; 2: something to
measure is missing. Other options: campaigns/engine.py.
"""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from typing import Any

from campaigns.engine import Campaign, EngineError, Row, Store
from campaigns.line_quality.limits import ALL_FORMS, QUANTITIES, Quantity
from campaigns.line_quality.measure import Limit
from campaigns.line_quality.work import CARD_HZ, whole
from rtl.command import run_main
from rtl.report_page import markdown
from rtl.sources import SourcesError
from sim.harness.library import BuildError

# The longest first.
PIECES = {piece.name: piece for piece in sorted(whole(), key=lambda piece: -piece.cost)}


class LineQuality(Campaign):
    name, module = "line-quality", "campaigns.line_quality.run"
    command = "make line-quality"
    count = 0
    configs = ("standard",)

    def cases(self, given: Namespace) -> list[str]:
        return [f"{given.seed}/{name}" for name in PIECES]

    def run(self, config: str, case: str) -> Row:
        seed, name = case.split("/")
        return {"limits": [asdict(one) for one in PIECES[name].run(int(seed))]}

    def wrong(self, row: Row) -> str:
        return "; ".join(faults([Limit(**one) for one in row["limits"]]))

    def said(self, rows: dict[str, Row]) -> str:
        limits = limits_of(rows)
        lines = sorted({(one.line, one.form) for one in limits})
        shown = [f"{line} line, {form}\n{table(limits, line, form)}\n" for line, form in lines]
        return "\n".join([f"{len(limits)} limits, {len(faults(limits))} missed", *shown])

    def context(self, store: Store) -> dict[str, Any]:
        (card,) = self.found(store)
        seed, rows = self.whole_run(card)
        limits = limits_of(rows)
        return {
            "seed": seed,
            "measured_on": card.name,
            "worst": worst(limits),
            "tables": {form: table(limits, "network", form) for form in ALL_FORMS},
            "drive": table(limits, "drive", "8E1"),
            "faults": len(faults(limits)),
            "asked": sum(one.asked for one in limits),
            "limits": len(limits),
        }

    def about(self, store: Store) -> str:
        found = self.context(store)
        characters = f"{found['limits']} limits, {found['asked']:,} characters"
        return f"{characters}; {found['faults']} outside theory and LINE-5."


def limits_of(rows: dict[str, Row]) -> list[Limit]:
    order = list(QUANTITIES)
    return sorted(
        (Limit(**one) for row in rows.values() for one in row["limits"]),
        key=lambda one: (one.line, one.form, one.baud, one.clk_hz, order.index(one.quantity)),
    )


def shown(quantity: Quantity, value: float) -> str:
    return f"{100 * value:.2f} %" if quantity.unit == "%" else f"{value:.3f}"


def table(limits: list[Limit], line: str, form: str) -> str:
    """Theory in the first row, then a row for each rate and clock."""
    every = QUANTITIES.values()
    titles = [quantity.title for quantity in every]
    rows = [
        ["bit/s", "clocks a bit", *titles, "characters a point"],
        ["theory", "", *(" … ".join(shown(q, value) for value in q.theory(form)) for q in every), ""],
    ]
    lines = sorted({(one.baud, one.clk_hz) for one in limits if (one.line, one.form) == (line, form)})
    for baud, clk_hz in lines:
        here = {
            one.quantity: one
            for one in limits
            if (one.line, one.form, one.baud, one.clk_hz) == (line, form, baud, clk_hz)
        }
        cells = [
            ("> " if here[name].beyond else "") + shown(quantity, here[name].found) if name in here else ""
            for name, quantity in QUANTITIES.items()
        ]
        mark = f"{clk_hz / baud:.0f}" + (" (12 MHz)" if clk_hz == CARD_HZ else "")
        rows.append([str(baud), mark, *cells, str(next(iter(here.values())).characters)])
    return markdown(rows)


def worst(limits: list[Limit]) -> str:
    """The smallest limit of each quantity over all lines, with the promised value."""
    rows = [["quantity", "least found", "where", "LINE-5"]]
    for name, quantity in QUANTITIES.items():
        least = min((one for one in limits if one.quantity == name), key=lambda one: one.found)
        where = f"{least.line} line, {least.baud} {least.form}, {least.clk_hz / least.baud:.0f} clocks a bit"
        promise = shown(quantity, quantity.promise) if quantity.promise else "-"
        rows.append([quantity.title, shown(quantity, least.found), where, promise])
    return markdown(rows)


def faults(limits: list[Limit]) -> list[str]:
    return [fault for one in limits for fault in one.faults]


CAMPAIGN = LineQuality()

if __name__ == "__main__":
    run_main("line-quality", CAMPAIGN.main, BuildError, EngineError, SourcesError)
