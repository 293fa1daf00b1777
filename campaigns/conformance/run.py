# SPDX-License-Identifier: Apache-2.0
"""Grades our card and other slaves by the numbered tests (SLAVE=name: one of them); `make conformance`.

    python -m campaigns.conformance.run                 every slave
    python -m campaigns.conformance.run --slave NAME    one slave; prints its faults, own codes and reasons

Results are kept in build/conformance/results.json. The page is written when every slave has a result. A slave
that cannot be graded gets one line and keeps its last result; the other slaves are graded, and the exit code
is 2. Exit 1 when our card fails a test.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from campaigns.bench import fingerprint
from campaigns.conformance import designs
from campaigns.conformance.card import PROFILE, CardDriver
from campaigns.conformance.designs import BUILD, DesignError, named
from campaigns.conformance.fixture import FAULTS, ModelLine
from campaigns.conformance.fixture import PROFILE as MODEL
from rtl.command import Parser, run_main
from rtl.report_page import markdown, publish
from rtl.sources import SourcesError
from sim.harness.library import BuildError
from sw.rtu2fc.cases import CASES
from sw.rtu2fc.engine import FAIL, HIDDEN, NONE, OWN_CODE, PASS, NoAnswer, Verdict, grade
from sw.test import host

KEPT = BUILD / "results.json"
TEMPLATE = Path(__file__).parent / "conformance.md.in"
CARDS = ("standard", "tiny")
SUMMARY = ["slave", "by", "measured", "passed", "own code", "failed", "n.a.", "not visible"]
TESTS = ["test", "page", "sent", "must come", "must not come"]
MARKS = {PASS: "✓", OWN_CODE: "own code", FAIL: "**✗**", NONE: "n.a.", HIDDEN: ""}


class ConformanceError(Exception):
    """Error for the user, in one line."""


@dataclass(frozen=True)
class Subject:
    """A slave: its column, the way to it, and the function that grades it."""

    name: str
    title: str
    way: str
    graded: Callable[[], list[Verdict]]
    ours: bool = False
    stated: Callable[[], str] = str  # the fingerprint, version or commit of the graded slave


def card_pins(config: str) -> list[Verdict]:
    with CardDriver(config) as driver:
        return grade(driver, PROFILE)


STATED = re.compile(r"(\w+ card) `(\w+)`, firmware sources `(\w+)`")


def own_card(config: str) -> str:
    return f"{config} card `{fingerprint.card(config)}`, firmware sources `{host.fingerprint()}`"


def subjects() -> dict[str, Subject]:
    """Every column of the page, in its order."""
    found = []
    for config in CARDS:
        stated = partial(own_card, config)
        found.append(Subject(config, f"{config} card", "pins", partial(card_pins, config), True, stated))
    for design in designs.designs().values():
        # A pinned commit, or `ours`.
        stated = partial(lambda design: design.commit[:7] if design.commit else "ours", design)
        found.append(
            Subject(
                design.name, design.title, "pins", partial(designs.grade, design), not design.commit, stated
            )
        )
    return {subject.name: subject for subject in found}


# ---------------------------------------------------------------- the page


def counts(verdicts: list[Verdict]) -> list[str]:
    return [str(sum(one.outcome == outcome for one in verdicts)) for outcome in MARKS]


def found_by_own_tests() -> tuple[int, int]:
    """The number of planted faults that their own tests find, and of tests that the model slave passes."""
    by_number = {case.number: case for case in CASES}
    found = sum(
        grade(ModelLine(MODEL, fault), MODEL, [by_number[number]])[0].outcome == FAIL
        for fault, number in FAULTS.items()
    )
    return found, sum(one.outcome == PASS for one in grade(ModelLine(MODEL), MODEL))


def lines_of(verdicts: list[Verdict], outcome: str) -> list[str]:
    """The lines of one outcome. Tests that are n.a. for the same reason share a line."""
    found = [one for one in verdicts if one.outcome == outcome]
    if outcome != NONE:
        return [f"{one.number}: {one.text}" for one in found]
    reasons = dict.fromkeys(one.text for one in found)
    return [f"{', '.join(one.number for one in found if one.text == text)}: {text}" for text in reasons]


def details(there: dict[str, Subject], verdicts: dict[str, dict[str, Verdict]]) -> str:
    """Faults, own codes and reasons for n.a. Slaves with the same lines share a paragraph."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for outcome, word in ((FAIL, "fails"), (OWN_CODE, "own codes"), (NONE, "n.a.")):
        for name, subject in there.items():
            if lines := lines_of(list(verdicts[name].values()), outcome):
                groups.setdefault((word, *lines), []).append(f"{subject.title}, {subject.way}")
    parts = [
        f"**{'; '.join(names)}: {word}**\n\n" + "\n".join(f"- {line}" for line in lines)
        for (word, *lines), names in groups.items()
    ]
    return "\n\n".join(parts)


