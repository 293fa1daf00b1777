# SPDX-License-Identifier: Apache-2.0
"""Lines, branches and toggles of rtl/ that the tests run, counted by Verilator; `make coverage-rtl`.

    python -m campaigns.coverage.run [--jobs N]    runs the tests of TESTS, writes build/reports/coverage.md
    python -m campaigns.coverage.run --report      writes the page from the counts of the last run

campaigns/coverage/holes.toml must explain every line and branch that no test took, and every explanation must
have such a hole. Exit 1 for a hole without explanation, an explanation without hole, a failed test, or less
than 98 % of lines or branches; 2 if there is nothing to count.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from campaigns.bench import fingerprint
from rtl.command import Parser, run_main
from rtl.report_page import publish
from rtl.sources import ROOT, bench_file, rtl_files
from sw.test import host
from tb.lib.options import at_least

COUNTS = ROOT / "build/coverage_rtl"
TEMPLATE = ROOT / "campaigns/coverage/coverage.md.in"
EXPLAINED = ROOT / "campaigns/coverage/holes.toml"
# The Verilog of the card: written by hand, and by `make regs`.
FOLDERS = ("rtl/", "regs/generated/")
LEAST = 0.98
# The whole card, tested at its pins, besides each module's own tests.
WHOLE_CARD = ("rtu2fc", "rtu2fc_dialects")
# A fixed seed gives fixed counts.
VARIABLES = {"RTL_COVERAGE": str(COUNTS), "COCOTB_RANDOM_SEED": "1"}
# Verilator's names of branch ways; all other points are blocks.
WAYS = ("if", "else", "elsif", "case", "cond_then", "cond_else")
POINT = re.compile(r"C '(.*)' (\d+)$")


class CoverageError(Exception):
    """Error for the user, in one line."""


@dataclass
class Module:
    """Counts of one file by place, merged over tests, instances and parameters."""

    lines: Counter = field(default_factory=Counter)  # line
    branches: Counter = field(default_factory=Counter)  # line, column, way
    toggles: Counter = field(default_factory=Counter)  # line, column, edge of a bit

    @property
    def counters(self) -> dict[str, Counter]:
        return {"lines": self.lines, "branches": self.branches, "toggles": self.toggles}


@dataclass(frozen=True)
class Hole:
    """An uncovered place. `code` is the source line without indent: it keeps its name when lines move."""

    file: str
    line: int
    code: str
    way: str  # way of a branch; empty for a line

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.way or 'line'}: {self.code}"


def benches() -> list[str]:
    """The bench of each module of rtl/, and those of the whole card."""
    modules = [path.stem for path in rtl_files()]
    names = [*modules, *(name for name in WHOLE_CARD if name not in modules)]
    return [str(file) for file in map(bench_file, names) if file]


def run(jobs: int) -> bool:
    """Runs the tests with counters; returns whether all passed."""
    shutil.rmtree(COUNTS, ignore_errors=True)
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "--sim=verilator",
        "-p",
        "no:cacheprovider",
    ]
    command += ["-n", str(jobs), *benches()]
    return subprocess.run(command, cwd=ROOT, env=os.environ | VARIABLES, check=False).returncode == 0


def _lines(ranges: str) -> Iterable[int]:
    """Line numbers of `101-105,134`."""
    for part in ranges.split(","):
        first, _, last = part.partition("-")
        yield from range(int(first), int(last or first) + 1)


def count(texts: Iterable[str], root: Path = ROOT) -> dict[str, Module]:
    """Merges counts by file of the card. Verilator's Python package lacks its tool for that."""
    found: dict[str, Module] = defaultdict(Module)
    for text in texts:
        for line in text.splitlines():
            if not (point := POINT.match(line)):
                continue
            key = dict(item.split("\x02", 1) for item in point[1].split("\x01") if item)
            file = key["f"].removeprefix(f"{root}/")
            if not file.startswith(FOLDERS):
                continue
            module = found[file]
            number, hits = int(key["l"]), int(point[2])
            if key["t"] == "toggle":
                module.toggles[number, key["n"], key["o"]] += hits
                continue
            for covered in _lines(key["S"]) if "S" in key else ():
                module.lines[covered] += hits
            if key["o"] in WAYS:
                module.branches[number, key["n"], key["o"]] += hits
    return dict(sorted(found.items(), key=lambda item: Path(item[0]).stem))


def holes(found: dict[str, Module], root: Path = ROOT) -> list[Hole]:
    gaps = []
    for file, module in found.items():
        source = (root / file).read_text().splitlines()
        spots = [(line, "") for line, hits in module.lines.items() if not hits]
        spots += [(line, way) for (line, _, way), hits in module.branches.items() if not hits]
        # An untaken branch also has unrun lines: report it once.
        branch_lines = {line for line, way in spots if way}
        gaps += [
            Hole(file, line, source[line - 1].strip(), way)
            for line, way in sorted(set(spots))
            if way or line not in branch_lines
        ]
    return gaps


