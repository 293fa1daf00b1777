# SPDX-License-Identifier: Apache-2.0
"""The bench's work in pieces for several processes: the whole, and the fast part."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from campaigns.bench.card import LATE, STANDARD, TINY, Build
from campaigns.bench.cases import CASES, SIZES, drive_faults, gate, overtaken, random_requests, turnaround
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
# All sizes: where t3.5 is shortest, and where it has the fewest bits.
SIZES_AT = ((115200, "8N1"), (38400, "8E1"), (19200, "8E1"))
# Random requests by rate, 5,000 in all and equally many in each format: more where more fit into a second.
RANDOM = {300: 16, 1200: 48, 2400: 100, 4800: 252, 9600: 700, 19200: 1300, 38400: 1284, 115200: 1300}
RANDOM_PIECE = 50

FAST_RANDOM = (
    *((300, "8O1", 1), (1200, "8N1", 3), (9600, "8O1", 20)),
    *((38400, "8N2", 40), (115200, "8E1", 60)),
)
FAST_FEW = ("read 16 coils", "start motor")


@dataclass(frozen=True)
class Piece:
    """One call; `cost` is roughly the simulated time, so that long pieces start first."""

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


KINDS = {STANDARD: "early", LATE: "late", TINY: "tiny"}
KINDS_OF_WORK = (*KINDS.values(), "random", "drive_faults", "gate", "overtaken", "conformance")


def _turnaround(
    baud: int,
    form: str,
    seed: int,
    repeats: int,
    names: tuple[str, ...],
    build: Build = STANDARD,
    **more: object,
) -> Piece:
    settled = form == SETTLED_FORM
    more |= {"repeats": repeats, "names": names, "seed": seed, "build": build, "settled": settled}
    cost = (repeats + 1) * len(names) / baud + settled * SETTLED_COST
    return Piece(KINDS[build], baud, form, turnaround, more, cost)


def _random(baud: int, seed: int) -> Iterator[Piece]:
    """Equally many in each format."""
    share, part = RANDOM[baud] // len(FORMAT_NAMES), 0
    for form in FORMAT_NAMES:
        for left in range(share, 0, -RANDOM_PIECE):
            count = min(left, RANDOM_PIECE)
            more = {"count": count, "seed": seed + part, "part": part, "settled": part % 2 == 1}
            cost = count / baud + more["settled"] * SETTLED_COST
            yield Piece("random", baud, form, random_requests, more, cost)
            part += 1


def whole(seed: int) -> Iterator[Piece]:
    names = tuple(CASES)
    for baud in BAUDS:
        repeats = REPEATS.get(baud, REPEATS_ELSE)
        for form in FORMAT_NAMES:
            quick = {"quick": form != FORM}
            yield _turnaround(baud, form, seed, repeats, names)
            yield _turnaround(baud, form, seed, repeats, names, TINY)
            yield Piece("gate", baud, form, gate, quick, (4 if form != FORM else 12) / baud)
            yield Piece("overtaken", baud, form, overtaken, quick, 5 / baud)
        yield _turnaround(baud, FORM, seed, repeats, names, LATE)
        yield from _random(baud, seed)
    for baud, form in SIZES_AT:
        for build in (STANDARD, TINY):
            yield _turnaround(baud, form, seed, 2, tuple(SIZES), build, part="sizes")
    for baud in DRIVE_FAULTS:
        yield Piece("drive_faults", baud, FORM, drive_faults, {"quick": False}, 60 / baud)
    for baud, form in CONFORMANCE:
        yield Piece("conformance", baud, form, conformance, cost=80 / baud)


def fast(seed: int) -> Iterator[Piece]:
    names = tuple(CASES)
    for baud in BAUDS:
        yield Piece("gate", baud, FORM, gate, {"quick": True}, 3 / baud)
        if baud < 2400:
            yield _turnaround(baud, "8N2", seed, 1, FAST_FEW)
        elif baud < 9600:
            yield _turnaround(baud, FORM, seed, 1, names)
        else:
            for form in FORMAT_NAMES:
                yield _turnaround(baud, form, seed, 1, names)
        yield Piece("overtaken", baud, FORM, overtaken, {"quick": True}, 3 / baud)
    yield Piece("drive_faults", 115200, FORM, drive_faults, {"quick": True})
    for baud, form, count in FAST_RANDOM:
        yield Piece(
            "random", baud, form, random_requests, {"count": count, "seed": seed, "settled": baud > 19200}
        )
    for form in ("8N2", FORM):
        yield Piece("conformance", 19200, form, conformance)
