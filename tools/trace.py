# SPDX-License-Identifier: Apache-2.0
"""Which test shows which rule, and what its last run said.

Rules come from docs/reference/requirements.md, tests from the `rule` marks that pytest collects, results
from the last runs (build/results.json, written by tb/lib/pytest_plugin.py). It prints each rule none of
whose tests has run. It fails on a rule without a test, on a mark that names no rule, on a test whose last
run failed, and on a cocotb test that no run has chosen. --complete, the last step of CI, fails on a rule of
which no test has passed, too.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import io
import json
import re
import sys
from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import pytest

from rtl.command import run_main
from rtl.sources import commit

ROOT = Path(__file__).resolve().parents[1]
REQUIREMENTS = ROOT / "docs/reference/requirements.md"
RESULTS = ROOT / "build/results.json"
RUNS = ROOT / "build/tests"
ROW = re.compile(r"^\| ([A-Z0-9]+(?:-[A-Z0-9]+)*) \| (.+) \| (test|open) \|$")


class Collector:
    """A pytest plugin that notes each test and its marks."""

    def __init__(self) -> None:
        self.stopped = False
        self.tests: dict[str, list[str]] = defaultdict(list)
        self.all: set[str] = set()
        self.layers: set[str] = set()

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        for item in items:
            self.all.add(item.nodeid)
            for mark in item.iter_markers("nightly"):
                self.layers.update(mark.args)
            for mark in item.iter_markers("rule"):
                for rule in mark.args:
                    self.tests[rule].append(item.nodeid)

    def pytest_keyboard_interrupt(self, excinfo: pytest.ExceptionInfo) -> None:
        """After Ctrl-C, and also after an error of the collection, by another class."""
        self.stopped = excinfo.type is KeyboardInterrupt


def read_rules() -> dict[str, str]:
    """Rule id to what shows it."""
    rows = (ROW.match(line) for line in REQUIREMENTS.read_text().splitlines())
    return {row[1]: row[3] for row in rows if row}


@dataclass(frozen=True)
class Result:
    """What the last run of a test said, of which commit, and when (UTC)."""

    outcome: str
    commit: str = ""
    at: str = ""


def read_results() -> dict[str, Result]:
    """Results of the last runs by test."""
    if not RESULTS.exists():
        return {}
    return {test: Result(**entry) for test, entry in json.loads(RESULTS.read_text()).items()}


def chosen(*options: str) -> tuple[Collector, int, str]:
    """The tests that pytest chooses with these options, its exit code, and what it said."""
    collector = Collector()
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(said):
        code = pytest.main(["--collect-only", "-q", *options, f"--rootdir={ROOT}"], [collector])
    if collector.stopped:
        raise KeyboardInterrupt
    return collector, int(code), said.getvalue()


def collect(*, nightly: bool = True) -> Collector:
    collector, code, said = chosen(*["--all"] * nightly)
    if code:
        print(said, file=sys.stderr)
        sys.exit(f"trace: pytest could not collect the tests (exit {code})")
    return collector


def verdict(tests: list[str], results: dict[str, str]) -> str:
    """In words, the worst first."""
    found = Counter(results.get(test, "not run") for test in tests)
    return ", ".join(f"{found[state]} {state}" for state in ("failed", "not run", "passed") if found[state])


def cocotb_tests(path: Path) -> set[str]:
    """Names of the cocotb tests in a file."""
    return {
        node.name
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.AsyncFunctionDef)
        and any("cocotb.test" in ast.unparse(decorator) for decorator in node.decorator_list)
    }


def never_chosen(tests: set[str], results: dict[str, str]) -> list[str]:
    """Cocotb tests that no run's choice of names had; in files of which every pytest test has run."""
    ran: dict[str, set[str]] = defaultdict(set)
    for path in RUNS.glob("*/results.xml"):
        for case in ElementTree.parse(path).iter("testcase"):
            ran[case.get("classname", "")].add(re.match(r"\w*", case.get("name", ""))[0])
    found = []
    for file in sorted({test.split("::")[0] for test in tests}):
        own = {test for test in tests if test.startswith(f"{file}::")}
        if own <= results.keys():
            left = cocotb_tests(ROOT / file) - ran[file.removesuffix(".py").replace("/", ".")]
            found += [f"{file}: no run has chosen {name}" for name in sorted(left)]
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--complete", action="store_true", help="fail when no test of a rule has passed")
    args = parser.parse_args()

    rules = read_rules()
    collected = collect()
    tests = collected.tests
    read = read_results()
    results = {test: result.outcome for test, result in read.items()}
    problems = [
        f"{rule}: marked in {tests[rule][0]}, but no rule of that name" for rule in tests if rule not in rules
    ]
    not_run, shown = [], 0
    for rule, shown_by in rules.items():
        own = tests.get(rule, [])
        functions = {test.split("[")[0] for test in own}
        state = "; ".join(["open"] * (shown_by == "open") + [verdict(own, results) or "NO TEST"])
        where = ", ".join(sorted({function.split("::")[0].removeprefix("tb/") for function in functions}))
        print(f"{rule:<18} {len(functions):>3} tests  {state:<28} {where}")
        if shown_by == "test" and not own:
            problems.append(f"{rule}: no test names it")
        problems += [f"{rule}: {test} failed" for test in own if results.get(test) == "failed"]
        outcomes = {results.get(test) for test in own}
        if outcomes == {None}:
            not_run.append(rule)
        if own and args.complete and "passed" not in outcomes:
            problems.append(f"{rule}: no test of it has passed")
        shown += "passed" in outcomes and "failed" not in outcomes
    problems += never_chosen(collected.all, results)
    missing = collected.all - results.keys()
    for problem in problems:
        print(f"trace: {problem}", file=sys.stderr)
    if not_run:
        print(f"not run yet (make test): {', '.join(not_run)}")
    if missing:
        print(f"{len(missing)} of {len(collected.all)} tests have not been run (make nightly)")
    now = commit()
    if older := [read[test].at for test in collected.all & read.keys() if read[test].commit != now]:
        print(f"{len(older)} results are of another commit than {now}, the oldest of {min(older)} UTC")
    print(f"{len(rules)} rules, {shown} shown, {sum(by == 'open' for by in rules.values())} open")
    return 1 if problems else 0


if __name__ == "__main__":
    run_main("trace", main)
