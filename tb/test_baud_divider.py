# SPDX-License-Identifier: Apache-2.0
"""baud_divider: one tick of 1/16 bit for every `ratio` base ticks."""

import cocotb
import pytest

from tb.generated.card_tables import BASE_HZ, RATES, TICKS_PER_BIT
from tb.lib.bench import Bench, Strobes
from tb.lib.runner import run
from tb.lib.seeds import seeded

RATIOS = sorted(rate.ratio for rate in RATES.values())


@cocotb.test()
async def every_rate_divides_the_base_evenly(dut):
    for rate in RATES.values():
        assert rate.ratio * rate.baud * TICKS_PER_BIT == BASE_HZ


@cocotb.test()
@cocotb.parametrize(ratio=RATIOS)
async def ticks_come_every_ratio_base_ticks(dut, ratio):
    bench = await Bench(dut, tick_base=1, ratio=ratio).start()
    ticks = Strobes(dut, "tick16")
    await bench.clocks(5 * ratio + 2)
    gaps = {b - a for a, b in zip(ticks.times_ps, ticks.times_ps[1:], strict=False)}
    assert gaps == {ratio * bench.period_ps}


@cocotb.test()
async def uneven_base_ticks_are_counted_not_timed(dut):
    rng = seeded("base ticks")
    bench = await Bench(dut, tick_base=0, ratio=3).start()
    ticks, given = Strobes(dut, "tick16"), 0
    for _ in range(300):
        level = rng.randint(0, 1)
        dut.tick_base.value = level
        given += level
        await bench.clocks()
    dut.tick_base.value = 0
    await bench.clocks(2)
    assert len(ticks) in (given // 3, given // 3 + 1)


@pytest.mark.rule("LINE-2", "LINE-4", "FC-1")
def test_baud_divider(sim):
    run("baud_divider", "tb.test_baud_divider", sim=sim)
