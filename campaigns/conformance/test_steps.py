# SPDX-License-Identifier: Apache-2.0
"""Every step of the tests is needed: without it a planted fault stays unseen, or a good slave is misjudged.

A step is a statement of a test's dialogue or of a method of `Session`, or an entry of a list that a loop goes
through. Each is left out in turn. The tests are then run on the planted faults and on good slaves. A step
`needs` stays: without it a test is n.a. a little later.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from campaigns.conformance import cases, engine
from campaigns.conformance.cases import CASES, Case, Profile
from campaigns.conformance.engine import FAIL, Verdict, pump, steps
from campaigns.conformance.fixture import FAULTS, MANNERS, PROFILE, ModelLine
from tb.agents.uart import Format

SOURCE = ast.parse(Path(cases.__file__).read_text())
DIALOGUES = {node.name: node for node in SOURCE.body if isinstance(node, ast.FunctionDef)}
SESSION = next(node for node in SOURCE.body if isinstance(node, ast.ClassDef) and node.name == "Session")
METHODS = [
    node.name for node in SESSION.body if isinstance(node, ast.FunctionDef) and node.name != "__init__"
]
# Good slaves: all functions, then those with less to try a test on. One has a line that SL-20 refuses.
SLAVES = [
    PROFILE,
    *(
        replace(PROFILE, functions=PROFILE.functions - set(less))
        for less in ((1, 2, 4), (3, 4), (15, 16), (5, 6))
    ),
    replace(PROFILE, functions=PROFILE.functions - {5, 6, 15, 16}),
    replace(PROFILE, functions=PROFILE.functions - {1, 3}),
    replace(PROFILE, registers=1, coils=1, no_register=1, no_coil=1, values=(18, 21)),
    replace(PROFILE, registers=4, coils=8, no_register=400, no_coil=4000),
    replace(PROFILE, fmt=Format.named(19200, "8N1")),
]
OTHER_CODE = "sends exception 2 for a wrong quantity"
WRONG_CODE = (NameError, TypeError, ValueError, IndexError, AttributeError, AssertionError)


def lists(tree: ast.AST) -> Iterator[list]:
    """The lists of statements and the lists that a loop goes through."""
    for node in ast.walk(tree):
        if isinstance(node, ast.For):
            yield node.body
            if isinstance(node.iter, ast.Tuple | ast.Set):
                yield node.iter.elts
        elif isinstance(node, ast.FunctionDef | ast.If):
            yield node.body


def without_a_step(tree: ast.FunctionDef) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Each step in words, and the function without it. Statements that only name a value are no steps."""
    for number, each in enumerate(lists(tree)):
        for place, step in enumerate(each):
            text = isinstance(step, ast.Expr) and isinstance(step.value, ast.Constant)
            if text or isinstance(step, ast.Assign | ast.Return) or ".needs(" in ast.unparse(step):
                continue
            less = copy.deepcopy(tree)
            left = list(lists(less))[number]
            left[place : place + 1] = [ast.Pass()] if isinstance(step, ast.stmt) and len(each) == 1 else []
            yield ast.unparse(step), less


def compiled(tree: ast.FunctionDef | ast.ClassDef) -> Callable:
    if isinstance(tree, ast.FunctionDef):
        tree.decorator_list = []
    names = dict(vars(cases))
    exec(compile(ast.fix_missing_locations(ast.Module([tree], [])), cases.__file__, "exec"), names)
    return names[tree.name]


def verdict(profile: Profile, case: Case, fault: str | None = None) -> Verdict:
    line = ModelLine(profile, fault)
    found = pump(steps(case, profile, line.sees), line)
    return replace(found, text="")


def verdicts(case: Case) -> list[Verdict]:
    """Of the good slaves, also with other manners, and of one with an exception code of its own."""
    own = replace(PROFILE, own_codes={"AP-4": 2})
    found = [verdict(profile, case) for profile in SLAVES]
    return [*found, *(verdict(PROFILE, case, manner) for manner in MANNERS), verdict(own, case, OTHER_CODE)]


def noticed(tests: Iterable[Case], due: dict[str, list]) -> bool:
    """Whether a fault is not found by the test of its number, or the verdict of a good slave differs."""
    try:
        for case in tests:
            if verdicts(case) != due[case.number]:
                return True
            own = [fault for fault, number in FAULTS.items() if number == case.number]
            if any(verdict(PROFILE, case, fault).outcome != FAIL for fault in own):
                return True
    except WRONG_CODE:
        return True
    return False


@pytest.fixture(scope="module")
def due() -> dict[str, list]:
    """The verdicts of the whole tests."""
    return {case.number: verdicts(case) for case in CASES}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.number)
def test_a_test_without_one_of_its_steps_is_noticed(case, due):
    each = without_a_step(DIALOGUES[case.dialogue.__name__])
    assert not [step for step, less in each if not noticed([replace(case, dialogue=compiled(less))], due)]


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_a_session_without_one_of_its_steps_is_noticed(method, due, monkeypatch):
    place = next(n for n, node in enumerate(SESSION.body) if getattr(node, "name", "") == method)
    missed = []
    for step, less in without_a_step(SESSION.body[place]):
        session = copy.deepcopy(SESSION)
        session.body[place] = less
        monkeypatch.setattr(engine, "Session", compiled(session))
        if not noticed(CASES, due):
            missed.append(step)
    assert not missed
