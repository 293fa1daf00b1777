# SPDX-License-Identifier: Apache-2.0
"""reset_sync: a reset of any length and at any moment; rst moves at clock edges alone."""

import cocotb
import pytest
from cocotb.triggers import Timer, ValueChange

from tb.agents.uart import now_ps
from tb.lib.bench import Bench
from tb.lib.runner import run

CLK_HZ = 10e6
STEPS = 9  # moments of a clock


@cocotb.test()
async def reset_holds_from_power_up_until_three_clocks_after_release(dut):
    bench = Bench(dut, CLK_HZ)
    await bench.start(reset_clocks=5)
    for clock in (1, 2):
        assert dut.rst.value == 1, f"{clock} clocks after the release"
        await bench.clocks()
    assert dut.rst.value == 0


@cocotb.test()
async def without_a_clock_only_asked_rises(dut):
    bench = await Bench(dut, CLK_HZ).start()
    await bench.clocks(5)
    bench.clock.stop()
    dut.rst_n.value = 0
    await Timer(1, unit="ns")
    assert (dut.asked.value, dut.rst.value) == (1, 0)


@cocotb.test()
@cocotb.parametrize(length_ns=[1, 30, 150])
async def pulse_at_any_moment_makes_a_full_reset(dut, length_ns):
    bench = await Bench(dut, CLK_HZ).start()
    moves: list[tuple[int, int]] = []  # value and time after the rising edge

    async def watch() -> None:
        while True:
            await ValueChange(dut.rst)
            moves.append((int(dut.rst.value), now_ps() - bench.last_edge_ps()))

    await bench.clocks(5)
    cocotb.start_soon(watch())
    for step in range(STEPS):
        moves.clear()
        await Timer(bench.period_ps * (step + 1) // (STEPS + 1), unit="ps")
        dut.rst_n.value = 0
        await Timer(length_ns, unit="ns")
        assert dut.asked.value == 1
        dut.rst_n.value = 1
        while dut.rst.value == 0:
            assert dut.asked.value == 1, "until rst is 1"
            await bench.clocks()
        await bench.clocks(6)
        assert dut.asked.value == 0
        assert moves == [(1, 0), (0, 0)]


@pytest.mark.rule("TOP-1")
def test_reset_sync(sim):
    run("reset_sync", "tb.rtl.test_reset_sync", sim=sim)
