# SPDX-License-Identifier: Apache-2.0
"""Measures the card on its pins and prints the results.

    python -m campaigns.bench.run [--seed N] [--jobs N]     everything: writes build/reports/results.md and
    build/pictures/*.svg
    python -m campaigns.bench.run --fast                    the part in `make test`: prints, writes nothing
    python -m campaigns.bench.run --only KIND               repeats one kind, keeps the rest of the last run
    python -m campaigns.bench.run --report                  rewrites the report from the last whole run

A whole run that was interrupted goes on with the pieces that are left (build/bench_pieces).
Exit 1 if a limit is missed, 2 if something to measure is missing or the last whole run was of another card,
firmware or bench than the tree. Measurements: campaigns/bench/cases.py.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

from campaigns.bench import fingerprint
from campaigns.bench.card import BenchError, Build
from campaigns.bench.judge import Outcome
from campaigns.bench.report import REPORT_TABLES, Image, Results, document, table
from campaigns.bench.wave import CLK_HZ
from campaigns.bench.work import KINDS_OF_WORK, Piece, fast, whole
from rtl.command import Parser, in_processes, run_main
from rtl.report_page import evidence, publish
from rtl.sources import ROOT, SourcesError
from sw.test import host
from sw.tools import stack
from tb.lib import runner

KEPT = ROOT / "build/bench_results.pickle"
ENDED = ROOT / "build/bench_pieces"
DEFAULT_SEED = 1
VIRTUAL_CARD = ROOT / "build/card"
VIRTUAL_CARD_S = 5


def _work(piece: Piece) -> tuple[Piece, Outcome, float]:
    began = time.process_time()
    return piece, piece.run(), time.process_time() - began


def file_of_ended(results: Results) -> Path:
    """The pieces that have ended of a whole run with this seed, of this card, firmware and bench."""
    subject = repr((results.seed, sorted(results.fingerprint.items())))
    return ENDED / f"{hashlib.sha256(subject.encode()).hexdigest()[:12]}.pickle"


def ended(path: Path) -> Iterator[tuple[Piece, Outcome, float]]:
    """What an interrupted run has left. Its last piece may be cut off."""
    if not path.exists():
        return
    with path.open("rb") as file:
        while True:
            try:
                yield pickle.load(file)
            except (pickle.UnpicklingError, AttributeError, ImportError, EOFError, TypeError):
                return


def measured(pieces: list[Piece], jobs: int, keep: Path | None) -> Iterator[tuple[Piece, Outcome, float]]:
    """The pieces with their outcomes; those of an interrupted run first. `keep`: gets each that ends."""
    found = {result[0].name: result for result in ended(keep)} if keep else {}
    found = {piece.name: found[piece.name] for piece in pieces if piece.name in found}
    yield from found.values()
    if keep:
        # Written anew, because a piece that was cut off would hide all after it.
        keep.parent.mkdir(parents=True, exist_ok=True)
        keep.write_bytes(b"".join(map(pickle.dumps, found.values())))
    for result in in_processes(jobs, _work, [piece for piece in pieces if piece.name not in found]):
        if keep:
            with keep.open("ab") as file:
                file.write(pickle.dumps(result))
        yield result


def measure(pieces: list[Piece], jobs: int, results: Results, keep: Path | None = None) -> None:
    """Runs the pieces, the longest first, and reports each one's end."""
    pieces = sorted(pieces, key=lambda piece: -piece.cost)
    simulated = used = 0.0
    began = time.monotonic()
    for done, (piece, outcome, seconds) in enumerate(measured(pieces, jobs, keep), 1):
        results.outcomes[piece.name] = (piece, outcome)
        simulated += outcome.simulated_s
        used += seconds
        if sys.stderr.isatty():
            print(f"\r{done}/{len(pieces)} {piece.name:30}", end="", file=sys.stderr)
        for fault in outcome.faults:
            print(f"missed: {fault}")
    if sys.stderr.isatty():
        print("\r" + 40 * " ", end="\r", file=sys.stderr)
    print(f"seed {results.seed}, {time.monotonic() - began:.0f} s")
    # In a fixed order, independent of the processes.
    results.outcomes = dict(sorted(results.outcomes.items()))
    results.speeds["measuring bench"] = simulated / used


def measure_firmware(results: Results) -> None:
    for config in sorted({piece.build.config for piece, _ in results.outcomes.values()}):
        elf = Build(config).image_folder / "firmware.elf"
        results.images[config] = Image(*stack.sizes(elf), *stack.deepest(elf))


