# SPDX-License-Identifier: Apache-2.0
"""guarded_bit: a flip-flop that no single flip makes 1, and that shows a flip."""

from __future__ import annotations

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import seeded

HALVES = ["held_i", "opposite_i"]


def outputs(dut) -> tuple[int, int]:
    return int(dut.value.value), int(dut.fault.value)


async def start(dut) -> Bench:
    return await Bench(dut, load=0, data=0).start()


async def load(bench: Bench, data: int) -> None:
    bench.dut.load.value, bench.dut.data.value = 1, data
    await bench.clocks()
    bench.dut.load.value = 0


async def flip(dut, half: str) -> None:
    bit = getattr(dut, half).half
    bit.value = 1 - int(bit.value)
    await Timer(1, unit="ps")


@cocotb.test()
async def it_keeps_what_was_loaded_last(dut):
    rng = seeded("loads")
    bench = await start(dut)
    kept = 0
    for _ in range(300):
        names = {name: rng.randint(0, 1) for name in ("load", "data")} | {"rst": int(rng.random() < 0.1)}
        for name, value in names.items():
            getattr(dut, name).value = value
        await bench.clocks()
        kept = 0 if names["rst"] else names["data"] if names["load"] else kept
        assert outputs(dut) == (kept, 0)


@cocotb.test()
@cocotb.parametrize(half=HALVES, before=[0, 1], mended_by=["load", "reset"])
async def a_flipped_half_counts_as_0_and_shows(dut, half, before, mended_by):
    bench = await start(dut)
    await load(bench, before)
    assert outputs(dut) == (before, 0)
    await flip(dut, half)
    assert outputs(dut) == (0, 1)
    await bench.clocks(5)
    assert outputs(dut) == (0, 1), "until it is written again"
    if mended_by == "load":
        await load(bench, 1)
        assert outputs(dut) == (1, 0)
    else:
        dut.rst.value = 1
        await bench.clocks()
        assert outputs(dut) == (0, 0)


@pytest.mark.rule("SAFE-4")
def test_guarded_bit(sim):
    run("guarded_bit", "tb.rtl.test_guarded_bit", sim=sim)
