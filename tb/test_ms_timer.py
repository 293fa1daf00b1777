# SPDX-License-Identifier: Apache-2.0
"""ms_timer: 153.6 ticks of the drive port are a millisecond, exactly on average."""

import cocotb
import pytest
from cocotb.triggers import ValueChange

from tb.lib.bench import Bench
from tb.lib.runner import run

TICKS_PER_MS = 153.6  # 16 * 9600 / 1000


@cocotb.test()
async def milliseconds_are_exact_on_average_and_never_a_tick_off(dut):
    bench = await Bench(dut, tick16=0).start()
    dut.tick16.value = 1
    start = cocotb.utils.get_sim_time("ps")
    for ms in range(1, 126):
        await ValueChange(dut.ms)
        ticks = (cocotb.utils.get_sim_time("ps") - start) / bench.period_ps
        assert int(dut.ms.value) == ms
        assert abs(ticks - ms * TICKS_PER_MS) <= 1.5, f"{ms} ms after {ticks} ticks"


@cocotb.test()
async def time_stands_still_without_ticks_and_starts_at_0(dut):
    bench = await Bench(dut, tick16=1).start()
    await bench.clocks(1000)
    dut.tick16.value = 0
    await bench.clocks(2)
    before = int(dut.ms.value)
    assert before == 6
    await bench.clocks(1000)
    assert int(dut.ms.value) == before
    await bench.strobe(dut.rst)
    assert int(dut.ms.value) == 0


@cocotb.test()
async def it_wraps_round_after_65536_ms(dut):
    bench = await Bench(dut, tick16=1).start()
    dut.ms.value = 65535
    await bench.clocks(160)
    assert int(dut.ms.value) in (0, 1)


@pytest.mark.rule("FC-9", "LED-1")
def test_ms_timer(sim):
    run("ms_timer", "tb.test_ms_timer", sim=sim)
