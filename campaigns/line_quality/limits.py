# SPDX-License-Identifier: Apache-2.0
"""Limits of a receiver with 16 samples a bit, by arithmetic alone.

The middle vote of three comes SAMPLE ticks after the tick that first saw the start bit. That tick comes
between zero and one tick after the edge. So each limit is a span: at its beginning the first characters can
fail, at its end all characters with the edge in question fail.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sim.harness.pins import FORMS

TICKS = 16
SAMPLE = 7  # ticks after the tick that saw the start bit
REARM = SAMPLE + 2
FILTER_MAJORITY = 5  # of nine samples: rtl/glitch_filter.v
LINE_4 = 0.00041  # greatest error of the card's own rate: rtl/baud_base.v
# A tick comes with a whole clock, and so does an edge of the far end.
GRAIN_CLOCKS = 1.5

Span = tuple[float, float]


def stop_bit(form: str) -> int:
    """Number of the first stop bit, the last bit that is checked; the start bit is 0."""
    return 9 + (form[1] != "N")


def last_end(form: str) -> int:
    """Bits from the start edge to the last edge that may come too early.

    That edge is the next start bit; with two stop bits it is the end of the last data bit, because the second
    stop bit is not checked.
    """
    return 9 if form == "8N2" else stop_bit(form) + 1


def _slow(form: str) -> Span:
    first, last = (ticks / TICKS / stop_bit(form) for ticks in (SAMPLE, SAMPLE + 1))
    return 1 - 1 / (1 + first), 1 - 1 / (1 + last)


def _fast(form: str) -> Span:
    """The receiver must be idle when the next start bit follows the first stop bit. It is idle one tick after
    the last vote, so a character takes at least REARM ticks of its last bit."""
    spare = TICKS - (SAMPLE + 1 if form == "8N2" else REARM)
    first, last = (ticks / TICKS / last_end(form) for ticks in (spare, spare + 1))
    return 1 / (1 - first) - 1, 1 / (1 - last) - 1


def _jitter(form: str) -> Span:
    """Start edge and another edge against each other."""
    return SAMPLE / TICKS / 2, (SAMPLE + 1) / TICKS / 2


def _glitch(form: str) -> Span:
    """Four ticks never contain five samples, five ticks always do."""
    return (FILTER_MAJORITY - 1) / TICKS, FILTER_MAJORITY / TICKS


def _late_rise(form: str) -> Span:
    return SAMPLE / TICKS, (SAMPLE + 1) / TICKS


def _late_fall(form: str) -> Span:
    return (TICKS - SAMPLE - 1) / TICKS, (TICKS - SAMPLE) / TICKS


@dataclass(frozen=True)
class Quantity:
    """One kind of line fault. `promise`: of LINE-5; `unit`: factor for the tables."""

    name: str
    title: str
    theory: Callable[[str], Span]
    resolution: float
    promise: float = 0.0
    unit: str = "bit"

    def span(self, form: str, clocks_a_bit: float) -> Span:
        """Allowed span of a measured limit: theory, widened by effects that theory omits."""
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


ALL_FORMS = tuple(sorted(FORMS))
