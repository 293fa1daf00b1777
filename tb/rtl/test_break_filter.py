# SPDX-License-Identifier: Apache-2.0
"""break_filter: a flipped bit ends a break (SAFE-4). Its proof and the network port's bench have the rest."""

from __future__ import annotations

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run


@cocotb.test()
async def a_flipped_half_ends_a_break_and_is_a_fault(dut):
    """The bench plays the UART: a start bit, and a byte some clocks later."""
    bench = await Bench(dut, line=1, receiving=0, line_start=0, line_byte=0, may_break=1, sending=0).start()
    dut.line.value, dut.receiving.value, dut.may_break.value = 0, 1, 0
    for strobe in (dut.line_start, dut.line_byte):
        await bench.clocks(4)
        await bench.strobe(strobe)
    assert (dut.in_break.value, dut.busy.value, dut.fault.value) == (1, 0, 0)
    dut.break_i.opposite_i.half.value = 1
    await bench.clocks()
    assert (dut.in_break.value, dut.busy.value, dut.fault.value) == (0, 1, 1)


@pytest.mark.rule("SAFE-4")
def test_break_filter(sim):
    run("break_filter", "tb.rtl.test_break_filter", sim=sim)
