# SPDX-License-Identifier: Apache-2.0
"""Measures line faults that the card tolerates, on its pins, and compares with theory; `make line-quality`.

    python -m campaigns.line_quality.run [--seed N] [--jobs N]    everything; writes
    build/reports/line-quality.md
    python -m campaigns.line_quality.run --fast                   the part in `make test`; writes nothing
    python -m campaigns.line_quality.run --report                 writes the page from the last whole run

Exit 1 if a limit is below LINE-5 or away from theory, 2 if something to measure is missing.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict
from functools import partial

from campaigns.bench import fingerprint
from campaigns.line_quality.limits import ALL_FORMS, QUANTITIES, Quantity
from campaigns.line_quality.measure import OWN, Limit
from campaigns.line_quality.work import CARD_HZ, FAST, Piece, whole
from rtl.command import Parser, in_processes, run_main
from rtl.report_page import publish
from rtl.sources import ROOT, SourcesError
from sim.harness.library import BuildError
from sw.test import host
from tb.lib.options import at_least

KEPT = ROOT / "build/line_quality/results.json"
TEMPLATE = ROOT / "campaigns/line_quality/line-quality.md.in"
DEFAULT_SEED = 1


class LineQualityError(Exception):
    """Error for the user, in one line."""


def _work(piece: Piece, seed: int) -> list[Limit]:
    return piece.run(seed)


def measure(pieces: list[Piece], seed: int, jobs: int) -> list[Limit]:
    """Runs the pieces, the longest first."""
    for clock in sorted({piece.line.clk_hz for piece in pieces}):
        OWN.library(clock)  # once, not in each process
    limits: list[Limit] = []
    pieces = sorted(pieces, key=lambda piece: -piece.cost)
    for done, found in enumerate(in_processes(jobs, partial(_work, seed=seed), pieces), 1):
        limits += found
        if sys.stderr.isatty():
            print(f"\r{done}/{len(pieces)}", end="\r", file=sys.stderr)
    order = list(QUANTITIES)
    return sorted(
        limits, key=lambda one: (one.line, one.form, one.baud, one.clk_hz, order.index(one.quantity))
    )


def shown(quantity: Quantity, value: float) -> str:
    return f"{100 * value:.2f} %" if quantity.unit == "%" else f"{value:.3f}"


def row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def table(limits: list[Limit], line: str, form: str) -> str:
    """Theory in the first row, then a row for each rate and clock."""
    every = QUANTITIES.values()
    titles = [quantity.title for quantity in every]
    rows = [
        row(["bit/s", "clocks a bit", *titles, "characters a point"]),
        row(["---"] * (len(titles) + 3)),
        row(["theory", "", *(" … ".join(shown(q, value) for value in q.theory(form)) for q in every), ""]),
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
        rows.append(row([str(baud), mark, *cells, str(next(iter(here.values())).characters)]))
    return "\n".join(rows)


def worst(limits: list[Limit]) -> str:
    """The smallest limit of each quantity over all lines, with the promised value."""
    rows = [row(["quantity", "least found", "where", "LINE-5"]), row(["---"] * 4)]
    for name, quantity in QUANTITIES.items():
        least = min((one for one in limits if one.quantity == name), key=lambda one: one.found)
        where = f"{least.line} line, {least.baud} {least.form}, {least.clk_hz / least.baud:.0f} clocks a bit"
        promise = shown(quantity, quantity.promise) if quantity.promise else "-"
        rows.append(row([quantity.title, shown(quantity, least.found), where, promise]))
    return "\n".join(rows)


def write(kept: dict) -> None:
    limits = [Limit(**one) for one in kept["limits"]]
    tables = [f"### {form}\n\n{table(limits, 'network', form)}" for form in ALL_FORMS]
    text = TEMPLATE.read_text().format(
        seed=kept["seed"],
        measured_on="card `{card}`, firmware `{firmware}` of firmware sources `{sources}`".format_map(kept),
        worst=worst(limits),
        tables="\n\n".join(tables),
        drive=table(limits, "drive", "8E1"),
        faults=len(faults(limits)),
        asked=f"{sum(one.asked for one in limits):,}",
        limits=len(limits),
    )
    asked = sum(one.asked for one in limits)
    said = f"{len(limits)} limits, {asked:,} characters; {len(faults(limits))} outside theory and LINE-5."
    of = {"standard card": kept["card"], "firmware": kept["sources"]}
    publish("line-quality", text, "make line-quality", of, said, keep=[""])


def faults(limits: list[Limit]) -> list[str]:
    return [fault for one in limits for fault in one.faults]


def main(arguments: list[str] | None = None) -> int:
    options = Parser(prog="line-quality", description=__doc__.splitlines()[0])
    what = options.add_mutually_exclusive_group()
    what.add_argument("--fast", action="store_true", help="the part that guards; writes nothing")
    what.add_argument("--report", action="store_true", help="write the page of the last whole run again")
    options.add_argument(
        "--seed", type=at_least(0), default=DEFAULT_SEED, help=f"of what is random ({DEFAULT_SEED})"
    )
    options.add_argument("--jobs", type=at_least(1), default=2, help="processes (2)")
    given = options.parse_args(arguments)
    try:
        if given.report:
            if not KEPT.exists():
                raise LineQualityError("there was no whole run; run `make line-quality`")
            kept = json.loads(KEPT.read_text())
        else:
            began = time.monotonic()
            limits = measure(list(FAST if given.fast else whole()), given.seed, given.jobs)
            print(f"seed {given.seed}, {time.monotonic() - began:.0f} s")
            kept = {
                "seed": given.seed,
                "card": fingerprint.card(),
                "firmware": fingerprint.firmware(),
                "sources": host.fingerprint(),
                "limits": [asdict(one) for one in limits],
            }
            if not given.fast:
                KEPT.parent.mkdir(parents=True, exist_ok=True)
                KEPT.write_text(json.dumps(kept, indent=1))
        if not given.fast:
            write(kept)
    except (LineQualityError, BuildError, SourcesError) as error:
        print(f"line-quality: {error}", file=sys.stderr)
        return 2
    limits = [Limit(**one) for one in kept["limits"]]
    for line, form in sorted({(one.line, one.form) for one in limits}):
        print(f"\n{line} line, {form}\n{table(limits, line, form)}")
    for fault in faults(limits):
        print(f"missed: {fault}")
    missed = len(faults(limits))
    print(f"\n{missed} missed" if missed else "\nall limits where they have to be")
    return 1 if missed else 0


if __name__ == "__main__":
    run_main("line-quality", main)
