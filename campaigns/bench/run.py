# SPDX-License-Identifier: Apache-2.0
# needs: bench-card bench-tiny card drive | setup-test
"""Measures turnaround on the card's pins and writes build/reports/results.md (60 min); `make bench`.

    python -m campaigns.bench.run [--seed N] [--jobs N]     everything: writes build/reports/results.md
    python -m campaigns.bench.run --fast                    the part in `make test`: prints, writes nothing
    python -m campaigns.bench.run --only KIND               repeats one kind, keeps the rest of the last run
    python -m campaigns.bench.run --report                  rewrites the report from the last whole run

A whole run that was interrupted goes on with the pieces that are left (build/bench_pieces).
Exit 1 if a limit is missed, 2 if something to measure is missing or the last whole run was of another card,
firmware or bench than the tree. Measurements: campaigns/bench/cases.py.
"""

from __future__ import annotations

import hashlib
import pickle
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from campaigns.bench import fingerprint
from campaigns.bench.card import BenchError, Build
from campaigns.bench.judge import Outcome
from campaigns.bench.report import REPORT_TABLES, Image, Results, document, table
from campaigns.bench.work import KINDS_OF_WORK, Piece, fast, whole
from rtl.command import Parser, in_processes, run_main
from rtl.report_page import evidence, publish
from rtl.sources import ROOT, SourcesError
from sw.test import host
from sw.tools import stack

KEPT = ROOT / "build/bench_results.pickle"
ENDED = ROOT / "build/bench_pieces"
DEFAULT_SEED = 1


def _work(piece: Piece) -> tuple[Piece, Outcome]:
    return piece, piece.run()


def file_of_ended(results: Results) -> Path:
    """The pieces that have ended of a whole run with this seed, of this card, firmware and bench."""
    subject = repr((results.seed, sorted(results.fingerprint.items())))
    return ENDED / f"{hashlib.sha256(subject.encode()).hexdigest()[:12]}.pickle"


def ended(path: Path) -> Iterator[tuple[Piece, Outcome]]:
    """What an interrupted run has left. Its last piece may be cut off."""
    if not path.exists():
        return
    with path.open("rb") as file:
        while True:
            try:
                yield pickle.load(file)
            except (pickle.UnpicklingError, AttributeError, ImportError, EOFError, TypeError):
                return


def measured(pieces: list[Piece], jobs: int, keep: Path | None) -> Iterator[tuple[Piece, Outcome]]:
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
    began = time.monotonic()
    for done, (piece, outcome) in enumerate(measured(pieces, jobs, keep), 1):
        results.outcomes[piece.name] = (piece, outcome)
        if sys.stderr.isatty():
            print(f"\r{done}/{len(pieces)} {piece.name:30}", end="", file=sys.stderr)
        for fault in outcome.faults:
            print(f"missed: {fault}")
    if sys.stderr.isatty():
        print("\r" + 40 * " ", end="\r", file=sys.stderr)
    print(f"seed {results.seed}, {time.monotonic() - began:.0f} s")
    # In a fixed order, independent of the processes.
    results.outcomes = dict(sorted(results.outcomes.items()))


def measure_firmware(results: Results) -> None:
    for config in sorted({piece.build.config for piece, _ in results.outcomes.values()}):
        elf = Build(config).image_folder / "firmware.elf"
        results.images[config] = Image(*stack.sizes(elf), *stack.deepest(elf))


def write(results: Results) -> None:
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
