# SPDX-License-Identifier: Apache-2.0
"""glitch_filter: pulses up to a quarter bit never pass, real edges all have the same delay."""

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run

QUARTER = 4  # ticks of 1/16 bit


async def ready(dut) -> Bench:
    return await Bench(dut, raw=1, tick16=1, mute=0).start()


async def filtered(dut, bench: Bench, levels: list[int]) -> list[int]:
    """The filter's output after each level, one tick per level."""
    out = []
    for level in levels:
        dut.raw.value = level
        await bench.clocks()
        out.append(int(dut.clean.value))
    return out


@cocotb.test()
async def pulses_up_to_a_quarter_bit_vanish_and_longer_ones_keep_their_width(dut):
    bench = await ready(dut)
    for rest in (1, 0):
        await filtered(dut, bench, [rest] * 20)
        for width in range(1, 9):
            got = await filtered(dut, bench, [1 - rest] * width + [rest] * 20)
            expected = 0 if width <= QUARTER else width
            assert got.count(1 - rest) == expected, f"{width} ticks of {1 - rest}"


@cocotb.test()
async def muted_filter_outputs_idle_and_clears_its_count(dut):
    bench = await ready(dut)
    await filtered(dut, bench, [0] * 10)
    dut.mute.value = 1
    assert set(await filtered(dut, bench, [0] * 10)) == {1}
    dut.mute.value = 0
    assert await filtered(dut, bench, [0] * 5) == [1] * 4 + [0]


@cocotb.test()
async def filter_holds_without_a_tick(dut):
    bench = await ready(dut)
    dut.tick16.value = 0
    assert set(await filtered(dut, bench, [0] * 30)) == {1}


@pytest.mark.rule("LINE-5", "LINE-6", "FC-10")
def test_glitch_filter(sim):
    run("glitch_filter", "tb.rtl.test_glitch_filter", sim=sim)
