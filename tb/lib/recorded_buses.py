# SPDX-License-Identifier: Apache-2.0
"""The recordings of real buses in tb/captures, and what is on each (tb/captures/README.md)."""

from __future__ import annotations

from dataclasses import dataclass

from rtl.sources import ROOT
from sw.rtu2fc.capture import open_capture

CAPTURES = ROOT / "tb/captures"


@dataclass(frozen=True)
class Bus:
    """A channel of a recording. `unit`: the only address that occurs. `good`: number of good frames."""

    name: str
    channel: str
    baud: int
    form: str
    unit: int
    good: int
    invert: bool = False

    def __str__(self) -> str:
        return f"{self.name}-{self.channel}"

    def edges(self, clk_hz: int) -> list[tuple[int, int]]:
        """Time in clocks from the start of the recording, and level."""
        return open_capture(CAPTURES / f"{self.name}.sr").edges(self.channel, clk_hz, invert=self.invert)


MODULE = [Bus("brainchild-io-16do", channel, 19200, "8E1", 1, 15, True) for channel in ("1", "0")]
METERS = [
    Bus("flowmeter_target0_val0", "RXTX", 9600, "8N1", 247, 74),
    Bus("flowmeter_target_15liter_per_min", "RXTX", 9600, "8N1", 247, 132),
]
SLAVE = [Bus("wizmodbus", channel, 9600, "8N1", 1, 44) for channel in ("RX", "TX")]
FLOATING = Bus("wizmodbus", "BA+", 9600, "8N1", 1, 0)
BUSES = [*MODULE, *METERS, *SLAVE, FLOATING]
