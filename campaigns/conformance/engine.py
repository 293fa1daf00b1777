# SPDX-License-Identifier: Apache-2.0
"""Runs the numbered tests: a driver carries out each `Send`, and every test ends in a verdict."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from typing import Protocol

from campaigns.conformance.cases import CASES, PARITY, Case, Fault, Heard, Missing, Profile, Send, Session

PASS, FAIL, INTENT, NONE, HIDDEN = "pass", "fail", "by intent", "n.a.", "not visible"
TRIES = 3


class NoAnswer(Exception):
    """Nobody answers; the text is for the user."""


@dataclass(frozen=True)
class Verdict:
    """Outcome of a test. `text`: what was wrong, what was by intent, or what is lacking."""

    number: str
    outcome: str
    text: str = ""


class Driver(Protocol):
    """A way to the slave. `sees`: what of bytes, edges, parity and DE it shows."""

    sees: frozenset[str]

    def exchange(self, send: Send) -> Heard: ...


Steps = Generator[Send, Heard, object]


def steps(case: Case, profile: Profile, sees: frozenset[str]) -> Generator[Send, Heard, Verdict]:
    """The transmissions of a test; returns its verdict."""
    if case.needs == PARITY and profile.fmt.parity == "N":
        return Verdict(case.number, NONE, "no parity")
    if case.needs not in sees:
        return Verdict(case.number, HIDDEN)
    session = Session(profile)
    try:
        yield from case.dialogue(session)
    except Missing as missing:
        return Verdict(case.number, NONE, str(missing))
    except Fault as fault:
        return Verdict(case.number, FAIL, str(fault))
    if session.intent:
        return Verdict(case.number, INTENT, "; ".join(sorted(set(session.intent))))
    return Verdict(case.number, PASS)


def presence(profile: Profile) -> Generator[Send, Heard, None]:
    """Raises NoAnswer when a good read has no reply three times."""
    session = Session(profile)
    for _ in range(TRIES):
        if (yield Send(session.frame(session.read))).data:
            return
    raise NoAnswer(f"unit {profile.unit} does not answer at {profile.fmt}")


def pump(dialogue: Generator[Send, Heard, object], driver: Driver) -> object:
    """Carries a dialogue out; returns what it returns."""
    heard = None
    while True:
        try:
            send = dialogue.send(heard)
        except StopIteration as end:
            return end.value
        heard = driver.exchange(send)


def grade(
    driver: Driver,
    profile: Profile,
    cases: Iterable[Case] = CASES,
    each: Callable[[Verdict], None] = lambda verdict: None,
) -> list[Verdict]:
    """All verdicts in order; `each` gets every verdict as it comes."""
    pump(presence(profile), driver)
    found = []
    for case in cases:
        found.append(pump(steps(case, profile, driver.sees), driver))
        each(found[-1])
    return found
