# SPDX-License-Identifier: Apache-2.0
"""What a simulation of the whole card runs: its configuration, its clock; `run()` of runner.py says which.

A test with an argument `config` runs for every configuration (TOP-2). tb/lib/pytest_plugin.py says which of
them run in `make test` and which in `make test-all`.
"""

from __future__ import annotations

import os

from rtl.sources import configuration

CONFIG_VARIABLE, CLOCK_VARIABLE = "CARD_CONFIG", "CARD_CLK_HZ"
CONFIG = os.environ.get(CONFIG_VARIABLE, "standard")
# For the sake of the simulators: here the firmware still keeps the times that the benches look at.
SLOW_HZ = {"standard": 2_000_000, "tiny": 5_000_000}
CLK_HZ = int(os.environ.get(CLOCK_VARIABLE, SLOW_HZ[CONFIG]))
# A round of the poll loop at these clocks, in ms: so much later a time-out may be noticed.
ROUND_MS = {"standard": 0.5, "tiny": 5.0}[CONFIG]
# Until the telegram of a broadcast is over, in ms, at any clock: a master's turnaround delay.
BROADCAST_MS = {"standard": 30, "tiny": 80}[CONFIG]
# A parameter's telegram after t3.5 at 9600 bit/s and the own clock, in drive bits: SERV is not done by then.
LATEST_PARAMETER_BITS = {"standard": 1, "tiny": 6}[CONFIG]

# Whether the soft core stops at what it does not know; else the watchdog sees that nothing goes on.
TRAPS = {"picorv32": True, "serv": False}[configuration(CONFIG)["soft_core"]]


def own_hz(config: str) -> int:
    """The card's own clock."""
    return configuration(config)["clk_hz"]


def boot_clocks(config: str = CONFIG) -> int:
    """BOOT-1 in clocks: a card with a slower clock needs as many, not as much time."""
    return configuration(config)["boot_ms"] * own_hz(config) // 1000
