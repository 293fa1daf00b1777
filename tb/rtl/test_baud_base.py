# SPDX-License-Identifier: Apache-2.0
"""baud_base: 1.8432 MHz on average from any clock, every tick within one clock of its ideal time."""

import cocotb
import pytest

from regs.generated.card_tables import BASE_HZ
from tb.lib.bench import Bench, Strobes
from tb.lib.nightly import first
from tb.lib.runner import run

# Both ends of the allowed range, usual crystals, and frequencies without a simple ratio.
CLOCKS = [48_000_000, 100_000_000, 13_560_000, 2_000_000, 7_372_800, 25_175_000, 33_333_333, 99_999_999]
# A 16-bit accumulator repeats after this many clocks, with any step.
CYCLE = 1 << 16


def step_of(clk_hz: int) -> int:
    """The nearest of 16 bits: after a whole cycle the phase repeats."""
    return round(CYCLE * BASE_HZ / clk_hz)


def test_every_step_is_within_a_tenth_of_a_percent():
    for clk_hz in range(2_000_000, 100_000_001, 10_007):
        assert abs(step_of(clk_hz) / CYCLE * clk_hz / BASE_HZ - 1) <= 0.001, clk_hz


@cocotb.test()
async def each_tick_comes_with_the_overflow_of_its_step(dut):
    """A reset restarts the phase without a tick. At 48 MHz the step is odd: the phase takes every value."""
    step = step_of(int(dut.CLK_HZ.value))
    bench = Bench(dut)
    ticks = Strobes(dut, "tick_base")
    await bench.start(reset_clocks=2 * CYCLE // step, release=False)
    assert len(ticks) == 0
    for clocks in (CYCLE // 3, CYCLE + 100):
        dut.rst.value = 0
        begin = bench.last_edge_ps()
        await bench.clocks(clocks)
        expected = [n for n in range(1, clocks + 1) if n * step % CYCLE < step]
        assert [(t - begin) // bench.period_ps for t in ticks.times_ps] == expected
        dut.rst.value = 1
        await bench.clocks(2 * CYCLE // step)
        assert len(ticks) == len(expected), "a tick while in reset"
        ticks.clear()


@pytest.mark.rule("LINE-4")
@pytest.mark.parametrize("clk_hz", first(CLOCKS, 2))
def test_baud_base(sim, clk_hz):
    run("baud_base", "tb.rtl.test_baud_base", sim=sim, parameters={"CLK_HZ": clk_hz})
