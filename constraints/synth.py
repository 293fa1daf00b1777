# SPDX-License-Identifier: Apache-2.0
"""Turns a board into a bitstream: synthesis, place and route, timing, packing; one line of figures a board.

    python -m constraints.synth [BOARD...]     default: all of them, and build/reports/synthesis.md

All files go to build/synth/BOARD. The finished design holds a random pattern in place of the firmware;
constraints/image.py inserts an image without another place and route. Exit 1 if a board does not fit its part
or is slower than MARGIN times its clock, or if the front end has more cells than TARGETS; 2 for an unknown
board.
"""

from __future__ import annotations

import hashlib
import json
import re
import resource
import sys
from pathlib import Path

from constraints import flow, image, parts
from constraints.boards import Board, board, boards, problems
from rtl.command import Parser, in_processes, run_main
from rtl.report_page import publish
from rtl.sources import ROOT, SourcesError, card_files, configurations

RESULTS = flow.BUILD / "results.json"
TEMPLATE = ROOT / "constraints/synthesis.md.in"
# Ratio of Fmax to the board's clock.
MARGIN = 1.5
BOARD, PART = "board", "part"


def route(entry: Board, folder: Path) -> tuple[int, dict]:
    """Returns the first seed with a routed design in time, and its report."""
    needed = MARGIN * entry.clk_hz / 1e6
    for seed in entry.seeds:
        try:
            report = flow.place_and_route(entry, folder, entry.top, seed)
        except flow.NoSeedHelps as error:
            raise flow.NoSeedHelps(f"{entry.name}: {error}") from None
        except flow.SynthError as error:
            print(f"{entry.name}: seed {seed}: {error}", flush=True)
            continue
        design = folder / f"{entry.top}{flow.suffix(entry)}"
        if stuck := flow.frozen(design.read_text()):
            design.unlink()
            raise flow.SynthError(f"{entry.name}: the flip-flops of {stuck} slices are never clocked")
        if flow.fmax_mhz(report) >= needed:
            return seed, report
        design.unlink()
        print(
            f"{entry.name}: seed {seed}: {flow.fmax_mhz(report):.1f} MHz are less than {needed:g}", flush=True
        )
    raise flow.SynthError(
        f"{entry.name}: no seed of {', '.join(map(str, entry.seeds))} gave a design in time"
    )


def cpu_seconds() -> float:
    """CPU time of the tools so far. A busy machine does not change it much."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def build(entry: Board) -> dict:
    """Builds a board from Verilog to bitstream; returns its figures."""
    folder = flow.BUILD / entry.name
    folder.mkdir(parents=True, exist_ok=True)
    begin = cpu_seconds()
    # Remove results of an earlier build, so that a failed build leaves none.
    for old in (*folder.glob(f"{entry.top}.*"), *folder.glob("image.*"), *folder.glob("firmware.*")):
        old.unlink()
    sources = flow.made_from(entry)
    flow.pattern_file(entry).write_text(flow.pattern(entry.memory_words))
    counted = flow.synthesise(entry, folder, flow.pattern_file(entry), entry.top)
    seed, report = route(entry, folder)
    fmax = flow.fmax_mhz(report)
    used, there = (
        {kind: row[what] for kind, row in report["utilization"].items()} for what in ("used", "available")
    )
    flow.made_from_file(entry).write_text(f"{sources}\n")
    output = image.make(entry, entry.firmware, folder / f"firmware{image.result_suffix(entry)}")
    return {
        "config": entry.config,
        "part": entry.part,
        "lut4": sum(n for cell, n in counted.items() if re.fullmatch(r"SB_LUT4|LUT[1-4]", cell)),
        "ff": sum(n for cell, n in counted.items() if cell.startswith(("SB_DFF", "TRELLIS_FF", "DFF"))),
        "cells": flow.cells(used, entry.family),
        "cells_of": entry.cells or there[next(iter(flow.CELLS[entry.family]))],
        "brams": used[flow.BRAMS[entry.family]],
        "brams_of": entry.brams or there[flow.BRAMS[entry.family]],
        "fmax_mhz": round(fmax, 2),
        "clk_mhz": entry.clk_hz / 1e6,
        "seed": seed,
        "seconds": round(cpu_seconds() - begin),
        "files": [str(path.relative_to(ROOT)) for path in image.results(entry, output)],
    }


def line(name: str, row: dict) -> str:
    share = 100 * row["cells"] / row["cells_of"]
    return (
        f"{name:<14} {row['lut4']:>5} LUT4 {row['ff']:>5} FF"
        f" {row['brams']:>3} of {row['brams_of']} block RAMs"
        f" {row['cells']:>5} of {row['cells_of']} cells ({share:.1f} %)"
        f" {row['fmax_mhz']:>6.1f} MHz for {row['clk_mhz']:g} ({row['fmax_mhz'] / row['clk_mhz']:.2f} x)"
        f"  seed {row['seed']}  {row['seconds']} s"
    )


def too_big(name: str, row: dict) -> list[str]:
    """Checks capacity by the data sheet's figures, which boards.toml has."""
    return [
        f"{name}: {row[what]} {what}, but a {row['part']} has {row[f'{what}_of']}"
        for what in ("cells", "brams")
        if row[what] > row[f"{what}_of"]
    ]


