# SPDX-License-Identifier: Apache-2.0
"""reset_sync: asserts at once without a clock; the release is synchronous."""

import cocotb
import pytest
from cocotb.triggers import FallingEdge, Timer

from tb.agents.uart import now_ps
from tb.lib.bench import Bench
from tb.lib.runner import run

CLK_HZ = 10e6


@cocotb.test()
async def reset_holds_from_power_up_until_two_clocks_after_release(dut):
    bench = Bench(dut, CLK_HZ)
    await bench.start(reset_clocks=5)
    assert dut.rst.value == 1, "one clock after the release"
    await bench.clocks()
    assert dut.rst.value == 0


@cocotb.test()
async def pin_asserts_without_a_clock(dut):
    bench = await Bench(dut, CLK_HZ).start()
    await bench.clocks(5)
    bench.clock.stop()
    dut.rst_n.value = 0
    await Timer(1, unit="ns")
    assert dut.rst.value == 1


@cocotb.test()
async def pulse_shorter_than_a_clock_makes_a_full_reset(dut):
    bench = await Bench(dut, CLK_HZ).start()
    await bench.clocks(5)
    assert dut.rst.value == 0
    dut.rst_n.value = 0
    await Timer(2, unit="ns")
    dut.rst_n.value = 1
    released_at = now_ps()
    await FallingEdge(dut.rst)
    clocks = (now_ps() - released_at) / bench.period_ps
    assert 1 <= clocks <= 2


@pytest.mark.rule("TOP-1")
def test_reset_sync(sim):
    run("reset_sync", "tb.rtl.test_reset_sync", sim=sim)