def explanations() -> list[dict[str, str]]:
    return tomllib.loads(EXPLAINED.read_text()).get("hole", [])


def compare(gaps: list[Hole], explained: list[dict[str, str]]) -> tuple[list[str], dict[Hole, str]]:
    """Mismatches of holes and explanations, and the reason for each explained hole."""
    reasons: dict[Hole, str] = {}
    wrong = []
    for entry in explained:
        of = [gap for gap in gaps if gap.file == entry["file"] and gap.code == entry["code"]]
        of = [gap for gap in of if gap.way in entry["ways"]]
        missing = set(entry["ways"]) - {gap.way for gap in of}
        wrong += [
            f"explained but taken: {entry['file']}: {way or 'line'}: {entry['code']}"
            for way in sorted(missing)
        ]
        reasons |= dict.fromkeys(of, entry["why"])
    wrong += [f"not explained: {gap}" for gap in gaps if gap not in reasons]
    return wrong, reasons


def share(counters: Iterable[Counter]) -> tuple[int, int]:
    """Number taken, and number in all."""
    hits = [value for counter in counters for value in counter.values()]
    return sum(value > 0 for value in hits), len(hits)


def shown(counters: Iterable[Counter]) -> list[str]:
    taken, total = share(counters)
    return [f"{taken} of {total}", f"{100 * taken / total:.1f} %"] if total else ["-", "-"]


def table(found: dict[str, Module]) -> str:
    kinds = ("lines", "branches", "toggles")
    rows = [
        f"| module | {' | | '.join(kinds)} | |",
        "|---|" + "---|" * 6,
    ]
    for file, module in found.items():
        cells = [cell for kind in kinds for cell in shown([module.counters[kind]])]
        rows.append(f"| `{Path(file).stem}` | {' | '.join(cells)} |")
    cells = [cell for kind in kinds for cell in shown(module.counters[kind] for module in found.values())]
    rows.append(f"| **all** | {' | '.join(cells)} |")
    return "\n".join(rows)


def why_table(gaps: list[Hole], reasons: dict[Hole, str]) -> str:
    rows = ["| module | code | not taken | why |", "|---|---|---|---|"]
    for gap in gaps:
        code, why = gap.code.replace("|", "\\|"), reasons.get(gap, "**not explained**")
        rows.append(f"| `{Path(gap.file).stem}` | `` {code} `` | {gap.way or 'line'} | {why} |")
    return "\n".join(rows)


def page(found: dict[str, Module], gaps: list[Hole], reasons: dict[Hole, str], runs: int) -> str:
    return TEMPLATE.read_text().format(
        card=fingerprint.card(),
        tiny=fingerprint.card("tiny"),
        sources=host.fingerprint(),
        runs=runs,
        table=table(found),
        holes=why_table(gaps, reasons) if gaps else "None.",
        tests=", ".join(f"`{name}`" for name in WHOLE_CARD),
        least=round(100 * LEAST),
    )


def main(arguments: list[str] | None = None) -> int:
    options = Parser(prog="coverage-rtl", description=__doc__.splitlines()[0])
    options.add_argument("--report", action="store_true", help="from the counts of the last run")
    options.add_argument("--jobs", type=at_least(1), default=2, help="processes (2)")
    given = options.parse_args(arguments)
    passed = given.report or run(given.jobs)
    try:
        files = sorted(COUNTS.glob("*.dat"))
        found = count(path.read_text(errors="replace") for path in files)
        if not found:
            raise CoverageError("nothing was counted; run `make coverage-rtl`")
        gaps = holes(found)
        wrong, reasons = compare(gaps, explanations())
    except (CoverageError, OSError, tomllib.TOMLDecodeError) as error:
        print(f"coverage-rtl: {error}", file=sys.stderr)
        return 2
    if not passed:
        wrong.append("a test failed")
    for kind in ("lines", "branches"):
        taken, total = share(module.counters[kind] for module in found.values())
        if taken < LEAST * total:
            wrong.append(f"{kind}: {100 * taken / total:.1f} %, less than {100 * LEAST:.0f} %")
    print(table(found))
    kinds = ("lines", "branches", "toggles")
    said = [f"{shown(module.counters[kind] for module in found.values())[0]} {kind}" for kind in kinds]
    text = page(found, gaps, reasons, len(files))
    of = fingerprint.now("standard card", "tiny card", "firmware")
    if not wrong:
        publish("coverage", text, "make coverage-rtl", of, f"Taken: {', '.join(said)}.")
    for line in wrong:
        print(f"coverage-rtl: {line}")
    return 1 if wrong else 0


if __name__ == "__main__":
    run_main("coverage-rtl", main)
