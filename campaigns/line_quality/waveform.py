# SPDX-License-Identifier: Apache-2.0
"""Characters on a bad line. Unit of time: clocks; of the faults: bits of the nominal rate."""

from __future__ import annotations

import random
from dataclasses import dataclass

from tb.model.wire import LineFormat

# "Beside an edge" means within the filter's window.
BESIDE_BITS = 0.3
BEFORE_START_BITS = 0.3


@dataclass(frozen=True)
class Badness:
    """error: of the sender's rate. jitter: each edge comes early or late by this amount, at random: the worst
    case of a jitter with that peak. glitch: the line is inverted for this time, once in every second
    character. late_rise, late_fall: delay of these edges against the others, as from a slow opto-coupler."""

    error: float = 0.0
    jitter: float = 0.0
    glitch: float = 0.0
    late_rise: float = 0.0
    late_fall: float = 0.0

    @classmethod
    def of(cls, quantity: str, amount: float) -> Badness:
        if quantity in ("slow", "fast"):
            return cls(error=-amount if quantity == "slow" else amount)
        return cls(**{quantity.replace(" ", "_"): amount})


def edges(
    line: LineFormat, data: bytes, start: float, bad: Badness, rng: random.Random
) -> tuple[list[tuple[float, int]], float]:
    """The edges of these characters without gaps, and the end of the last character."""
    bit, at, level = line.bit / (1 + bad.error), start, 1
    toggles: list[float] = []
    glitches: list[float] = []
    for number, byte in enumerate(data):
        own: list[float] = []
        for i, value in enumerate(line.levels(byte)):
            if value != level:
                late = bad.late_rise if value else bad.late_fall
                own.append(at + i * bit + (late + rng.choice((-bad.jitter, bad.jitter))) * line.bit)
                level = value
        if bad.glitch and number % 2 == 0:
            begin = _glitch(line, at, own, bad.glitch, rng)
            glitches += [begin, begin + bad.glitch * line.bit]
        toggles += own
        at += line.character_bits * bit
        if level == 0:
            raise AssertionError("a character ends low")
    # Inverting means toggling twice.
    toggles = sorted(toggles + glitches)
    return [(when, i % 2) for i, when in enumerate(toggles)], at


def _glitch(line: LineFormat, start: float, own: list[float], width: float, rng: random.Random) -> float:
    """Start of a glitch: from the start bit to the end of the first stop bit, or beside or across an edge."""
    bits = 10 + line.parity
    if rng.random() < 0.5:
        return start + rng.uniform(-BEFORE_START_BITS, bits - width) * line.bit
    edge, beside = rng.choice(own), rng.uniform(0, BESIDE_BITS) * line.bit
    return edge + rng.choice((-beside - width * line.bit, beside, -rng.uniform(0, width) * line.bit))
