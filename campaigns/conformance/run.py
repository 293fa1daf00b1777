# SPDX-License-Identifier: Apache-2.0
"""Grades the card and HDL slaves by the numbered tests (SLAVE=name: one of them); `make conformance`.

    python -m campaigns.conformance.run                 every slave
    python -m campaigns.conformance.run --slave NAME    one slave; prints its faults, own codes and reasons

A case is one slave. Of a slave that cannot be graded the command says why, and grades the others. Exit 1: a
slave fails a test; 2: a slave was not graded. Other options: campaigns/engine.py.
"""

from __future__ import annotations

import functools
from argparse import Namespace
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from campaigns.bench import fingerprint
from campaigns.conformance import designs
from campaigns.conformance.card import PROFILE, CardDriver
from campaigns.conformance.designs import DesignError
from campaigns.conformance.fixture import FAULTS, ModelLine
from campaigns.conformance.fixture import PROFILE as MODEL
from campaigns.engine import Campaign, EngineError, Row, Store
from rtl.command import Parser, run_main
from rtl.report_page import markdown
from rtl.sources import SourcesError
from sim.harness.library import BuildError
from sw.rtu2fc.cases import CASES
from sw.rtu2fc.engine import FAIL, HIDDEN, NONE, OWN_CODE, PASS, NoAnswer, Verdict, grade
from sw.test import host

CARDS = ("standard", "tiny")
SUMMARY = ["slave", "by", "measured", "passed", "own code", "failed", "n.a.", "not visible"]
TESTS = ["test", "page", "sent", "must come", "must not come"]
MARKS = {PASS: "✓", OWN_CODE: "own code", FAIL: "**✗**", NONE: "n.a.", HIDDEN: ""}
Verdicts = dict[str, Verdict]  # by the number of the test


@dataclass(frozen=True)
class Subject:
    """A slave: its column, and the function that grades it on its pins."""

    title: str
    graded: Callable[[], list[Verdict]]
    stated: str  # the fingerprint of the graded slave


def card_pins(config: str) -> list[Verdict]:
    with CardDriver(config) as driver:
        return grade(driver, PROFILE)


def own_card(config: str) -> str:
    return f"{config} card `{fingerprint.card(config)}`, firmware sources `{host.fingerprint()}`"


def subjects() -> dict[str, Subject]:
    """Every column of the page, in its order."""
    found = {
        config: Subject(f"{config} card", functools.partial(card_pins, config), own_card(config))
        for config in CARDS
    }
    for name, design in designs.designs().items():
        found[name] = Subject(design.title, functools.partial(designs.grade, design), "ours")
    return found


