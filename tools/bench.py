# SPDX-License-Identifier: Apache-2.0
"""Measures the card on its pins and prints the table.

    python -m tools.bench [--seed N] [--jobs N]     everything: writes docs/results.md and docs/pictures/*.svg
    python -m tools.bench --fast                    what `make test` runs too: prints, writes nothing
    python -m tools.bench --only KIND               measures one kind again; the rest: last whole run
    python -m tools.bench --report                  writes the report of the last whole run again

Exit 1 when a limit is missed, 2 when something to measure is missing. What is measured: sim/bench/cases.py.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import pickle
import re
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from sim.bench.card import CLK_HZ, BenchError
from sim.bench.cases import Outcome
from sim.bench.work import Piece, fast, whole
from tb.lib import runner
from tools import stack
from tools.bench_report import Results, table, write
from tools.sources import ROOT

KEPT = ROOT / "build/bench_card/results.pickle"
DEFAULT_SEED = 1
VIRTUAL_CARD = ROOT / "build/card"
VIRTUAL_CARD_S = 5


def _work(piece: Piece) -> tuple[Piece, Outcome, float]:
    began = time.process_time()
    return piece, piece.run(), time.process_time() - began


def measure(pieces: list[Piece], jobs: int, results: Results) -> None:
    """The long pieces first; each tells when it is done."""
    pieces = sorted(pieces, key=lambda piece: -piece.cost)
    simulated = used = 0.0
    began = time.monotonic()
    with multiprocessing.Pool(jobs) as pool:
        for done, (piece, outcome, seconds) in enumerate(pool.imap_unordered(_work, pieces), 1):
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
    # In an order of its own, however the processes took turns.
    results.outcomes = dict(sorted(results.outcomes.items()))
    results.speeds["measuring bench"] = simulated / used


def measure_firmware(results: Results) -> None:
    results.code_bytes, results.data_bytes = stack.sizes()
    results.stack_bytes, results.stack_path = stack.deepest()


def virtual_card_speed() -> float:
    """What one core can do, as build/card says itself."""
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
    return float(re.search(r"one core can do ([\d.]+)", done.stdout)[1])


def cocotb_speed(sim: str) -> float:
    """The whole card under cocotb, idle, at its own clock."""
    name = f"bench.cocotb_speed-{sim}"
    os.environ["PYTEST_CURRENT_TEST"] = f"bench.py::cocotb_speed-{sim} (call)"
    os.environ.update(COCOTB_LOG_LEVEL="ERROR", GPI_LOG_LEVEL="ERROR")
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    runner.run("rtu2fc", "sim.bench.cocotb_speed", sim=sim, parameters={"CLK_HZ": CLK_HZ})
    results = ElementTree.parse(ROOT / "build/tests" / name / "results.xml")
    case = next(results.iter("testcase"))
    values = {item.get("name"): item.get("value") for item in case.iter("property")}
    return float(values["sim_time_ratio"]) * 1e-9


def measure_simulations(results: Results) -> None:
    results.speeds["virtual card"] = virtual_card_speed()
    for sim in ("verilator", "icarus"):
        results.speeds[f"cocotb on {sim}"] = cocotb_speed(sim)


def main() -> int:
    options = argparse.ArgumentParser(description="Measures the card on its pins.")
    options.add_argument("--fast", action="store_true", help="the part that guards; writes nothing")
    options.add_argument("--report", action="store_true", help="write the report of the last whole run again")
    options.add_argument("--only", metavar="KIND", help="early, late, gate, overtaken, random or conformance")
    options.add_argument("--seed", type=int, default=DEFAULT_SEED)
    options.add_argument("--jobs", type=int, default=2, help="processes (2)")
    given = options.parse_args()
    try:
        again = given.report or given.only
        results = pickle.loads(KEPT.read_bytes()) if again else Results(given.seed)
        if not given.report:
            pieces = list((fast if given.fast else whole)(results.seed))
            measure([p for p in pieces if given.only in (None, p.kind)], given.jobs, results)
            measure_firmware(results)
        if not (given.fast or again):
            measure_simulations(results)
        if not (given.fast or given.report):
            KEPT.write_bytes(pickle.dumps(results))
    except (BenchError, stack.StackError, FileNotFoundError) as error:
        print(f"bench: {error}", file=sys.stderr)
        return 2
    print(table(results))
    if not given.fast:
        write(results)
    missed = results.faults()
    print(f"{len(missed)} missed" if missed else "all limits met")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
