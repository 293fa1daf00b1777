# SPDX-License-Identifier: Apache-2.0
"""Fuzzes the firmware in every dialect (sw/test/fuzz_gateway.c).

    python -m sw.test.fuzz [--runs N] [--seed N] [--jobs N] [--refresh] [--write]

Starts from the corpus in sw/test/corpus. Writes results.json and the inputs of findings into
build/fuzz-firmware; prints the command that repeats a finding. Exit 1 with a finding, 2 on an error.
"""

from __future__ import annotations

import json
import math
import random
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rtl.command import Parser, run_main, threads
from sw.test.host import DIALECTS, ROOT, put_figures
from tb.lib.bound import SURE, words
from tb.lib.options import at_least

FOLDER = ROOT / "build/fuzz-firmware"
CORPUS = ROOT / "sw/test/corpus"
LONG = 200_000  # runs, those of `make evidence`; shorter campaigns do not go into docs/evidence.json
OPTIONS = ["-max_len=256", "-len_control=20", "-timeout=10", "-print_final_stats=1"]
# The fewest inputs that take every branch once.
MERGE = ["-set_cover_merge=1", "-use_counters=0", "-use_cmp=0"]


@dataclass
class Result:
    dialect: str
    seed: int
    runs: int
    branches: int  # edges of the code that were seen
    seconds: float
    finding: str  # the input's file, or nothing
    says: str


def build(folder: Path, *variables: str, dialects: Sequence[str] = DIALECTS) -> subprocess.CompletedProcess:
    """Builds FOLDER/<dialect>/fuzz_gateway from the current sources."""
    goals = [f"{folder}/{dialect}/fuzz_gateway" for dialect in dialects]
    make = ["make", "-s", "-f", "sw/test/fuzz.mk", f"FUZZ_DIR={folder}"]
    return subprocess.run([*make, *variables, *goals], cwd=ROOT, capture_output=True, text=True, check=False)


def fuzz(folder: Path, dialect: str, runs: int, seed: int, work: Path | None = None) -> Result:
    """Runs one fuzzer of `folder`, starting from the corpus; findings go to `work` (default: `folder`)."""
    grown = (work or folder) / "grown" / dialect
    findings = (work or folder) / "findings"
    shutil.rmtree(grown, ignore_errors=True)
    for made in (grown, findings):
        made.mkdir(parents=True, exist_ok=True)
    command = [folder / dialect / "fuzz_gateway", *OPTIONS, f"-seed={seed}", f"-runs={runs}"]
    command += [f"-artifact_prefix={findings}/{dialect}-", grown, CORPUS]
    begun = time.monotonic()
    done = subprocess.run(
        list(map(str, command)), cwd=ROOT, capture_output=True, text=True, errors="replace", check=False
    )
    said = done.stderr
    units = re.search(r"stat::number_of_executed_units: +(\d+)", said)
    edges = re.findall(r"cov: (\d+)", said)
    finding = re.search(r"Test unit written to (\S+)", said)
    message = re.search(r".*(?:does not hold|runtime error|ERROR: \w+).*", said)
    if done.returncode and not finding:
        raise RuntimeError(f"{command[0]}: {said[-400:]}")
    return Result(
        dialect,
        seed,
        int(units[1]) if units else 0,
        int(edges[-1]) if edges else 0,
        round(time.monotonic() - begun, 1),
        finding[1] if finding else "",
        message[0].strip() if finding and message else "",
    )


def fuzz_all(folder: Path, runs: int, seed: int, jobs: int) -> list[Result]:
    share = math.ceil(runs / len(DIALECTS))
    with threads(jobs) as pool:
        started = [pool.submit(fuzz, folder, dialect, share, seed) for dialect in DIALECTS]
        return [one.result() for one in started]


def refresh(folder: Path) -> None:
    """Adds inputs to the corpus that take a branch for the first time."""
    for dialect in DIALECTS:
        merge = [folder / dialect / "fuzz_gateway", *MERGE, CORPUS, folder / "grown" / dialect]
        subprocess.run(list(map(str, merge)), cwd=ROOT, capture_output=True, check=True)


def summary(runs: int, findings: int) -> list[str]:
    """The block's last lines, with the bound beside the findings. libFuzzer's runs are no random choice."""
    return [
        f"{runs} runs, {findings} findings",
        f"Were the inputs a random choice, at most {words(findings, runs)} of all would find something, "
        f"at {SURE}.",
    ]


def main() -> int:
    parser = Parser(prog="fuzz-firmware", description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=at_least(1), default=LONG, help="of all dialects together")
    parser.add_argument("--seed", type=at_least(1), default=random.randrange(1, 1 << 31))
    parser.add_argument("--jobs", type=at_least(1), default=1, help="dialects at a time")
    parser.add_argument("--write", action="store_true", help=f"{LONG} runs or more: into docs/evidence.json")
    parser.add_argument("--refresh", action="store_true", help="add new branches to sw/test/corpus")
    given = parser.parse_args()
    made = build(FOLDER)
    if made.returncode:
        print(made.stderr, file=sys.stderr)
        return 2
    print(f"{given.runs} runs, seed {given.seed}", flush=True)
    results = fuzz_all(FOLDER, given.runs, given.seed, given.jobs)
    total = sum(result.runs for result in results)
    (FOLDER / "results.json").write_text(json.dumps([asdict(result) for result in results], indent=1) + "\n")
    shown = [
        f"{one.dialect:12}{one.runs:>10} runs{one.branches:>6} edges{one.seconds:>9} s" for one in results
    ]
    found = [result for result in results if result.finding]
    shown += summary(total, len(found))
    print("\n".join(shown))
    for result in found:
        print(f"FOUND  {result.says}")
        print(f"       {FOLDER / result.dialect}/fuzz_gateway {result.finding}")
    if given.write and not found and total >= LONG:
        text = "\n".join([f"{given.runs} runs, seed {given.seed}", *shown])
        put_figures("fuzzing", f"make fuzz-firmware RUNS={given.runs}", text)
    if given.refresh and not found:
        refresh(FOLDER)
    return 1 if found else 0


if __name__ == "__main__":
    run_main("fuzz-firmware", main)
