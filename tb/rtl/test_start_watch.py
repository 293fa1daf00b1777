# SPDX-License-Identifier: Apache-2.0
"""start_watch: one strobe for each low of ten ticks or more, none for a shorter one."""

from __future__ import annotations

import cocotb
import pytest

from tb.lib.bench import Bench, Strobes
from tb.lib.runner import run

ENOUGH = 10


class Line:
    """The watch with a tick every third clock, and its line at rest."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, tick16=0, line=1)
        self.seen = Strobes(dut, "low_seen")

    async def start(self) -> Line:
        await self.bench.start()
        return self

    async def low(self, ticks: int) -> int:
        """A low of so many ticks; returns the strobes that it caused."""
        self.seen.clear()
        self.dut.line.value = 0
        await self.ticks(ticks)
        self.dut.line.value = 1
        await self.ticks(2)
        return len(self.seen)

    async def ticks(self, count: int) -> None:
        for _ in range(count):
            await self.bench.clocks(2)
            await self.bench.strobe(self.dut.tick16)


@cocotb.test()
async def a_low_of_ten_ticks_is_seen_once(dut):
    line = await Line(dut).start()
    for ticks in (*range(1, 20), 40, 160, ENOUGH):
        assert await line.low(ticks) == int(ticks >= ENOUGH), f"{ticks} ticks"


@cocotb.test()
async def a_high_between_begins_the_count_anew(dut):
    line = await Line(dut).start()
    assert [await line.low(ENOUGH - 1) for _ in range(4)] == [0, 0, 0, 0]


@pytest.mark.rule("FRAME-6", "SAFE-4")
def test_start_watch(sim):
    run("start_watch", "tb.rtl.test_start_watch", sim=sim)
