# SPDX-License-Identifier: Apache-2.0
"""The bench's work in pieces that processes can share: the whole of it, and the fast part that guards."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from sim.bench.card import BAUDS, FORMAT_NAMES
from sim.bench.cases import CASES, Outcome, gate, overtaken, random_requests, turnaround
from sim.bench.conformance import conformance

FORM = "8E1"  # where one format has to do
CONFORMANCE = ((19200, "8N1"), (19200, "8E1"), (19200, "8N2"), (19200, "8O1"), (2400, FORM), (115200, FORM))
# Repetitions, each in another phase of the bit and of the poll loop.
REPEATS = {300: 1, 1200: 2, 2400: 2}
REPEATS_ELSE = 4
# Random requests a rate, 5,000 in all: more where more fit into a second.
RANDOM = {300: 15, 1200: 50, 2400: 100, 4800: 250, 9600: 700, 19200: 1300, 38400: 1285, 115200: 1300}
RANDOM_PIECE = 50

FAST_RANDOM = ((38400, "8N2", 50), (115200, "8E1", 60))
FAST_FEW = ("read 16 coils", "start motor")


@dataclass(frozen=True)
class Piece:
    """One call; `cost` is about the simulated time, to start the long ones first."""

    kind: str
    baud: int
    form: str
    function: Callable[..., Outcome]
    more: dict[str, object] = field(default_factory=dict)
    cost: float = 0.0

    @property
    def name(self) -> str:
        number = f"-{self.more['part']}" if "part" in self.more else ""
        return f"{self.kind}-{self.baud}-{self.form}{number}"

    def run(self) -> Outcome:
        more = {key: value for key, value in self.more.items() if key != "part"}
        return self.function(self.baud, self.form, **more)


def _turnaround(baud: int, form: str, seed: int, early: bool, repeats: int, names: tuple[str, ...]) -> Piece:
    more = {"early": early, "repeats": repeats, "names": names, "seed": seed}
    return Piece(
        "early" if early else "late", baud, form, turnaround, more, (repeats + 1) * len(names) / baud
    )


def whole(seed: int) -> Iterator[Piece]:
    names = tuple(CASES)
    for baud in BAUDS:
        repeats = REPEATS.get(baud, REPEATS_ELSE)
        for form in FORMAT_NAMES:
            yield _turnaround(baud, form, seed, True, repeats, names)
        yield _turnaround(baud, FORM, seed, False, repeats, names)
        yield Piece("gate", baud, FORM, gate, {"quick": False}, 10 / baud)
        yield Piece("overtaken", baud, FORM, overtaken, {"quick": False}, 5 / baud)
        for part, left in enumerate(range(RANDOM[baud], 0, -RANDOM_PIECE)):
            more = {"count": min(left, RANDOM_PIECE), "seed": seed + part, "part": part}
            form = FORMAT_NAMES[part % len(FORMAT_NAMES)]
            yield Piece("random", baud, form, random_requests, more, more["count"] / baud)
    for baud, form in CONFORMANCE:
        yield Piece("conformance", baud, form, conformance, cost=80 / baud)


def fast(seed: int) -> Iterator[Piece]:
    names = tuple(CASES)
    for baud in BAUDS:
        yield Piece("gate", baud, FORM, gate, {"quick": True}, 3 / baud)
        if baud < 2400:
            yield _turnaround(baud, "8N2", seed, True, 1, FAST_FEW)
        elif baud < 9600:
            yield _turnaround(baud, FORM, seed, True, 1, names)
        else:
            for form in FORMAT_NAMES:
                yield _turnaround(baud, form, seed, True, 1, names)
    for baud in (19200, 115200):
        yield Piece("overtaken", baud, FORM, overtaken, {"quick": True})
    for baud, form, count in FAST_RANDOM:
        yield Piece("random", baud, form, random_requests, {"count": count, "seed": seed})
    for form in ("8N2", FORM):
        yield Piece("conformance", 19200, form, conformance)