def virtual_card_speed() -> tuple[float, int]:
    """Possible speed of one core as reported by build/card, and its clock."""
    with tempfile.TemporaryDirectory() as folder:
        command = [
            VIRTUAL_CARD,
            "--speed",
            "max",
            "--for",
            str(VIRTUAL_CARD_S),
            "--modbus",
            f"{folder}/modbus",
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    return float(re.search(r"one core can do ([\d.]+)", done.stdout)[1]), virtual_card_clk_hz()


def virtual_card_clk_hz() -> int:
    """Clock of build/card; its build leaves a file named after CARD_CLK_HZ (sim/card/card.mk)."""
    clocks = sorted((ROOT / "build/card_objects").glob("clk_*"), key=lambda path: path.stat().st_mtime)
    return int(clocks[-1].name.removeprefix("clk_")) if clocks else 0


def cocotb_speed(sim: str) -> float:
    """The idle whole card under cocotb, at its own clock."""
    name = f"bench.cocotb_speed-{sim}"
    os.environ["PYTEST_CURRENT_TEST"] = f"bench.py::cocotb_speed-{sim} (call)"
    os.environ.update(COCOTB_LOG_LEVEL="ERROR", GPI_LOG_LEVEL="ERROR")
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    runner.run("rtu2fc", "campaigns.bench.cocotb_speed", sim=sim, parameters={"CLK_HZ": CLK_HZ})
    results = ElementTree.parse(ROOT / "build/tests" / name / "results.xml")
    case = next(results.iter("testcase"))
    values = {item.get("name"): item.get("value") for item in case.iter("property")}
    return float(values["sim_time_ratio"]) * 1e-9


def measure_simulations(results: Results) -> None:
    results.speeds["virtual card"], results.card_clk_hz = virtual_card_speed()
    for sim in ("verilator", "icarus"):
        results.speeds[f"cocotb on {sim}"] = cocotb_speed(sim)


def write(results: Results) -> None:
    from campaigns.bench import pictures as bench_pictures  # delays the slow import of matplotlib

    bench_pictures.draw(results)
    publish("results", document(results), "make bench", of_report(results.fingerprint), keep=REPORT_TABLES)


def last_run(of: dict[str, str]) -> Results:
    """Results of the last whole run, if it was a run of this tree."""
    name = KEPT.relative_to(ROOT) if KEPT.is_relative_to(ROOT) else KEPT.name
    if not KEPT.exists():
        raise BenchError(f"{name} is missing: there was no whole run; run `make bench`")
    try:
        results = pickle.loads(KEPT.read_bytes())
        other = fingerprint.difference(results.fingerprint, of)
    except (pickle.UnpicklingError, AttributeError, ImportError, EOFError, TypeError):
        raise BenchError(f"{name} comes from another bench; run `make bench`") from None
    if other:
        raise BenchError(f"{name} comes from another {' and another '.join(other)}; run `make bench`")
    return results


def of_report(tree: dict[str, str]) -> dict[str, str]:
    """What was measured, by the names of docs/evidence.json."""
    cards = {"standard card": tree["card"], "tiny card": tree.get("tiny card", "")}
    return cards | {"firmware": host.fingerprint(), "bench": tree["bench"]}


def of_this_tree(tree: dict[str, str]) -> str:
    """Whether docs/evidence.json still has the figures of what was measured now."""
    if other := fingerprint.difference(evidence().get("results", {}).get("of", {}), of_report(tree)):
        names = " and another ".join(other)
        return f"note: the figures of docs/evidence.json are of another {names}; `make bench` renews them"
    return "the figures of docs/evidence.json are of this card, firmware and bench"


def main(arguments: list[str] | None = None) -> int:
    options = Parser(prog="bench", description="Measures the card on its pins.")
    what = options.add_mutually_exclusive_group()
    what.add_argument("--fast", action="store_true", help="the part that guards; writes nothing")
    what.add_argument("--report", action="store_true", help="write the report of the last whole run again")
    what.add_argument("--only", metavar="KIND", choices=KINDS_OF_WORK, help=", ".join(KINDS_OF_WORK))
    options.add_argument("--seed", type=int, help=f"not with --only, --report ({DEFAULT_SEED})")
    options.add_argument("--jobs", type=int, default=2, help="processes (2)")
    given = options.parse_args(arguments)
    again = given.report or given.only
    if again and given.seed is not None:
        options.error("the last whole run has a seed already")
    try:
        tree = fingerprint.tree()
        seed = DEFAULT_SEED if given.seed is None else given.seed
        results = last_run(tree) if again else Results(seed, tree)
        if not (given.fast or again or VIRTUAL_CARD.exists()):
            raise BenchError(f"{VIRTUAL_CARD.relative_to(ROOT)} is missing; run `make card`")
        if not given.report:
            pieces = list((fast if given.fast else whole)(results.seed))
            keep = None if given.fast or given.only else file_of_ended(results)
            measure([p for p in pieces if given.only in (None, p.kind)], given.jobs, results, keep)
            measure_firmware(results)
            if other := fingerprint.difference(tree, fingerprint.tree()):
                raise BenchError(f"the {' and the '.join(other)} changed meanwhile; run `make bench`")
        if not (given.fast or given.report):
            KEPT.write_bytes(pickle.dumps(results))
        if not (given.fast or again):
            measure_simulations(results)
            KEPT.write_bytes(pickle.dumps(results))
            file_of_ended(results).unlink()
    except (BenchError, SourcesError, stack.StackError, FileNotFoundError) as error:
        print(f"bench: {error}", file=sys.stderr)
        return 2
    print(table(results))
    if given.fast:
        print(of_this_tree(tree))
    else:
        write(results)
    missed = results.faults()
    print(f"{len(missed)} missed" if missed else "all limits met")
    return 1 if missed else 0


if __name__ == "__main__":
    run_main("bench", main)
