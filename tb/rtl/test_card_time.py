# SPDX-License-Identifier: Apache-2.0
"""card_time: 128 ticks of the drive port are 1/1200 s, so twelve counts are exactly 10 ms."""

import cocotb
import pytest

from regs.generated.card_tables import DRIVE_BAUD, TICKS_PER_BIT
from tb.lib.bench import Bench
from tb.lib.runner import run

TICKS16_PER_TICK = 128


def test_unit_of_time_is_exact():
    assert DRIVE_BAUD * TICKS_PER_BIT == 1200 * TICKS16_PER_TICK


@cocotb.test()
async def count_starts_at_the_reset_and_wraps(dut):
    bench = await Bench(dut, tick16=1).start()
    await bench.strobe(dut.rst)
    for tick in range(300):
        assert int(dut.ticks.value) == tick % 256
        await bench.clocks(TICKS16_PER_TICK - 1)
        assert int(dut.ticks.value) == tick % 256
        await bench.clocks()


@cocotb.test()
async def count_holds_without_ticks_and_starts_at_0(dut):
    bench = await Bench(dut, tick16=1).start()
    await bench.clocks(6.5 * TICKS16_PER_TICK)
    dut.tick16.value = 0
    await bench.clocks(1000)
    assert int(dut.ticks.value) == 6
    await bench.strobe(dut.rst)
    assert int(dut.ticks.value) == 0


@pytest.mark.rule("FC-9", "LED-1")
def test_card_time(sim):
    run("card_time", "tb.rtl.test_card_time", sim=sim)
