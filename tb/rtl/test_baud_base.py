# SPDX-License-Identifier: Apache-2.0
"""baud_base: 1.8432 MHz on average from any clock, every tick within one clock of its ideal time."""

from pathlib import Path

import cocotb
import pytest
from cocotb.types import LogicArray

from regs.generated.card_tables import BASE_HZ
from tb.lib.bench import Bench, Strobes
from tb.lib.runner import run

HERE = Path(__file__).parent
# Both ends of the allowed range, usual crystals, and frequencies without a simple ratio.
CLOCKS = (2_000_000, 2_097_152, 3_686_400, 7_372_800, 12_000_000, 13_560_000, 25_175_000)
CLOCKS += (33_333_333, 48_000_000, 66_666_667, 99_999_999, 100_000_000)
# A 16-bit accumulator repeats after this many clocks, with any step.
CYCLE = 1 << 16
UNEVEN_HZ = 48_000_000


@cocotb.test()
async def rate_is_right_within_a_tenth_of_a_percent_at_every_clock(dut):
    bench = await Bench(dut).start()

    def counts() -> list[int]:
        word = dut.counts.value.to_unsigned()
        return [word >> 32 * i & 0xFFFFFFFF for i in range(len(CLOCKS))]

    before = counts()
    await bench.clocks(CYCLE)
    for clock_hz, ticks in zip(CLOCKS, (b - a for a, b in zip(before, counts(), strict=True)), strict=True):
        error = ticks / CYCLE * clock_hz / BASE_HZ - 1
        print(f"{clock_hz} Hz: {error:+.5%}")
        assert abs(error) <= 0.001, f"{clock_hz} Hz: {error:+.4%}"
        # The step is the nearest 16-bit value: after a whole cycle the phase repeats.
        assert ticks == round(CYCLE * BASE_HZ / clock_hz), f"{clock_hz} Hz"


@cocotb.test()
async def every_tick_is_within_a_clock_of_its_ideal_time(dut):
    bench = await Bench(dut).start()
    ticks = Strobes(dut, "tick_base")
    await bench.clocks(20_000)
    ideal = bench.period_ps * 12_000_000 / BASE_HZ
    offsets = [t - ticks.times_ps[0] - i * ideal for i, t in enumerate(ticks.times_ps)]
    assert len(offsets) > 3000
    drift = 0.001 * ideal * len(offsets)
    assert max(map(abs, offsets)) <= bench.period_ps + drift


@cocotb.test()
async def a_reset_restarts_the_phase_without_a_tick(dut):
    """The step is odd at this clock, so the phase takes every value."""
    step = round(CYCLE * BASE_HZ / UNEVEN_HZ)
    assert step % 2
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
def test_baud_base_at_many_clocks(sim):
    packed = sum(clock_hz << 32 * i for i, clock_hz in enumerate(CLOCKS))
    run(
        "baud_bank",
        "tb.rtl.test_baud_base",
        sim=sim,
        extra_sources=[HERE / "baud_bank.v"],
        parameters={"COUNT": len(CLOCKS), "CLOCKS": LogicArray(packed, 32 * len(CLOCKS))},
        testcase="rate_is_right_within_a_tenth_of_a_percent_at_every_clock",
    )


@pytest.mark.rule("LINE-4")
@pytest.mark.parametrize(
    ("clk_hz", "testcase"),
    [
        (12_000_000, "every_tick_is_within_a_clock_of_its_ideal_time"),
        (UNEVEN_HZ, "a_reset_restarts_the_phase_without_a_tick"),
    ],
)
def test_baud_base(sim, clk_hz, testcase):
    run("baud_base", "tb.rtl.test_baud_base", sim=sim, parameters={"CLK_HZ": clk_hz}, testcase=testcase)
