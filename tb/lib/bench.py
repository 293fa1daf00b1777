# SPDX-License-Identifier: Apache-2.0
"""Clock, reset, input levels and waiting, for every bench.

Icarus reads an undriven input as Z and Verilator as 0, so a bench drives every input from time 0. The clock
starts one period later. Icarus 11 loses an `Immediate` write at time 0, so the initial writes are plain ones.
"""

from __future__ import annotations

import re

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ReadOnly, RisingEdge, Timer

from rtl.sources import ROOT
from tb.agents.uart import now_ps


def clock_period_ps(clk_hz: float) -> int:
    """Clock period as an even number of ps, for equal halves: at most 1 ps off, 100 ppm at 100 MHz."""
    return 2 * round(5e11 / clk_hz)


def inputs(module: str) -> list[str]:
    """The inputs of a module of rtl/ but its clock and reset."""
    text = next((ROOT / "rtl").rglob(f"{module}.v")).read_text()
    found = re.findall(r"^ +input +wire .*?(\w+),?$", text, re.MULTILINE)
    return [name for name in found if name not in ("clk", "rst")]


class Bench:
    """A device under test with `clk`, and with `rst_n` or `rst` (active high) if it has a reset.

    `period_ps` is the simulated clock period after rounding.
    """

    def __init__(self, dut, clk_hz: float = 10e6, **inputs: int):
        self.dut = dut
        self.period_ps = clock_period_ps(clk_hz)
        self._reset = next(((n, v) for n, v in (("rst_n", 0), ("rst", 1)) if hasattr(dut, n)), None)
        if self._reset:
            inputs.setdefault(*self._reset)
        for name, value in inputs.items():
            getattr(dut, name).value = value
        self.clock = Clock(dut.clk, self.period_ps, unit="ps", impl="gpi")

    async def start(self, reset_clocks: int = 3, release: bool = True) -> Bench:
        """Starts the clock, resets and releases the reset; returns one clock later, after a falling edge."""
        await Timer(self.period_ps, unit="ps")
        self._first_edge_ps = now_ps()
        self.clock.start()
        await self.clocks(reset_clocks)
        if self._reset and release:
            name, active = self._reset
            getattr(self.dut, name).value = 1 - active
            await self.clocks(1)
        return self

    async def clocks(self, count: float = 1) -> None:
        """Waits `count` clocks with a single timer; ends just after a falling edge.

        Inputs set there are stable at the next rising edge. Outputs read there belong to the last one.
        """
        target = now_ps() + round(count * self.period_ps)
        # The clock starts with a rising edge; this wait ends 1 ps after a falling edge.
        past = (target - self._first_edge_ps - self.period_ps // 2 - 1) % self.period_ps
        await Timer(max(1, target - past - now_ps()), unit="ps")

    def last_edge_ps(self) -> int:
        """Time of the last rising edge."""
        return now_ps() - (now_ps() - self._first_edge_ps) % self.period_ps

    async def edge(self) -> None:
        """Waits until just after the next rising edge, from any moment."""
        await RisingEdge(self.dut.clk)
        await self.clocks()

    async def send_stream(self, data: bytes, prefix: str = "byte") -> None:
        """Sends bytes to a stream <prefix>_valid, _ready, _data without pauses, until all are taken."""
        valid, ready, lane = (getattr(self.dut, f"{prefix}_{part}") for part in ("valid", "ready", "data"))
        for byte in data:
            lane.value, valid.value = byte, 1
            while str(ready.value) != "1":
                await RisingEdge(ready)
                # Ready may spike in a netlist; by now it is stable.
                await self.clocks(0.75)
            await self.edge()
        valid.value = 0

    async def strobe(self, signal) -> None:
        """A pulse that exactly one rising edge sees, from any moment."""
        signal.value = 1
        await self.edge()
        signal.value = 0


class Strobes:
    """Records every clock in which a strobe is high, with the values of other signals in that clock."""

    def __init__(self, dut, strobe: str, *values: str):
        self.times_ps: list[int] = []
        self.values: list[tuple[int, ...]] = []
        self._dut, self._strobe = dut, getattr(dut, strobe)
        self._signals = [getattr(dut, name) for name in values]
        self._task = cocotb.start_soon(self._watch())

    def __len__(self) -> int:
        return len(self.times_ps)

    def clear(self) -> None:
        self.times_ps.clear()
        self.values.clear()

    async def _watch(self) -> None:
        high_already = str(self._strobe.value) == "1"
        while True:
            await RisingEdge(self._dut.clk if high_already else self._strobe)
            await ReadOnly()
            high_already = False
            # A strobe wider than one clock counts once per clock.
            while str(self._strobe.value) == "1":
                self.times_ps.append(now_ps())
                self.values.append(tuple(int(s.value) for s in self._signals))
                await RisingEdge(self._dut.clk)
                await ReadOnly()
