# SPDX-License-Identifier: Apache-2.0
"""Runs the numbered tests: a driver sends each `Send`, and every test ends with a verdict."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from typing import Protocol

from . import problem
from .cases import CASES, PARITY, Case, Fault, Heard, Missing, Profile, Send, Session

PASS, FAIL, OWN_CODE, NONE, HIDDEN = "pass", "fail", "own code", "n.a.", "not visible"
TRIES = 3


class NoAnswer(problem.NoAnswer):
    """The slave does not answer; the text is one line for the user."""


class Silence(NoAnswer):
    """The slave has sent nothing at all."""


@dataclass(frozen=True)
class Verdict:
    """Outcome of a test. `text`: the fault, the slave's own exception codes, or the missing function."""

    number: str
    outcome: str
    text: str = ""


class Driver(Protocol):
    """Connection to the slave. `sees`: those of BYTES, EDGES, PARITY and PINS that it can show."""

    sees: frozenset[str]

    def exchange(self, send: Send) -> Heard: ...


Steps = Generator[Send, Heard, object]


def steps(case: Case, profile: Profile, sees: frozenset[str]) -> Generator[Send, Heard, Verdict]:
    """The transmissions of a test; returns its verdict."""
    if case.needs == PARITY and profile.fmt.parity == "N":
        return Verdict(case.number, NONE, "no parity")
    if case.needs not in sees:
        return Verdict(case.number, HIDDEN)
    session = Session(profile, case.number)
    try:
        yield from punctual(case.dialogue(session))
    except Missing as missing:
        return Verdict(case.number, NONE, str(missing))
    except Fault as fault:
        return Verdict(case.number, FAIL, str(fault))
    if session.own_codes:
        return Verdict(case.number, OWN_CODE, "; ".join(sorted(set(session.own_codes))))
    return Verdict(case.number, PASS)


def punctual(dialogue: Steps) -> Steps:
    """The dialogue. After a silence it listens once more at its end: no other test hears a late reply."""
    heard, silence, end = None, False, None
    while end is None:
        try:
            send = dialogue.send(heard)
            heard = yield send
            silence |= send.wait and not heard.data
        except (StopIteration, Fault) as reached:
            end = reached
    late = (yield Send()).data if silence else b""
    if isinstance(end, Fault):
        raise end
    if late:
        raise Fault(f"a reply after the longest wait: {late.hex(' ')}")


def presence(profile: Profile) -> Generator[Send, Heard, None]:
    """Raises NoAnswer when a good read has no reply three times, or when only its echo returns."""
    session = Session(profile)
    request = session.request(session.read)
    for _ in range(TRIES):
        heard = yield Send(request)
        # No reply to a read begins like this: it is shorter than the request, or has a byte count there.
        if heard.data.startswith(request):
            raise NoAnswer("the port hears its own requests; switch the echo of the adapter off")
        if heard.data:
            return
        if (yield Send()).data:
            raise NoAnswer(f"unit {profile.unit} answers after the longest wait; it needs a longer one")
    raise Silence(f"unit {profile.unit} does not answer at {profile.fmt}")


def pump(dialogue: Generator[Send, Heard, object], driver: Driver) -> object:
    """Carries a dialogue out; returns its result."""
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
    """All verdicts in order. `each` is called after every test."""
    pump(presence(profile), driver)
    found = []
    for case in cases:
        found.append(pump(steps(case, profile, driver.sees), driver))
        each(found[-1])
    return found
