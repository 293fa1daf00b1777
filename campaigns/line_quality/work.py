# SPDX-License-Identifier: Apache-2.0
"""Scope of the measurement: lines, clocks, and the part in `make test`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from campaigns.fuzz.case import clk_hz
from campaigns.line_quality.limits import ALL_FORMS, QUANTITIES
from campaigns.line_quality.measure import OWN, Limit, Target, measured
from regs.generated.card_tables import DRIVE_BAUD
from rtl.sources import configurations
from sim.harness.pins import BAUDS
from tb.model.wire import LineFormat

CARD_HZ = configurations()["standard"]["clk_hz"]
FORM = "8E1"  # the longest character, where one format is enough
DRIVE_NETWORK_BAUD = 19200  # network rate for requests to the drive
# From this rate on all formats are measured at the card's clock. Below it, a bit has so many clocks that one
# format is enough.
ALL_FORMS_FROM = 9600
# Characters per point, in clocks, within these bounds.
POINT_CLOCKS = 1_200_000
FEWEST, MOST = 32, 400
# Time of a character with its part of the silence and of the reply.
CHARACTER_BITS = 13
FAST_CHARACTERS, FAST_DRIVE_CHARACTERS = 150, 40
# Quantities with a promise in LINE-5; at 300 bit/s and 12 MHz, half a million clocks a character, no others.
PROMISED = tuple(name for name, quantity in QUANTITIES.items() if quantity.promise)
SLOWEST = 300


@dataclass(frozen=True)
class Piece:
    """All limits of a line, as a unit of work for a process."""

    line: LineFormat
    characters: int
    of_drive: bool = False
    quantities: tuple[str, ...] = tuple(QUANTITIES)

    @property
    def name(self) -> str:
        where = "drive" if self.of_drive else "network"
        return f"{where}-{self.line.baud}-{self.line.form}-{self.line.clk_hz}"

    @property
    def cost(self) -> float:
        bits = self.line.clk_hz / (DRIVE_BAUD if self.of_drive else self.line.baud)
        return self.characters * len(self.quantities) * bits

    def run(self, seed: int, target: Target = OWN) -> list[Limit]:
        return measured(
            self.line,
            of_drive=self.of_drive,
            characters=self.characters,
            seed=seed,
            target=target,
            quantities=self.quantities,
        )


def _piece(baud: int, form: str, clock: int, of_drive: bool = False) -> Piece:
    characters = POINT_CLOCKS / (clock / (DRIVE_BAUD if of_drive else baud) * CHARACTER_BITS)
    quantities = PROMISED if baud == SLOWEST and clock == CARD_HZ else tuple(QUANTITIES)
    return Piece(
        LineFormat(baud, form, clock), round(min(max(characters, FEWEST), MOST)), of_drive, quantities
    )


def whole() -> Iterator[Piece]:
    for baud in sorted(BAUDS):
        for form in ALL_FORMS:
            yield _piece(baud, form, clk_hz(baud))
            if form == FORM or baud >= ALL_FORMS_FROM:
                yield _piece(baud, form, CARD_HZ)
    for clock in (clk_hz(DRIVE_NETWORK_BAUD), CARD_HZ):
        yield _piece(DRIVE_NETWORK_BAUD, FORM, clock, of_drive=True)


# 64 clocks a bit; the clocks a bit of 115200 bit/s at 12 MHz; the drive line.
FAST = (
    *(Piece(LineFormat(115200, form, clk_hz(115200)), FAST_CHARACTERS) for form in ("8E1", "8N1")),
    Piece(LineFormat(19200, "8N2", clk_hz(19200)), FAST_CHARACTERS),
    Piece(
        LineFormat(DRIVE_NETWORK_BAUD, FORM, clk_hz(DRIVE_NETWORK_BAUD)),
        FAST_DRIVE_CHARACTERS,
        of_drive=True,
        quantities=PROMISED,
    ),
)
