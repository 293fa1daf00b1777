# SPDX-License-Identifier: Apache-2.0
"""sync_2ff: delays by two clocks; outputs the idle level during a reset."""

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run


@cocotb.test()
async def level_passes_after_two_clocks(dut):
    bench = await Bench(dut, raw=1).start()
    await bench.clocks(3)
    for level in (0, 1, 0, 1):
        dut.raw.value = level
        await bench.clocks()
        assert dut.synced.value == 1 - level, "after one clock"
        await bench.clocks()
        assert dut.synced.value == level, "after two clocks"


@cocotb.test()
async def low_line_at_power_up_shows_as_idle_until_the_reset_is_over(dut):
    bench = await Bench(dut, raw=0).start(reset_clocks=1, release=False)
    for _ in range(5):
        await bench.clocks()
        assert dut.synced.value == 1
    dut.rst.value = 0
    await bench.clocks()
    assert dut.synced.value == 1
    await bench.clocks()
    assert dut.synced.value == 0


@pytest.mark.rule("LINE-5")
def test_sync_2ff(sim):
    run("sync_2ff", "tb.rtl.test_sync_2ff", sim=sim)
