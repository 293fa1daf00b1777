#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Flips single bits of the running card and tells what became of each; `make flips`.

    python -m tools.flips [--seed N] [--count FLIPS] [--baud RATE]  # a shard: build/fuzz/flips-SEED.json
    python -m tools.flips --report                                  # all shards as one table
    python -m tools.flips --trial SEED/NUMBER [--baud RATE]         # one flip, and what was on the lines

A shard is stateless: the same seed, count and rate flip the same bits anywhere. Exit 0: no telegram with
control word bit 10 = 1 that was not asked for (SAFE-4); 1: there was one; 2: a bad call or a missing tool.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import time
from collections import Counter
from pathlib import Path

from sim.fuzz.flips import BAUDS, DANGEROUS, OUTCOMES, PARTS, Places, trial
from sim.fuzz.library import BuildError
from sim.fuzz.registers import RegistersError
from tools.fuzz import FOLDER, story

# Those that the report lists one by one.
NOTABLE = (*OUTCOMES[: OUTCOMES.index("driver stuck") + 1], "wrong reply", "silent for good")


class FlipsError(Exception):
    """One line that tells the user what is wrong."""


def shard(seed: int, count: int, places: Places) -> dict:
    """What became of `count` flips: how many of each part ended how, and those to look at."""
    began, counts, notable = time.monotonic(), Counter(), []
    for number in range(count):
        outcome, *_ = trial(f"{seed}/{number}", places)
        counts[f"{outcome.flip.part}: {outcome.what}"] += 1
        if outcome.what in NOTABLE:
            notable.append(
                {
                    "trial": f"{seed}/{number}",
                    "flip": str(outcome.flip),
                    "what": outcome.what,
                    "why": outcome.why,
                }
            )
            if outcome.what in DANGEROUS:
                print(f"flips: {seed}/{number} {outcome.flip}: {outcome.what}: {outcome.why}", flush=True)
    bits = {part: places.bits(part) for part in PARTS}
    wall = time.monotonic() - began
    return {
        "seed": seed,
        "baud": places.baud,
        "flips": count,
        "bits": bits,
        "counts": dict(counts),
        "notable": notable,
        "wall_s": wall,
    }


def merge(results: list[dict]) -> dict:
    results = list({result["seed"]: result for result in results}.values())
    return {
        "shards": len(results),
        "flips": sum(result["flips"] for result in results),
        "bits": results[0]["bits"],
        "counts": sum((Counter(result["counts"]) for result in results), Counter()),
        "notable": [entry for result in results for entry in result["notable"]],
        "wall_s": sum(result["wall_s"] for result in results),
    }


def report(merged: dict) -> str:
    """A table: what became of the flips, by part."""
    parts = [part for part in PARTS if merged["bits"][part]]
    lines = [f"{merged['flips']} flips in {merged['wall_s']:.0f} s", ""]
    lines.append("| became | " + " | ".join(parts) + " | all |")
    lines.append("|---|" + "---|" * (len(parts) + 1))
    for what in OUTCOMES:
        row = [merged["counts"].get(f"{part}: {what}", 0) for part in parts]
        lines.append(f"| {what} | " + " | ".join(map(str, [*row, sum(row)])) + " |")
    flips = [sum(n for k, n in merged["counts"].items() if k.startswith(f"{part}: ")) for part in parts]
    lines.append("| flips | " + " | ".join(map(str, [*flips, sum(flips)])) + " |")
    lines.append("| bits there | " + " | ".join(str(merged["bits"][part]) for part in parts) + " | |")
    lines += [f"{e['trial']}: {e['flip']}: {e['what']}: {e['why']}" for e in merged["notable"]]
    return "\n".join(lines)


def load(folder: Path) -> list[dict]:
    files = sorted(folder.glob("flips-*.json"))
    if not files:
        raise FlipsError("no results of flips; run `make flips` first")
    try:
        return [json.loads(path.read_text()) for path in files]
    except ValueError as error:
        raise FlipsError(f"a file flips-*.json in {folder} is no result") from error


def tell(name: str, baud: int) -> int:
    outcome, case, played, verdict = trial(name, Places(baud=baud))
    print(f"{outcome.flip} ({outcome.flip.part}): {outcome.what}: {outcome.why}")
    print("\n".join(story(case, played, verdict)))
    return int(outcome.what in DANGEROUS)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 31))
    parser.add_argument("--count", type=int, default=500, help="flips")
    parser.add_argument("--baud", type=int, default=BAUDS[0], choices=BAUDS, help="network line")
    parser.add_argument("--report", action="store_true", help="merge the results of all shards")
    parser.add_argument("--trial", metavar="SEED/NUMBER", help="one flip again, told")
    options = parser.parse_args()
    if options.trial:
        return tell(options.trial, options.baud)
    if options.report:
        merged = merge(load(FOLDER))
        print(report(merged))
    else:
        print(f"flips: seed {options.seed}, {options.count} flips at {options.baud} bit/s", flush=True)
        result = shard(options.seed, options.count, Places(baud=options.baud))
        FOLDER.mkdir(parents=True, exist_ok=True)
        (FOLDER / f"flips-{options.seed}.json").write_text(json.dumps(result, indent=1) + "\n")
        merged = merge([result])
        print(report(merged))
    return int(any(entry["what"] in DANGEROUS for entry in merged["notable"]))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (BuildError, RegistersError, FlipsError) as error:
        print(f"flips: {error}", file=sys.stderr)
        sys.exit(2)
