# SPDX-License-Identifier: Apache-2.0
"""What a receiver with 16 samples a bit can bear, by arithmetic alone; docs/reports/line-quality.md derives
it.

The middle one of the three votes stands SAMPLE ticks after the tick in which the start bit was first seen,
and that tick comes between no and one tick after the edge. So each limit is a span: at its beginning the
first characters can go wrong, at its end all that have the edge in question do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sim.harness.pins import FORMS

TICKS = 16
SAMPLE = 7  # ticks after the tick that saw the start bit
REARM = SAMPLE + 2
FILTER_MAJORITY = 5  # of nine samples: rtl/glitch_filter.v
LINE_4 = 0.00041  # how far the card's own rate may be off: rtl/baud_base.v
# A tick comes with a whole clock, and so does an edge of the far end.
GRAIN_CLOCKS = 1.5

Span = tuple[float, float]


def stop_bit(form: str) -> int:
    """Number of the first stop bit, the last one looked at; the start bit is 0."""
    return 9 + (form[1] != "N")


def last_end(form: str) -> int:
    """Bits from the start edge to the last edge that may come too early.

    It is the next start bit; with two stop bits the end of the last data bit: nobody looks at the second.
    """
    return 9 if form == "8N2" else stop_bit(form) + 1


def _slow(form: str) -> Span:
    first, last = (ticks / TICKS / stop_bit(form) for ticks in (SAMPLE, SAMPLE + 1))
    return 1 - 1 / (1 + first), 1 - 1 / (1 + last)


def _fast(form: str) -> Span:
    """Where the next start bit follows the first stop bit, the receiver has to be ready for it: it is idle
    again a tick after the last vote, so a character takes it no less than REARM ticks of its last bit."""
    spare = TICKS - (SAMPLE + 1 if form == "8N2" else REARM)
    first, last = (ticks / TICKS / last_end(form) for ticks in (spare, spare + 1))
    return 1 / (1 - first) - 1, 1 / (1 - last) - 1


def _jitter(form: str) -> Span:
    """Start edge and another one against each other."""
    return SAMPLE / TICKS / 2, (SAMPLE + 1) / TICKS / 2


def _glitch(form: str) -> Span:
    """Four ticks never hold five samples, five ticks always do."""
    return (FILTER_MAJORITY - 1) / TICKS, FILTER_MAJORITY / TICKS


def _late_rise(form: str) -> Span:
    return SAMPLE / TICKS, (SAMPLE + 1) / TICKS


def _late_fall(form: str) -> Span:
    return (TICKS - SAMPLE - 1) / TICKS, (TICKS - SAMPLE) / TICKS


@dataclass(frozen=True)
class Quantity:
    """One way for a line to be bad. `promise`: of LINE-5; `unit`: what a 1 is worth in the tables."""

    name: str
    title: str
    theory: Callable[[str], Span]
    resolution: float
    promise: float = 0.0
    unit: str = "bit"

    def span(self, form: str, clocks_a_bit: float) -> Span:
        """Where a measured limit has to be: theory, and what it leaves out."""
        first, last = self.theory(form)
        grain = GRAIN_CLOCKS / clocks_a_bit + LINE_4 * last_end(form)
        if self.unit == "%":
            grain = GRAIN_CLOCKS / clocks_a_bit / stop_bit(form) + 2 * LINE_4
        return first - grain - self.resolution, last + grain + self.resolution


QUANTITIES = {
    quantity.name: quantity
    for quantity in (
        Quantity("slow", "sender slow", _slow, 0.0005, 0.04, "%"),
        Quantity("fast", "sender fast", _fast, 0.0005, 0.04, "%"),
        Quantity("jitter", "jitter of each edge, ±", _jitter, 0.004),
        Quantity("glitch", "width of a glitch", _glitch, 0.004, 0.25),
        Quantity("late rise", "rising edges late", _late_rise, 0.004),
        Quantity("late fall", "falling edges late", _late_fall, 0.004),
    )
}


def jitter_left(form: str, error: float) -> float:
    """Where the first errors come when the sender's rate is off as well."""
    if error >= _fast(form)[0]:
        return 0.0
    length = 1 / (1 + error) - 1
    late = SAMPLE / TICKS - stop_bit(form) * max(length, 0.0)
    early = (TICKS - SAMPLE - 1) / TICKS - last_end(form) * max(-length, 0.0)
    return max(0.0, min(late, early) / 2)


ALL_FORMS = tuple(sorted(FORMS))