# ---------------------------------------------------------------- build/reports/synthesis.md


def measured_from() -> str:
    """Hash of the design that the figures describe; a pattern replaces the firmware."""
    content = hashlib.sha256()
    files = dict.fromkeys(path for config in configurations() for path in card_files(config))
    for entry in boards().values():
        files |= dict.fromkeys((entry.wrapper, entry.pin_file))
    for path in files:
        content.update(flow.bare(path))
    modules = [(*part, sorted(stay)) for *part, stay in parts.PARTS]
    rows = [[*flow.row(entry), entry.cells, entry.brams, entry.seeds] for entry in boards().values()]
    content.update(repr([rows, flow.SYNTHESIS, parts.PLAIN, modules, flow.tool_versions()]).encode())
    return content.hexdigest()[:16]


def board_row(name: str, row: dict) -> str:
    cells = f"{row['cells']} of {row['cells_of']} | {100 * row['cells'] / row['cells_of']:.0f} %"
    ratio = row["fmax_mhz"] / row["clk_mhz"]
    return (
        f"| `{name}` | {row['part']} | `{row['config']}` | {row['lut4']} | {row['ff']} | {cells}"
        f" | {row['brams']} of {row['brams_of']} | {row['fmax_mhz']:.1f} | {row['clk_mhz']:g} | {ratio:.1f}"
        f" | {row['seed']} | {row['seconds']} |"
    )


def write_docs(results: dict) -> None:
    text = TEMPLATE.read_text()
    text = text.replace("{boards}", "\n".join(board_row(*item) for item in results["boards"].items()))
    text = text.replace("{design}", measured_from())
    text = text.replace("{parts}", "\n".join(parts.part_row(*item) for item in results["parts"].items()))
    slowest = min(row["fmax_mhz"] / row["clk_mhz"] for row in results["boards"].values())
    said = f"{len(results['boards'])} boards; each fits and reaches {slowest:.2f} times its clock at least."
    RESULTS.write_text(json.dumps(results, indent=1) + "\n")
    publish("synthesis", text, "make synth", {"design": measured_from()}, said, ["", "Share of each part"])


def built(entry: Board) -> tuple[dict, list[str]]:
    """In a worker: the figures of a board, and what is wrong with it."""
    try:
        if said := problems(entry):
            return {}, said
        flow.try_pins(entry, flow.BUILD / entry.name)
        row = build(entry)
    except (flow.SynthError, SourcesError, image.ImageError) as error:
        return {}, [str(error)]
    return row, too_big(entry.name, row)


def done(task: tuple) -> tuple[tuple, object]:
    """In a worker: a board, or a part of the card by one flow."""
    what, *about = task
    return task, (built if what == BOARD else parts.count_part)(*about)


def main() -> int:
    parser = Parser(prog="synth", description=__doc__.splitlines()[0])
    parser.add_argument("boards", nargs="*", metavar="BOARD")
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    try:
        chosen = [board(name) for name in args.boards] or list(boards().values())
    except SourcesError as error:
        print(error, file=sys.stderr)
        return 2
    tasks = [(BOARD, entry) for entry in chosen]
    tasks += [(PART, *count) for count in parts.counts()] if not args.boards else []
    found, wrong = {}, []
    for task, outcome in in_processes(args.jobs, done, tasks):
        if task[0] == PART:
            found[task[1:4]] = outcome
            continue
        name, (row, said) = task[1].name, outcome
        wrong += said
        if row:
            found[name] = row
            print("\n".join([line(name, row), *(f"{'':<14} {file}" for file in row["files"])]), flush=True)
    if not args.boards:
        rows = parts.rows(found)
        wrong += parts.over_target(rows[parts.FRONT_END])
        if not wrong:
            write_docs({"boards": {entry.name: found[entry.name] for entry in chosen}, "parts": rows})
    for text in wrong:
        print(f"synth: {text}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    run_main("synth", main, flow.SynthError)
