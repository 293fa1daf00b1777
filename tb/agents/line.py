# SPDX-License-Identifier: Apache-2.0
"""A serial line in plain Python: its format, the edges of characters and of faults, decoded characters.

Times are picoseconds, widths and gaps are bit times. `Format` is baud rate, parity and stop bits of a line.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

PS_PER_S = 1_000_000_000_000


@dataclass(frozen=True)
class Format:
    """Baud rate, parity ("N", "E" or "O") and stop bits of a line."""

    baud: int = 9600
    parity: str = "N"
    stop_bits: int = 2

    @classmethod
    def named(cls, baud: int, name: str) -> Format:
        """From the usual short form, for example `named(19200, "8E1")`."""
        assert name[0] == "8" and name[1] in "NEO" and name[2] in "12", name
        return cls(baud, name[1], int(name[2]))

    @property
    def bit_ps(self) -> float:
        return PS_PER_S / self.baud

    @property
    def parity_bits(self) -> int:
        return 0 if self.parity == "N" else 1

    @property
    def bits(self) -> int:
        """Bits of one character, start and stop bits included."""
        return 1 + 8 + self.parity_bits + self.stop_bits

    @property
    def character_ps(self) -> float:
        return self.bits * self.bit_ps

    def parity_bit(self, byte: int) -> int:
        return (byte.bit_count() + (self.parity == "O")) & 1

    def levels(self, byte: int) -> list[int]:
        """Level of the line in each bit of one character."""
        data = [byte >> i & 1 for i in range(8)]
        return [0, *data, *([self.parity_bit(byte)] * self.parity_bits), *([1] * self.stop_bits)]

    def __str__(self) -> str:
        return f"{self.baud} 8{self.parity}{self.stop_bits}"


@dataclass
class Flaws:
    """Faults of a transmission; the default is none.

    gaps          idle bit times put before a character, by its number
    bad_parity    numbers of the characters whose parity bit is inverted
    bad_stop      numbers of the characters whose first stop bit is low
    ppm           error of the sender's clock, + is faster
    jitter        each edge moves by up to this part of a bit, either way
    jitter_seed   seed of the jitter
    low_stretch   every low phase is longer by this part of a bit (duty distortion; negative is shorter)
    glitches      (place, width) in bits from the first start edge: the line is inverted there
    """

    gaps: dict[int, float] = field(default_factory=dict)
    bad_parity: Sequence[int] = ()
    bad_stop: Sequence[int] = ()
    ppm: float = 0.0
    jitter: float = 0.0
    jitter_seed: int = 0
    low_stretch: float = 0.0
    glitches: Sequence[tuple[float, float]] = ()


def waveform(fmt: Format, data: Iterable[int], flaws: Flaws) -> tuple[list[tuple[float, int]], float]:
    """The line as a list of (time in ps from the first start edge, new level), and its length in ps.

    Needs no simulator: every edge is decided before the first one is sent.
    """
    bit = fmt.bit_ps / (1 + flaws.ppm * 1e-6)
    level, at, edges = 1, 0.0, []
    for number, byte in enumerate(data):
        at += flaws.gaps.get(number, 0.0) if number else 0.0
        bits = fmt.levels(byte)
        if number in flaws.bad_parity:
            assert fmt.parity_bits, f"{fmt} has no parity bit"
            bits[9] ^= 1
        if number in flaws.bad_stop:
            bits[9 + fmt.parity_bits] = 0
        for value in bits:
            if value != level:
                edges.append((at, value))
                level = value
            at += 1
        if level == 0:  # the only stop bit is bad: the line returns to high one bit later
            edges.append((at, 1))
            level, at = 1, at + 1
    rng = random.Random(flaws.jitter_seed)
    moved = []
    for place, value in edges:
        place += rng.uniform(-flaws.jitter, flaws.jitter) if flaws.jitter else 0.0
        moved.append(place + (flaws.low_stretch if value else 0.0))
    # A glitch inverts the level twice; edges are kept as places where the level changes.
    toggles = sorted(moved + [t for place, width in flaws.glitches for t in (place, place + width)])
    shift = -min(0.0, toggles[0]) if toggles else 0.0
    played, level = [], 1
    for place in toggles:
        level ^= 1
        played.append(((place + shift) * bit, level))
    return played, (at + shift) * bit


@dataclass(frozen=True)
class Character:
    """One character as seen on the line.

    start_ps is its start edge, end_ps the nominal end of its last stop bit.
    """

    byte: int
    start_ps: int
    end_ps: int
    parity_ok: bool
    stop_ok: bool

    @property
    def ok(self) -> bool:
        return self.parity_ok and self.stop_ok


@dataclass(frozen=True)
class Frame:
    """Characters without a long silence between them."""

    characters: tuple[Character, ...]

    @property
    def data(self) -> bytes:
        return bytes(c.byte for c in self.characters)

    @property
    def start_ps(self) -> int:
        return self.characters[0].start_ps

    @property
    def end_ps(self) -> int:
        return self.characters[-1].end_ps

    @property
    def ok(self) -> bool:
        return all(c.ok for c in self.characters)

    @property
    def largest_gap_ps(self) -> int:
        """Longest idle time between two of its characters."""
        pairs = zip(self.characters, self.characters[1:], strict=False)
        return max((b.start_ps - a.end_ps for a, b in pairs), default=0)

    def __str__(self) -> str:
        return self.data.hex(" ").upper()


@dataclass(frozen=True)
class Pulse:
    """DE high from rise to fall; fall is None while DE is high."""

    rise_ps: int
    fall_ps: int | None
