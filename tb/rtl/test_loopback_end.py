# SPDX-License-Identifier: Apache-2.0
"""loopback_end: one clock for each end of the loop-back test."""

from __future__ import annotations

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.lib.bench import Bench
from tb.lib.runner import run


@cocotb.test()
async def closing_is_the_first_clock_after_the_test(dut):
    bench = await Bench(dut, loopback_open=0).start()
    before, seen = 0, []
    for level in (0, 1, 1, 0, 0, 1, 0, 0):
        dut.loopback_open.value = level
        await Timer(1, unit="ns")
        assert int(dut.closing.value) == int(before and not level)
        seen.append(int(dut.closing.value))
        before = level
        await bench.clocks()
    assert sum(seen) == 2


@pytest.mark.rule("LOOP-1")
def test_loopback_end(sim):
    run("loopback_end", "tb.rtl.test_loopback_end", sim=sim)
