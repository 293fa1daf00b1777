# SPDX-License-Identifier: Apache-2.0
"""The configuration of the card that this simulation runs; `run()` of runner.py says which (TOP-2)."""

from __future__ import annotations

import os

from tools.sources import configuration

CONFIG_VARIABLE = "CARD_CONFIG"
CONFIG = os.environ.get(CONFIG_VARIABLE, "standard")


def boot_clocks(config: str = CONFIG) -> int:
    """BOOT-1 in clocks: a card with a slower clock needs as many, not as much time."""
    entry = configuration(config)
    return entry["boot_ms"] * entry["clk_hz"] // 1000
