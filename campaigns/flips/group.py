# SPDX-License-Identifier: Apache-2.0
"""Many flips in the same traffic, each in a copy of the running card.

A process plays the traffic. At the clock of each flip it forks, and the copy flips its bit and plays on. Once
the copy is again in the state of the card without a flip, nothing can differ any more, and it ends. A first
copy plays the traffic without a flip and notes these states. The outcome is that of trial().
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable

from campaigns.flips.trial import Flip, FlipPlayer, Outcome, Places, case_of, flip_of
from campaigns.fuzz.case import Player
from sim.harness.registers import TOP


class GroupError(Exception):
    """A copy failed, or the card does not do as the judge says even without a flip."""


class _SameAgainError(Exception):
    """The flip has left no trace."""


class GroupPlayer(FlipPlayer):
    """Plays a case without a flip; `flips` are made in copies."""

    def __init__(self, case: dict, places: Places, flips: list[Flip]) -> None:
        super().__init__(case, places.target, None)
        names = {name: number for number, (name, _, _) in enumerate(self.pins.variables())}
        self.variables = {flip: names[f"TOP.{TOP}.{flip.path}"] for flip in flips}
        self.waiting = sorted(flips, key=lambda flip: flip.at)
        self.states: list[tuple] = []  # of the card without a flip, after each step of the traffic
        self.steps = 0
        self.noting = False
        self.own: Flip | None = None  # of a copy
        self.outcomes: dict[Flip, Outcome] = {}

    def _run_with_flips(self, until: float, to_the_end: bool) -> list[tuple[int, int]]:
        switched: list[tuple[int, int]] = []
        while self.waiting and self.waiting[0].at < until:
            switched = Player._run(self, max(self.waiting[0].at, self.pins.now + 1), to_the_end)
            while self.waiting and self.pins.now >= self.waiting[0].at:
                self._copy(self.waiting.pop(0))
            if switched and not to_the_end:
                break
        else:
            if self.pins.now < until:
                switched = Player._run(self, until, to_the_end)
        self._compare()
        return switched

    def _compare(self) -> None:
        if self.noting:
            self.states.append(self.pins.state())
        elif self.own and self.steps < len(self.states) and self.pins.state() == self.states[self.steps]:
            raise _SameAgainError
        self.steps += 1

    def note(self) -> None:
        """Plays the traffic in a copy and keeps its states."""

        def play() -> tuple[Outcome, list[tuple]]:
            self.noting, self.waiting = True, []
            self.play_all()
            return self.outcome(Flip(self.pins.now, "", 0, 0, ""))[0], self.states

        outcome, self.states = in_a_copy(play)
        if outcome.what != "no effect":
            raise GroupError(f"without a flip: {outcome.what}: {outcome.why}")
        self.unclear = outcome.why

    def _copy(self, flip: Flip) -> None:
        reader, writer = os.pipe()
        pid = os.fork()
        if pid:
            os.close(writer)
            self.outcomes[flip] = received(reader, pid)
            return
        os.close(reader)
        self.own, self.waiting, self.writer = flip, [], writer
        self._make(flip, self.variables[flip])

    def play_flips(self) -> dict[Flip, Outcome]:
        """Returns in this process only; a copy ends in here."""
        try:
            self.play_all()
            result = self.outcome(self.own)[0] if self.own else None
        except _SameAgainError:
            result = Outcome(self.own, "no effect", self.unclear)
        except BaseException as error:
            if not self.own:
                raise
            result = GroupError(f"{self.own}: {error!r}")
        if self.own:
            send(self.writer, result)
        return self.outcomes


def send(writer: int, result: object) -> None:
    """Hands the result to the process that made this copy, and ends."""
    try:
        with os.fdopen(writer, "wb") as stream:
            pickle.dump(result, stream)
    finally:
        os._exit(0)


def received(reader: int, pid: int) -> object:
    with os.fdopen(reader, "rb") as stream:
        data = stream.read()
    os.waitpid(pid, 0)
    result = pickle.loads(data) if data else GroupError("a copy of the card ended without a result")
    if isinstance(result, Exception):
        raise result
    return result


def in_a_copy(function: Callable[[], object]) -> object:
    reader, writer = os.pipe()
    pid = os.fork()
    if pid:
        os.close(writer)
        return received(reader, pid)
    os.close(reader)
    try:
        result = function()
    except BaseException as error:
        result = GroupError(repr(error))
    send(writer, result)
    return None


def outcomes(numbers: list[str], places: Places) -> list[Outcome]:
    """Of trials of one group, in their order; as trial() gives them."""
    flips = {number: flip_of(number, places) for number in numbers}
    player = GroupPlayer(case_of(numbers[0], places), places, list(flips.values()))
    try:
        player.note()
        found = player.play_flips()
    finally:
        player.pins.close()
    # A flip after the end of the traffic changes nothing that is judged.
    return [found.get(flip) or Outcome(flip, "no effect", player.unclear) for flip in flips.values()]
