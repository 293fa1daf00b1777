# SPDX-License-Identifier: Apache-2.0
"""Takes one line of the card apart: its bursts, and the accuracy of each edge.

Unit of time: cycles of the card's clock, as floats where a bit is no whole number of them.
"""

from __future__ import annotations

from itertools import pairwise

from rtl.sources import configurations
from sim.harness.pins import decode
from sw.rtu2fc import switches
from tb.model.wire import CardCharacter, LineFormat

CLK_HZ = configurations()["standard"]["clk_hz"]
FORMAT_NAMES = tuple(switches.FORMS)
BAUDS = tuple(sorted(switches.BAUDS))
BAUD_ERROR = 0.001  # LINE-4
# Uncertainty of an edge and of its reference: one cycle of the clock.
GRAIN = 1.0

Edges = list[tuple[float, int]]  # time and new level, in rising order
Spans = list[tuple[float, float]]  # driver on, driver off


def off_by(line: LineFormat, bits: float) -> float:
    """Permitted error of an edge so many bits after another edge (LINE-4)."""
    return GRAIN + BAUD_ERROR * bits * line.bit


def t35(line: LineFormat) -> float:
    """The silence in cycles."""
    return line.t35_bits * line.bit


def within(edges: Edges, span: tuple[float, float]) -> Edges:
    return [edge for edge in edges if span[0] <= edge[0] <= span[1]]


def bursts(line: LineFormat, edges: Edges, spans: Spans) -> list[list[CardCharacter]]:
    """The characters, split where the driver was off; a driver on without characters is no burst."""
    split = [decode(line, within(edges, span), span[0]) for span in spans]
    return [burst for burst in split if burst]


def edges_of(line: LineFormat, data: bytes, start: float) -> Edges:
    """Expected edges of the bytes, without gaps."""
    edges, level = [], 1
    for number, byte in enumerate(data):
        for i, bit in enumerate(line.levels(byte)):
            if bit != level:
                edges.append((start + (number * line.character_bits + i) * line.bit, bit))
                level = bit
    return edges


def faults(line: LineFormat, edges: Edges, spans: Spans) -> list[str]:
    """Errors in the card's output (LINE-4, LINE-6, FC-8).

    Checked are bit lengths, parity, stop bits, gaps, level changes with the driver off, and a driver that is
    on without characters."""
    found = []
    stray = [at for at, _ in edges if not any(on <= at <= off for on, off in spans)]
    if stray:
        found.append(f"{len(stray)} edges with the driver off")
    for span in spans:
        sent = within(edges, span)
        burst = decode(line, sent, span[0])
        if not burst:
            found.append(f"driver on for {(span[1] - span[0]) / line.bit:.2f} bits without a character")
            continue
        found += [f"character {i} is malformed" for i, c in enumerate(burst) if not c.good]
        for number, (one, next_one) in enumerate(pairwise(burst)):
            gap = next_one.start - one.end
            if abs(gap) > off_by(line, line.character_bits):
                found.append(f"{gap / line.bit:.3f} bits between characters {number} and {number + 1}")
        for number, character in enumerate(burst):
            until = burst[number + 1].start if number + 1 < len(burst) else float("inf")
            seen = [edge for edge in sent if character.start <= edge[0] < until]
            right = edges_of(line, bytes([character.byte]), character.start)
            if [level for _, level in seen] != [level for _, level in right]:
                found.append(f"character {number} has {len(seen)} edges instead of {len(right)}")
                continue
            for (at, _), (due, _) in zip(seen, right, strict=True):
                if abs(at - due) > off_by(line, (due - character.start) / line.bit):
                    found.append(f"character {number}: an edge {(at - due) / line.bit:.3f} bits off (LINE-4)")
    return found
