# SPDX-License-Identifier: Apache-2.0
"""Decodes one line: rate and format, the characters in its edges, and the accuracy of each edge.

Unit of time: cycles of the card's clock, as floats where a bit is no whole number of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from regs.generated.card_tables import DRIVE_BAUD, DRIVE_FORMAT, EXTENDED_FORMATS, EXTENDED_RATES
from rtl.sources import configurations

CLK_HZ = configurations()["standard"]["clk_hz"]
NAMES = {"none1": "8N1", "none2": "8N2", "even1": "8E1", "odd1": "8O1"}
FORMAT_NAMES = tuple(NAMES[f"{form.parity}{form.stop_bits}"] for form in EXTENDED_FORMATS.values())
BAUDS = tuple(sorted(rate.baud for rate in EXTENDED_RATES.values()))
BAUD_ERROR = 0.001  # LINE-4
# Uncertainty of an edge and of its reference: one cycle of the clock.
GRAIN = 1.0

Edges = list[tuple[float, int]]  # time and new level, in rising order
Spans = list[tuple[float, float]]  # driver on, driver off


@dataclass(frozen=True)
class Line:
    """Rate and format of one line. `bit` in cycles, silences in bits."""

    baud: int
    parity: str = "none"
    stop_bits: int = 2
    clk_hz: int = CLK_HZ

    @classmethod
    def of(cls, baud: int, form: str, clk_hz: int = CLK_HZ) -> Line:
        parity = {"N": "none", "E": "even", "O": "odd"}[form[1]]
        return cls(baud, parity, int(form[2]), clk_hz)

    @classmethod
    def of_drive(cls, clk_hz: int = CLK_HZ) -> Line:
        return cls(DRIVE_BAUD, DRIVE_FORMAT.parity, DRIVE_FORMAT.stop_bits, clk_hz)

    @property
    def name(self) -> str:
        return NAMES[f"{self.parity}{self.stop_bits}"]

    @property
    def bit(self) -> float:
        return self.clk_hz / self.baud

    @property
    def character_bits(self) -> int:
        """Bits of a character as it is sent."""
        return 1 + 8 + (self.parity != "none") + self.stop_bits

    @property
    def t15_bits(self) -> float:
        return 750e-6 * self.baud if self.baud > 19200 else 1.5 * self.character_bits

    @property
    def half_bits(self) -> float:
        return self.t15_bits / 3

    @property
    def t35_bits(self) -> float:
        return 1750e-6 * self.baud if self.baud > 19200 else 3.5 * self.character_bits

    @property
    def t35(self) -> float:
        return self.t35_bits * self.bit

    def switches(self) -> str:
        """Of a card with EXTENDED_SWITCHES = 1."""
        rate = next(key for key, rate in EXTENDED_RATES.items() if rate.baud == self.baud)
        own = (self.parity, self.stop_bits)
        return rate + next(k for k, f in EXTENDED_FORMATS.items() if (f.parity, f.stop_bits) == own)

    def parity_bit(self, byte: int) -> int:
        return byte.bit_count() & 1 ^ (self.parity == "odd")

    def character(self, byte: int, bad_parity: bool = False, bad_stop: bool = False) -> list[int]:
        """Levels of the bits. A wrong stop bit is the first stop bit at 0."""
        bits = [0, *(byte >> i & 1 for i in range(8))]
        if self.parity != "none":
            bits.append(self.parity_bit(byte) ^ bad_parity)
        return bits + [int(not bad_stop)] + [1] * (self.stop_bits - 1)

    def off_by(self, bits: float) -> float:
        """Permitted error of an edge so many bits after another edge (LINE-4)."""
        return GRAIN + BAUD_ERROR * bits * self.bit


@dataclass(frozen=True)
class Character:
    start: float
    end: float  # end of the last stop bit by the line's rate
    value: int
    good: bool  # parity and stop bits


def characters(line: Line, edges: Edges) -> list[Character]:
    """Decodes the edges, each bit sampled in its middle."""
    found, at = [], 0
    while at < len(edges):
        start, level = edges[at]
        if level:
            at += 1
            continue
        levels, i = [], at
        for number in range(line.character_bits):
            middle = start + (number + 0.5) * line.bit
            while i < len(edges) and edges[i][0] <= middle:
                level = edges[i][1]
                i += 1
            levels.append(level)
        value = sum(bit << k for k, bit in enumerate(levels[1:9]))
        good = levels == line.character(value)
        found.append(Character(start, start + line.character_bits * line.bit, value, good))
        at = i
    return found


def within(edges: Edges, span: tuple[float, float]) -> Edges:
    return [edge for edge in edges if span[0] <= edge[0] <= span[1]]


def bursts(line: Line, edges: Edges, spans: Spans) -> list[list[Character]]:
    """The characters, split where the driver was off; a driver on without characters is no burst."""
    split = [characters(line, within(edges, span)) for span in spans]
    return [burst for burst in split if burst]


def edges_of(line: Line, data: bytes, start: float) -> Edges:
    """Expected edges of the bytes, without gaps."""
    edges, level = [], 1
    for number, byte in enumerate(data):
        for i, bit in enumerate(line.character(byte)):
            if bit != level:
                edges.append((start + (number * line.character_bits + i) * line.bit, bit))
                level = bit
    return edges


def faults(line: Line, edges: Edges, spans: Spans) -> list[str]:
    """Errors in the card's output (LINE-4, LINE-6, FC-8).

    Checked are bit lengths, parity, stop bits, gaps, level changes with the driver off, and a driver that is
    on without characters."""
    found = []
    stray = [at for at, _ in edges if not any(on <= at <= off for on, off in spans)]
    if stray:
        found.append(f"{len(stray)} edges with the driver off")
    for span in spans:
        sent = within(edges, span)
        burst = characters(line, sent)
        if not burst:
            found.append(f"driver on for {(span[1] - span[0]) / line.bit:.2f} bits without a character")
            continue
        found += [f"character {i} is malformed" for i, c in enumerate(burst) if not c.good]
        for number, (one, next_one) in enumerate(pairwise(burst)):
            gap = next_one.start - one.end
            if abs(gap) > line.off_by(line.character_bits):
                found.append(f"{gap / line.bit:.3f} bits between characters {number} and {number + 1}")
        for number, character in enumerate(burst):
            until = burst[number + 1].start if number + 1 < len(burst) else float("inf")
            seen = [edge for edge in sent if character.start <= edge[0] < until]
            right = edges_of(line, bytes([character.value]), character.start)
            if [level for _, level in seen] != [level for _, level in right]:
                found.append(f"character {number} has {len(seen)} edges instead of {len(right)}")
                continue
            for (at, _), (due, _) in zip(seen, right, strict=True):
                if abs(at - due) > line.off_by((due - character.start) / line.bit):
                    found.append(f"character {number}: an edge {(at - due) / line.bit:.3f} bits off (LINE-4)")
    return found
