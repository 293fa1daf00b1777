# SPDX-License-Identifier: Apache-2.0
"""Frames of the recorded buses (tb/captures), for the fuzzer's traffic.

Gaps inside a frame are in bits. Silences are in parts of 3.5 characters, so that a frame stays one at a rate
whose silences have another length in bits (FRAME-1).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

from sw.rtu2fc.capture import characters, pieces
from tb.lib.recorded_buses import BUSES, Bus
from tb.model.wire import LineFormat

CLK_HZ = 2_000_000
GAP_BITS = 0.1  # a shorter one is the error of the sender
FAULTS = {"parity": "parity", "stop bit": "stop"}


@dataclass(frozen=True)
class RecordedFrame:
    """`gaps`, `flaws`: by character number, as in a case. `silence` before it: 1 is 3.5 characters."""

    data: bytes
    silence: float
    gaps: tuple[tuple[str, float], ...]
    flaws: tuple[tuple[str, str], ...]


def _frames(bus: Bus) -> list[RecordedFrame]:
    line = LineFormat(bus.baud, bus.form, CLK_HZ)
    found, before = [], 0.0
    for piece in pieces(characters(bus.edges(CLK_HZ), line), line):
        gaps, flaws = [], []
        for number, heard in enumerate(piece.heard):
            gap = (heard.start - piece.heard[number - 1].end) / line.bit if number else 0.0
            if gap > GAP_BITS:
                gaps.append((str(number), round(gap, 2)))
            if heard.fault:
                flaws.append((str(number), FAULTS[heard.fault]))
        silence = (piece.start - before) / line.bit / line.t35_bits
        found.append(RecordedFrame(piece.data, silence, tuple(gaps), tuple(flaws)))
        before = piece.end
    return found


@functools.cache
def recorded_frames() -> list[list[RecordedFrame]]:
    """The frames of each bus, in their order."""
    return [_frames(bus) for bus in BUSES]
