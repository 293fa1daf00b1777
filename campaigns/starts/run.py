# SPDX-License-Identifier: Apache-2.0
"""Starts the card from random register contents and by resets at any clock (COUNT=); `make starts`.

    python -m campaigns.starts.run [--config NAME] [--count STARTS] [--seed FIRST]

Each seed is one start of each kind (tb/lib/starts.py). The results of this card, firmware and judge are kept
in build/starts; a run that was stopped goes on where it was. Exit 0: every start was alive and left the image
as it was (SAFE-5); 1: at least one did not; 2: an invalid command line.
"""

from __future__ import annotations

import time
from pathlib import Path

from campaigns.bench import fingerprint
from rtl.command import Parser, run_main
from rtl.sources import ROOT, configurations
from tb.lib import starts
from tb.lib.options import at_least

FOLDER = ROOT / "build/starts"
COUNT = 1000
EVERY_S = 20  # between two lines of progress


def file_of(kind: str, config: str) -> Path:
    """The results of this very card and firmware, with this judge."""
    of = f"{fingerprint.card(config)}-{fingerprint.firmware(config)}-{fingerprint.starts()}"
    return FOLDER / f"{config}-{kind}-{of}.txt"


def results(path: Path) -> dict[int, str]:
    """Seed to how its start failed, empty if it was alive."""
    lines = path.read_text().splitlines() if path.exists() else []
    return {int(seed): trouble for seed, _, trouble in (line.partition(" ") for line in lines)}


def run(kind: str, config: str, seeds: range) -> dict[int, str]:
    """The results of these seeds, of which those that are missing are started now."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = file_of(kind, config)
    known = results(path)
    said = time.monotonic()
    with path.open("a") as file:
        for number, seed in enumerate(seeds):
            if seed not in known:
                known[seed] = starts.start(kind, config, seed)
                file.write(f"{seed} {known[seed]}".rstrip() + "\n")
                file.flush()
            if time.monotonic() - said > EVERY_S:
                said = time.monotonic()
                print(f"starts: {config}, {kind}: {number + 1} of {len(seeds)}", flush=True)
    return {seed: known[seed] for seed in seeds}


def main() -> int:
    parser = Parser(prog="starts", description=__doc__.splitlines()[0])
    parser.add_argument("--config", choices=list(configurations()), default="standard")
    parser.add_argument("--count", type=at_least(1), default=COUNT)
    parser.add_argument("--seed", type=at_least(0), default=0, help="the first one")
    options = parser.parse_args()
    wrong = 0
    for kind in starts.KINDS:
        found = run(kind, options.config, range(options.seed, options.seed + options.count))
        failed = {seed: trouble for seed, trouble in found.items() if trouble}
        wrong += len(failed)
        print(f"starts: {options.config}, {kind}: {len(failed)} of {len(found)} failed")
        for seed, trouble in failed.items():
            print(f"  seed {seed}: {trouble}")
    return int(wrong > 0)


if __name__ == "__main__":
    run_main("starts", main)