def write(kept: dict[str, dict]) -> None:
    """Writes the page of all slaves that have a result."""
    there = {name: subject for name, subject in subjects().items() if name in kept}
    verdicts = {name: {one["number"]: Verdict(**one) for one in kept[name]["verdicts"]} for name in there}
    summary = [
        [subject.title, subject.way, kept[name]["stated"], *counts(list(verdicts[name].values()))]
        for name, subject in there.items()
    ]
    marks = [[case.number, *(MARKS[verdicts[name][case.number].outcome] for name in there)] for case in CASES]
    faults, clean = found_by_own_tests()
    of: dict[str, str] = {}
    for one in kept.values():
        if own := STATED.match(one["stated"]):
            of |= {own[1]: own[2], "firmware": own[3]}
    publish(
        "conformance",
        TEMPLATE.read_text().format(
            summary=markdown([SUMMARY, *summary]),
            tests=markdown([TESTS, *([c.number, c.page, c.sent, c.must, c.must_not] for c in CASES)]),
            results=markdown([["test", *(f"{one.title}, {one.way}" for one in there.values())], *marks]),
            details=details(there, verdicts),
            faults=faults,
            planted=len(FAULTS),
            clean=clean,
            count=len(CASES),
        ),
        "make conformance",
        of,
        f"{faults} of {len(FAULTS)} planted faults are found by their own tests.",
        keep=[""],
    )


def current(verdicts: list[dict]) -> bool:
    """Whether they are of the present list of tests, and have its outcomes."""
    numbers = [one["number"] for one in verdicts]
    return numbers == [case.number for case in CASES] and {one["outcome"] for one in verdicts} <= MARKS.keys()


def results() -> dict[str, dict]:
    """The kept results by the names of the slaves; those of another list of tests are dropped."""
    try:
        kept = json.loads(KEPT.read_text()) if KEPT.exists() else {}
        return {name: one for name, one in kept.items() if current(one["verdicts"])}
    except (ValueError, TypeError, KeyError, AttributeError):
        raise ConformanceError(f"{named(KEPT)} is damaged; delete it and grade every slave again") from None


def fails(result: dict) -> bool:
    return any(one["outcome"] == FAIL for one in result["verdicts"])


def failures_of_ours(kept: dict[str, dict]) -> list[str]:
    return [
        f"{subject.title}, {subject.way}: {one['number']} {one['text']}"
        for name, subject in subjects().items()
        if subject.ours and name in kept
        for one in kept[name]["verdicts"]
        if one["outcome"] == FAIL
    ]


def main(arguments: list[str] | None = None) -> int:
    every = subjects()
    parser = Parser(prog="conformance", description=__doc__.splitlines()[0])
    parser.add_argument("--slave", choices=list(every), metavar="NAME", help=f"one of {', '.join(every)}")
    given = parser.parse_args(arguments)
    kept, wrong = results(), 0
    for subject in [every[given.slave]] if given.slave else every.values():
        print(f"{subject.title}, {subject.way} ...", end=" ", flush=True)
        try:
            verdicts = subject.graded()
        except (BuildError, ConformanceError, DesignError, NoAnswer, SourcesError) as error:
            wrong += 1
            print("not graded")
            print(f"conformance: {error}", file=sys.stderr)
            continue
        kept = results()  # another run may have added a slave
        kept[subject.name] = {"stated": subject.stated(), "verdicts": [asdict(one) for one in verdicts]}
        print(", ".join(f"{count} {name}" for count, name in zip(counts(verdicts), MARKS, strict=True)))
        if given.slave:
            for one in verdicts:
                if one.outcome in (FAIL, OWN_CODE, NONE):
                    print(f"  {one.outcome:10} {one.number:6} {one.text}")
        KEPT.parent.mkdir(parents=True, exist_ok=True)
        KEPT.write_text(json.dumps(kept, indent=1))
    if missing := [name for name in every if name not in kept]:
        print(f"no report yet: it needs a result of {', '.join(missing)}, too")
    else:
        write(kept)
    failed = failures_of_ours(kept)
    for line in failed:
        print(f"fails: {line}")
    return 2 if wrong else 1 if failed or (given.slave and fails(kept[given.slave])) else 0


if __name__ == "__main__":
    run_main("conformance", main, ConformanceError)
