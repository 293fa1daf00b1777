# SPDX-License-Identifier: Apache-2.0
"""Branch coverage of the firmware by its host tests, for each build.

Exit 1 for a line or branch of the core that no build covers.

Each dialect is measured alone, with its constants folded. `all` is the sum over dialects and build options.
Random tests are left out: a branch counts only if a scenario covers it, and the figure is repeatable.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from rtl.command import run_main
from sw.test.host import BUILDS, CORE, DIALECTS, RANDOM, ROOT, TESTS, compile_library, put_figures

FOLDER = ROOT / "build/coverage"
# Fold constants and drop the code that they exclude, but keep every && and || a branch of its own.
FLAGS = [
    *("-g", "-Og", "--coverage", "-ftree-vrp", "--param", "logical-op-non-short-circuit=0"),
    *(f"-fno-{name}" for name in ("inline", "early-inlining", "if-conversion", "if-conversion2", "ipa-cp")),
    *(f"-fno-{name}" for name in ("ipa-pure-const", "ipa-sra", "ssa-phiopt", "tree-pta")),
]
WIDTH = 12

Holes = dict[str, list[int]]
Counts = dict[str, tuple[int, int]]


def run(*command: str | Path, **variables: str) -> str:
    words, env = list(map(str, command)), os.environ | variables
    done = subprocess.run(words, cwd=ROOT, env=env, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def measure() -> None:
    shutil.rmtree(FOLDER, ignore_errors=True)
    for build in BUILDS:
        done = compile_library(build, FOLDER, *FLAGS)
        if done.returncode:
            sys.exit(done.stderr)
    pytest = [sys.executable, "-m", "pytest", "-q", "--all", "-p", "no:cacheprovider"]
    done = run(*pytest, "-k", f"not ({RANDOM})", *TESTS, FIRMWARE_LIBRARIES=str(FOLDER))
    print(done.splitlines()[-1])


def counted(folder: Path) -> tuple[Counts, Counts, Holes]:
    """Branches and lines of each file of the firmware, taken and in total, and lines not fully covered."""
    command = (sys.executable, "-m", "gcovr", "--json", "-", "-r", ROOT, "-f", "sw/src/", folder)
    report = json.loads(run(*command))
    branches, lines, holes = {}, {}, {}
    for file in report["files"]:
        name = Path(file["file"]).name
        code = file["lines"]
        taken = [branch["count"] > 0 for line in code for branch in line["branches"]]
        run_through = [line["count"] > 0 for line in code]
        branches[name] = sum(taken), len(taken)
        lines[name] = sum(run_through), len(run_through)
        holes[name] = [
            line["line_number"]
            for line in code
            if not line["count"] or not all(branch["count"] for branch in line["branches"])
        ]
    return branches, lines, holes


def table(columns: dict[str, tuple[Counts, Counts, Holes]]) -> str:
    files = sorted(columns["all"][0], key=lambda name: (name not in CORE, name))
    rows = ["branches taken".ljust(16) + "".join(f"{name:>{WIDTH}}" for name in columns)]
    for file in files:
        cells = [branches.get(file, (0, 0)) for branches, _, _ in columns.values()]
        if any(total for _, total in cells):
            mark = "" if file in CORE else "  (not of the core)"
            shown = "".join(f"{f'{taken} of {total}':>{WIDTH}}" for taken, total in cells)
            rows.append(file.ljust(16) + shown + mark)
    for title, wanted in (("core", True), ("the rest", False)):
        for index, kind in enumerate(("branches", "lines")):
            shares = [share(column[index], wanted) for column in columns.values()]
            cells = "".join(f"{100 * taken / total:{WIDTH - 2}.1f} %" for taken, total in shares)
            rows.append(f"{title}, {kind}".ljust(16) + cells)
    return "\n".join(rows)


def share(counts: Counts, core: bool) -> tuple[int, int]:
    chosen = [numbers for file, numbers in counts.items() if (file in CORE) == core]
    return sum(taken for taken, _ in chosen), sum(total for _, total in chosen)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    mode = parser.add_mutually_exclusive_group()
    mode.add_argument("--write", action="store_true", help="put the table into docs/evidence.json")
    mode.add_argument("--check", action="store_true", help="write nothing")
    options = parser.parse_args(arguments)
    measure()
    columns = {name: counted(FOLDER / name) for name in DIALECTS}
    columns["all"] = branches, lines, holes = counted(FOLDER)
    print(f"\n{table(columns)}")
    for file, numbers in holes.items():
        if numbers:
            print(f"hole  {file}: line {', '.join(map(str, numbers))}")
    if any(taken != total for taken, total in (share(branches, True), share(lines, True))):
        print("the host tests leave holes in the translation core", file=sys.stderr)
        return 1
    if options.write:
        put_figures("branches", "make coverage-firmware", table(columns))
    return 0


if __name__ == "__main__":
    run_main("coverage-firmware", main)
