# SPDX-License-Identifier: Apache-2.0
"""rst_n may fall and rise at any moment of a clock: no control signal of the memory moves with it.

A block RAM whose enable, strobe or address moves near its clock edge may be damaged, even without a write,
and nothing loads the program again. Icarus has no delays here: a signal of the clock moves at its edge alone.
"""

from __future__ import annotations

import cocotb
import pytest
from cocotb.triggers import RisingEdge, Timer, ValueChange

from tb.agents.uart import now_ps
from tb.lib.bench import Bench
from tb.lib.config import CLK_HZ, SLOW_HZ
from tb.lib.runner import run

STEPS = 12  # moments of a clock
# The switches settle for 1/1200 s, then the soft core starts.
STARTED_CLOCKS = CLK_HZ // 1000
CONTROL = ("enable", "wstrb", "word")


@cocotb.test()
async def memory_control_moves_at_clock_edges_alone(dut):
    bench = await Bench(dut, CLK_HZ, sw_baud=0, sw_addr=1, modbus_rx=1, drive_rx=1).start(reset_clocks=10)
    phases: list[tuple[str, int]] = []  # of each movement, after the rising edge

    async def watch(name: str) -> None:
        while True:
            await ValueChange(getattr(dut.ram_i, name))
            phases.append((name, now_ps() - bench.last_edge_ps()))

    for name in CONTROL:
        cocotb.start_soon(watch(name))
    for step in range(STEPS):
        await bench.clocks(STARTED_CLOCKS)
        await RisingEdge(dut.ram_i.enable)
        for level in (0, 1):
            await Timer(bench.period_ps * (step + 1) // (STEPS + 1), unit="ps")
            dut.rst_n.value = level
            await bench.clocks(8)
            await RisingEdge(dut.clk)
        assert [found for found in phases if found[1]] == []
        phases.clear()


@pytest.mark.rule("TOP-1", "SAFE-5")
@pytest.mark.parametrize("card", ["standard", pytest.param("tiny", marks=pytest.mark.nightly)])
def test_reset_at_any_moment(card: str):
    parameters = {"CLK_HZ": SLOW_HZ[card]}
    run("rtu2fc", "tb.card.test_card_reset_moment", sim="icarus", config=card, parameters=parameters)
