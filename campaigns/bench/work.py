# SPDX-License-Identifier: Apache-2.0
"""The bench's work in pieces for several processes: the whole, and the fast part."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from campaigns.bench.card import STANDARD, TINY, Build
from campaigns.bench.cases import (
    CASES,
    EXTREMES,
    SIZES,
    SLOWEST,
    drive_faults,
    gate,
    overtaken,
    random_requests,
    turnaround,
)
from campaigns.bench.conformance import conformance
from campaigns.bench.judge import Outcome
from campaigns.bench.wave import BAUDS, FORMAT_NAMES

FORM = "8E1"  # where one format is enough
# Format of the pieces after the power-up sequence, when the LEDs flash or shine. Every second part of the
# random requests runs then, too.
SETTLED_FORM = "8O1"
SETTLED_COST = 0.002
CONFORMANCE = (
    *((19200, form) for form in FORMAT_NAMES),
    # At lower rates a column takes minutes; the gate and all cases have those rates.
    *((baud, FORM) for baud in BAUDS if baud >= 2400 and baud != 19200),
)
# The drive line has one rate: slow networks would only cost time here.
DRIVE_FAULTS = (9600, 19200, 115200)
# Repetitions, each in another phase of the bit and of the poll loop.
REPEATS = {300: 1, 1200: 2, 2400: 2}
REPEATS_ELSE = 4
# The slowest cases, where the firmware has least time. Four repeats missed one that was late in one phase of
# fifty.
PHASES, PHASES_AT = 100, (38400, 115200)
# Below this rate each format has a quarter of the sizes: every size once at each rate.
EACH_SIZE_FROM = 38400
# Below these rates the card has most time and a request takes longest: two formats and the extreme sizes are
# enough. A second of the small card takes three times as long to simulate.
SLOW_FORMS = (FORM, SETTLED_FORM)
ALL_FORMS_FROM = {"standard": 4800, "tiny": 19200}
SLOWEST_RATE = 300  # one format
# Random requests by rate, equally many in each format: more where more fit into a second.
RANDOM = {300: 8, 1200: 24, 2400: 48, 4800: 128, 9600: 352, 19200: 648, 38400: 640, 115200: 648}
RANDOM_PIECE = 50

FAST_RANDOM = (
    *((300, "8O1", 1), (1200, "8N1", 3), (9600, "8O1", 20)),
    *((38400, "8N2", 40), (115200, "8E1", 60)),
)
FAST_FEW = ("read 16 coils", "start motor")


@dataclass(frozen=True)
class Piece:
    """One call; `cost` is roughly the simulated time, so that long pieces start first."""

    kind: str  # one of KINDS_OF_WORK
    baud: int
    form: str
    function: Callable[..., Outcome]
    more: dict[str, object] = field(default_factory=dict)
    cost: float = 0.0
    build: Build = STANDARD

    @property
    def name(self) -> str:
        number = f"-{self.more['part']}" if "part" in self.more else ""
        return f"{self.build.config}-{self.kind}-{self.baud}-{self.form}{number}"

    def run(self) -> Outcome:
        more = {key: value for key, value in self.more.items() if key != "part"}
        return self.function(self.baud, self.form, build=self.build, **more)


CARDS = (STANDARD, TINY)
KINDS_OF_WORK = (
    *("turnaround", "sizes", "phases", "random"),
    *("drive_faults", "gate", "overtaken", "conformance"),
)


def _turnaround(
    kind: str, baud: int, form: str, seed: int, repeats: int, names: tuple[str, ...], build: Build
) -> Piece:
    settled = form == SETTLED_FORM
    more = {"repeats": repeats, "names": names, "seed": seed, "settled": settled}
    cost = (repeats + 1) * len(names) / baud + settled * SETTLED_COST
    return Piece(kind, baud, form, turnaround, more, cost, build)


def _sizes(baud: int, form: str, seed: int, build: Build) -> Piece:
    names = tuple(SIZES)
    if baud < ALL_FORMS_FROM[build.config]:
        names = EXTREMES
    elif baud < EACH_SIZE_FROM:
        names = names[FORMAT_NAMES.index(form) :: len(FORMAT_NAMES)]
    return _turnaround("sizes", baud, form, seed, 1, names, build)


def _random(baud: int, seed: int, build: Build) -> Iterator[Piece]:
    """Equally many in each format."""
    share, part = RANDOM[baud] // len(FORMAT_NAMES), 0
    for form in FORMAT_NAMES:
        for left in range(share, 0, -RANDOM_PIECE):
            count = min(left, RANDOM_PIECE)
            more = {"count": count, "seed": seed + part, "part": part, "settled": part % 2 == 1}
            cost = count / baud + more["settled"] * SETTLED_COST
            yield Piece("random", baud, form, random_requests, more, cost, build)
            part += 1


def whole(seed: int) -> Iterator[Piece]:
    for build in CARDS:
        yield from _card(seed, build)


def _forms(baud: int, build: Build) -> tuple[str, ...]:
    if baud == SLOWEST_RATE:
        return (FORM,)
    return FORMAT_NAMES if baud >= ALL_FORMS_FROM[build.config] else SLOW_FORMS


def _card(seed: int, build: Build) -> Iterator[Piece]:
    for baud in BAUDS:
        for form in _forms(baud, build):
            quick = {"quick": form != FORM}
            repeats = REPEATS.get(baud, REPEATS_ELSE)
            yield _turnaround("turnaround", baud, form, seed, repeats, tuple(CASES), build)
            yield _sizes(baud, form, seed, build)
            yield Piece("gate", baud, form, gate, quick, (4 if form != FORM else 12) / baud, build)
            yield Piece("overtaken", baud, form, overtaken, quick, 5 / baud, build)
            if baud in PHASES_AT:
                yield _turnaround("phases", baud, form, seed + 1, PHASES, SLOWEST, build)
        yield from _random(baud, seed, build)
    for baud in DRIVE_FAULTS:
        yield Piece("drive_faults", baud, FORM, drive_faults, {"quick": False}, 60 / baud, build)
    for baud, form in CONFORMANCE:
        yield Piece("conformance", baud, form, conformance, {}, 80 / baud, build)


def fast(seed: int) -> Iterator[Piece]:
    """The part in the tests: a few of everything, and each case once on the small card."""

    def few(baud: int, form: str, names: tuple[str, ...], build: Build = STANDARD) -> Piece:
        return _turnaround("turnaround", baud, form, seed, 1, names, build)

    names = tuple(CASES)
    yield few(9600, FORM, names, TINY)
    for baud in BAUDS:
        yield Piece("gate", baud, FORM, gate, {"quick": True}, 3 / baud)
        if baud < 2400:
            yield few(baud, "8N2", FAST_FEW)
        elif baud < 9600:
            yield few(baud, FORM, names)
        else:
            for form in FORMAT_NAMES:
                yield few(baud, form, names)
        yield Piece("overtaken", baud, FORM, overtaken, {"quick": True}, 3 / baud)
    yield Piece("drive_faults", 115200, FORM, drive_faults, {"quick": True})
    for baud, form, count in FAST_RANDOM:
        yield Piece(
            "random", baud, form, random_requests, {"count": count, "seed": seed, "settled": baud > 19200}
        )
    for form in ("8N2", FORM):
        yield Piece("conformance", 19200, form, conformance)
