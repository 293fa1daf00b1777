# SPDX-License-Identifier: Apache-2.0
"""Configuration and clock of a whole-card simulation; `run()` of runner.py sets both by environment.

A test with an argument `config` runs for every configuration (TOP-2), for all but the first at night only.
"""

from __future__ import annotations

import os

from rtl.sources import configuration

CONFIG_VARIABLE, CLOCK_VARIABLE = "CARD_CONFIG", "CARD_CLK_HZ"
CONFIG = os.environ.get(CONFIG_VARIABLE, "standard")
# Slower than the card, to save simulation time; the firmware still keeps the times that the benches check.
SLOW_HZ = {"standard": 2_000_000, "tiny": 5_000_000}
CLK_HZ = int(os.environ.get(CLOCK_VARIABLE, SLOW_HZ[CONFIG]))
# Duration of a round of the poll loop at these clocks in ms: a time-out may be noticed so much later.
ROUNDS_MS = {"standard": 0.5, "tiny": 5.0}
ROUND_MS = ROUNDS_MS[CONFIG]
# A time-out of the firmware ends one to two ticks (1/1200 s) and a round late, never early.
OVERDUE_MS = 2 + ROUND_MS
# Time in ms until the telegram of a broadcast has been sent, at any clock: a master's turnaround delay.
BROADCAST_MS = {"standard": 30, "tiny": 80}[CONFIG]


def own_hz(config: str) -> int:
    """Clock of the real card in Hz."""
    return configuration(config)["clk_hz"]


def boot_clocks(config: str = CONFIG) -> int:
    """Boot limit (BOOT-1) in clocks: the count is the same at any clock."""
    return configuration(config)["boot_ms"] * own_hz(config) // 1000
