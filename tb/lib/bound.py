# SPDX-License-Identifier: Apache-2.0
"""How often something can happen that was seen so many times: the bound beside a figure of a campaign."""

from __future__ import annotations

import math

CONFIDENCE = 0.99
SURE = f"{100 * CONFIDENCE:.0f} %"
STEPS = 60


def at_most(seen: int, tries: int, confidence: float = CONFIDENCE) -> float:
    """One-sided Clopper-Pearson bound of the rate; 1 without a try. Of 0 it is about ln(100) / tries."""
    if tries <= seen:
        return 1.0
    low, high = seen / tries, 1.0
    for _ in range(STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if _so_few(seen, tries, middle) > 1 - confidence else (low, middle)
    return high


def _so_few(seen: int, tries: int, rate: float) -> float:
    """Probability of at most `seen` of `tries` at this rate."""
    term = tries * math.log1p(-rate)
    odds, total = math.log(rate) - math.log1p(-rate), 0.0
    for count in range(seen + 1):
        total += math.exp(term)
        term += math.log(tries - count) - math.log(count + 1) + odds
    return total


def words(seen: int, tries: int) -> str:
    """The bound with three digits, rounded up, so that it stays a bound."""
    rate = at_most(seen, tries)
    last = 10.0 ** (math.floor(math.log10(rate)) - 2)
    return f"{math.ceil(round(rate / last, 6)) * last:.2e}"
