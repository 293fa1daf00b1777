# SPDX-License-Identifier: Apache-2.0
"""Judges the edges of a frame that a device sent: rate, edges, gaps, its distance from the request, DE.

The limits are those of "MODBUS over Serial Line" V1.02: 1 % of the rate (page 20), 1.5 and 3.5 characters
(page 13). Where that document has no number, the limit is ours: edges, and DE around a frame.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from . import rtu
from .line import Character, Format, Frame, Pulse

if TYPE_CHECKING:
    from .uart import UartMonitor  # needs cocotb; a Trace does not


class Trace:
    """A recorded pin: its edges as (ps, new level), decoded without a simulator. The line is idle before."""

    def __init__(self, fmt: Format, edges: Sequence[tuple[int, int]]):
        self.fmt = fmt
        self.edges = list(edges)
        self._times = [at for at, _ in self.edges]
        self.characters = list(self._decode())

    def level_at(self, when_ps: float) -> int:
        place = bisect_right(self._times, when_ps)
        return self.edges[place - 1][1] if place else 1

    def edges_of(self, frame: Frame) -> list[tuple[int, int]]:
        """The edges of a frame, from its first start edge on."""
        return [(at, level) for at, level in self.edges if frame.start_ps <= at < frame.end_ps]

    def frame(self) -> Frame | None:
        """All characters as one frame."""
        return Frame(tuple(self.characters)) if self.characters else None

    def _decode(self) -> Iterator[Character]:
        fmt, free = self.fmt, float("-inf")
        for start, level in self.edges:
            if level or start < free:
                continue
            levels = [self.level_at(start + (i + 0.5) * fmt.bit_ps) for i in range(fmt.bits)]
            if levels[0]:
                continue  # a pulse of less than half a bit
            byte = sum(levels[1 + i] << i for i in range(8))
            parity_ok = not fmt.parity_bits or levels[9] == fmt.parity_bit(byte)
            stop_ok = all(levels[9 + fmt.parity_bits :])
            yield Character(byte, start, round(start + fmt.character_ps), parity_ok, stop_ok)
            free = start + (fmt.bits - 0.5) * fmt.bit_ps


@dataclass(frozen=True)
class Limits:
    """Limits of a frame; None: not judged.

    rate          error of the bit rate
    edge_bits     deviation of an edge from its place in the character, at the rate of the line
    early_bits    how much sooner than t3.5 after the request a reply may start
    de_lead_bits  longest time of DE before the first start bit
    de_lag_bits   longest time of DE after the last stop bit
    de_cut_bits   how much of the last stop bit may lie after the end of DE
    """

    rate: float | None = 0.01
    edge_bits: float | None = 0.25
    early_bits: float | None = 0.25
    de_lead_bits: float | None = None
    de_lag_bits: float | None = 1.0
    de_cut_bits: float | None = 0.1


@dataclass(frozen=True)
class Edges:
    """Measured values of one frame. Bits are those of the line; `rate` is + when the sender is slower."""

    rate: float
    worst_edge_bits: float
    largest_gap_bits: float
    bad_characters: int
    de_lead_bits: float | None
    de_lag_bits: float | None


def measure(monitor: UartMonitor | Trace, frame: Frame, pulses: Sequence[Pulse] | None = None) -> Edges:
    """Measures a frame. `pulses` are those of DE; without them the two values of DE are None."""
    fmt = monitor.fmt
    bit, taken, due, worst = fmt.bit_ps, 0.0, 0, 0.0
    edges = monitor.edges_of(frame)
    for character in frame.characters:
        places = [at - character.start_ps for at, _ in edges if character.start_ps < at < character.end_ps]
        worst = max([worst, *(abs(place / bit - round(place / bit)) for place in places)])
        if places:
            taken += places[-1]
            due += round(places[-1] / bit)
    pulse = next((p for p in pulses or () if p.rise_ps <= frame.start_ps < (p.fall_ps or 1 << 62)), None)
    return Edges(
        rate=taken / (due * bit) - 1 if due else 0.0,
        worst_edge_bits=worst,
        largest_gap_bits=max(0.0, frame.largest_gap_ps / bit),
        bad_characters=sum(not character.ok for character in frame.characters),
        de_lead_bits=(frame.start_ps - pulse.rise_ps) / bit if pulse else None,
        de_lag_bits=(pulse.fall_ps - frame.end_ps) / bit if pulse and pulse.fall_ps else None,
    )


def judge(
    monitor: UartMonitor | Trace,
    frame: Frame,
    *,
    request_end_ps: float | None = None,
    pulses: Sequence[Pulse] | None = None,
    limits: Limits | None = None,
) -> list[str]:
    """Faults of a frame, each in one line; an empty list is a good frame.

    request_end_ps: end of the request's last stop bit, if the frame is a reply.
    """
    limits = limits or Limits()
    fmt, found = monitor.fmt, measure(monitor, frame, pulses)
    faults = []
    if found.bad_characters:
        faults.append(f"{found.bad_characters} characters with a wrong parity or stop bit")
    if limits.rate is not None and abs(found.rate) > limits.rate:
        faults.append(f"rate off by {100 * found.rate:+.2f} %, limit {100 * limits.rate:g} %")
    if limits.edge_bits is not None and found.worst_edge_bits > limits.edge_bits:
        faults.append(f"an edge {found.worst_edge_bits:.2f} bits off its place, limit {limits.edge_bits:g}")
    longest = rtu.t15_ps(fmt.baud, fmt.bits) / fmt.bit_ps
    if found.largest_gap_bits > longest:
        faults.append(f"a gap of {found.largest_gap_bits:.1f} bits inside the frame, limit {longest:.1f}")
    if limits.early_bits is not None and request_end_ps is not None:
        faults += _early(fmt, frame, request_end_ps, limits.early_bits)
    if pulses is not None:
        faults += _direction(found, limits)
    return faults


def _early(fmt: Format, frame: Frame, request_end_ps: float, allowed_bits: float) -> list[str]:
    after = (frame.start_ps - request_end_ps) / fmt.bit_ps
    due = rtu.t35_ps(fmt.baud, fmt.bits) / fmt.bit_ps
    return (
        [f"starts {after:.1f} bits after the request, t3.5 is {due:.1f}"]
        if after < due - allowed_bits
        else []
    )


def _direction(found: Edges, limits: Limits) -> list[str]:
    lead, lag = found.de_lead_bits, found.de_lag_bits
    if lead is None:
        return ["DE is low at its first start bit"]
    faults = []
    if limits.de_lead_bits is not None and lead > limits.de_lead_bits:
        faults.append(f"DE rises {lead:.2f} bits before the first start bit, limit {limits.de_lead_bits:g}")
    if lag is None:
        return [*faults, "DE is still high"]
    if limits.de_lag_bits is not None and lag > limits.de_lag_bits:
        faults.append(f"DE falls {lag:.2f} bits after the last stop bit, limit {limits.de_lag_bits:g}")
    if limits.de_cut_bits is not None and -lag > limits.de_cut_bits:
        faults.append(f"DE falls {-lag:.2f} bits before the end of the last stop bit")
    return faults