class Conformance(Campaign):
    name, module = "conformance", "campaigns.conformance.run"
    command = "make conformance"
    count = 0
    configs = ("standard",)
    drawn = False

    def options(self, parser: Parser) -> None:
        every = list(subjects())
        parser.add_argument("--slave", choices=every, metavar="NAME", help=f"one of {', '.join(every)}")

    def cases(self, given: Namespace) -> list[str]:
        return [given.slave] if given.slave else list(subjects())

    def run(self, config: str, case: str) -> Row:
        subject = subjects()[case]
        try:
            verdicts = subject.graded()
        except (BuildError, DesignError, NoAnswer, SourcesError) as error:
            return {"missing": str(error)}
        fails = [f"{one.number} {one.text}" for one in verdicts if one.outcome == FAIL]
        return {
            "wrong": "; ".join(fails),
            "verdicts": [asdict(one) for one in verdicts],
        }

    def of(self, config: str) -> str:
        cards = [f"{fingerprint.card(each)} {fingerprint.firmware(each)}" for each in CARDS]
        return " ".join([*cards, self.judge()])

    def subjects(self) -> list[str]:
        return ["standard card", "tiny card", "firmware", "conformance judge"]

    def said(self, rows: dict[str, Row]) -> str:
        """The counts of each slave; of one alone also its faults, own codes and reasons."""
        found, lines = verdicts_of(rows), []
        for name, verdicts in found.items():
            each = ", ".join(f"{count} {word}" for count, word in zip(counts(verdicts), MARKS, strict=True))
            lines.append(f"{subjects()[name].title}: {each}")
            if len(rows) == 1:
                told = [one for one in verdicts.values() if one.outcome in (FAIL, OWN_CODE, NONE)]
                lines += [f"  {one.outcome:10} {one.number:6} {one.text}" for one in told]
        return "\n".join(["", *lines])

    def context(self, store: Store) -> dict[str, Any]:
        (card,) = self.found(store)
        every = subjects()
        if missing := [name for name in every if name not in card.rows]:
            raise EngineError(f"no result of {', '.join(missing)}; run `make conformance` first")
        verdicts = verdicts_of({name: card.rows[name] for name in every})
        summary = [[one.title, "pins", one.stated, *counts(verdicts[name])] for name, one in every.items()]
        marks = [
            [case.number, *(MARKS[found[case.number].outcome] for found in verdicts.values())]
            for case in CASES
        ]
        faults, clean = found_by_own_tests()
        return {
            "summary": markdown([SUMMARY, *summary]),
            "tests": markdown([TESTS, *([c.number, c.page, c.sent, c.must, c.must_not] for c in CASES)]),
            "results": markdown([["test", *(f"{one.title}, pins" for one in every.values())], *marks]),
            "details": details(every, verdicts),
            "faults": faults,
            "planted": len(FAULTS),
            "clean": clean,
            "count": len(CASES),
        }

    def about(self, store: Store) -> str:
        return f"{found_by_own_tests()[0]} of {len(FAULTS)} planted faults are found by their own tests."


# ---------------------------------------------------------------- the page


def verdicts_of(rows: dict[str, Row]) -> dict[str, Verdicts]:
    return {name: {one["number"]: Verdict(**one) for one in row["verdicts"]} for name, row in rows.items()}


def counts(verdicts: Verdicts) -> list[str]:
    return [str(sum(one.outcome == outcome for one in verdicts.values())) for outcome in MARKS]


@functools.cache
def found_by_own_tests() -> tuple[int, int]:
    """The number of planted faults that their own tests find, and of tests that the model slave passes."""
    by_number = {case.number: case for case in CASES}
    found = sum(
        grade(ModelLine(MODEL, fault), MODEL, [by_number[number]])[0].outcome == FAIL
        for fault, number in FAULTS.items()
    )
    return found, sum(one.outcome == PASS for one in grade(ModelLine(MODEL), MODEL))


def lines_of(verdicts: Verdicts, outcome: str) -> list[str]:
    """The lines of one outcome. Tests that are n.a. for the same reason share a line."""
    found = [one for one in verdicts.values() if one.outcome == outcome]
    if outcome != NONE:
        return [f"{one.number}: {one.text}" for one in found]
    reasons = dict.fromkeys(one.text for one in found)
    return [f"{', '.join(one.number for one in found if one.text == text)}: {text}" for text in reasons]


def details(every: dict[str, Subject], verdicts: dict[str, Verdicts]) -> str:
    """Faults, own codes and reasons for n.a. Slaves with the same lines share a paragraph."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for outcome, word in ((FAIL, "fails"), (OWN_CODE, "own codes"), (NONE, "n.a.")):
        for name, subject in every.items():
            if lines := lines_of(verdicts[name], outcome):
                groups.setdefault((word, *lines), []).append(f"{subject.title}, pins")
    parts = [
        f"**{'; '.join(names)}: {word}**\n\n" + "\n".join(f"- {line}" for line in lines)
        for (word, *lines), names in groups.items()
    ]
    return "\n\n".join(parts)


CAMPAIGN = Conformance()

if __name__ == "__main__":
    run_main("conformance", CAMPAIGN.main, EngineError)
