# SPDX-License-Identifier: Apache-2.0
"""break_filter: takes a low without any high out where a break may follow; all else passes with a start bit.

The bench plays the UART: a start bit, and a byte some clocks later.
"""

from __future__ import annotations

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.lib.bench import Bench
from tb.lib.runner import run

LENGTH = 12  # clocks from the vote on a start bit to the byte


class Line:
    """The filter after a good frame, and its line at rest."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, line=1, receiving=0, line_start=0, line_byte=0, may_break=0, sending=0)
        self.seen = [0, 0]  # start bits and bytes of the present character

    async def start(self, may_break: bool = True) -> Line:
        await self.bench.start()
        await self.bench.clocks()
        await self.clock(may_break=int(may_break))
        return self

    async def clock(self, **inputs: int) -> None:
        """One clock with these inputs, the strobes among them for this clock only."""
        for name in ("line_start", "line_byte", "may_break"):
            getattr(self.dut, name).value = inputs.pop(name, 0)
        for name, level in inputs.items():
            getattr(self.dut, name).value = level
        await Timer(1, unit="ns")
        for number, name in enumerate(("start_seen", "byte_valid")):
            self.seen[number] += int(getattr(self.dut, name).value)
        await self.bench.clocks()

    async def character(self, high_after: int) -> tuple[int, ...]:
        """A character whose line rises after so many clocks; returns start bits and bytes."""
        self.seen = [0, 0]
        for _ in range(4):
            await self.clock(line=0, receiving=1)
        await self.clock(line_start=1)
        for clock in range(LENGTH):
            await self.clock(line=int(clock >= high_after))
            assert self.dut.busy.value == 1, "no silence counts while this is open"
        await self.clock(line_byte=1)
        await self.clock()
        return tuple(self.seen)

    async def rest(self) -> None:
        self.dut.line.value = 1
        self.dut.receiving.value = 0
        await self.bench.clocks(3)


@cocotb.test()
async def a_break_is_taken_out_and_the_low_after_it_is_silent(dut):
    line = await Line(dut).start()
    for _ in range(3):  # one after the other, without a new frame
        assert await line.character(LENGTH) == (0, 0)
        assert dut.in_break.value == 1 and dut.busy.value == 0
        await line.rest()
        assert dut.in_break.value == 0


@cocotb.test()
async def a_character_passes_with_its_first_high(dut):
    for high_after in range(LENGTH - 1):
        line = await Line(dut).start()
        assert await line.character(high_after) == (1, 1), f"high after {high_after} clocks"
        assert dut.in_break.value == 0 and dut.busy.value == 1
        await line.rest()
        # Nothing is held back after a character.
        assert await line.character(LENGTH) == (1, 1)


@cocotb.test()
async def without_a_good_frame_a_low_is_a_character(dut):
    line = await Line(dut).start(may_break=False)
    assert await line.character(LENGTH) == (1, 1)
    assert dut.in_break.value == 0 and dut.busy.value == 1


@cocotb.test()
async def a_flipped_half_ends_a_break_and_is_a_fault(dut):
    line = await Line(dut).start()
    await line.character(LENGTH)
    dut.break_i.opposite_i.half.value = 1
    await line.bench.clocks()
    assert dut.in_break.value == 0 and dut.busy.value == 1 and dut.fault.value == 1


@pytest.mark.rule("FRAME-3", "FRAME-6", "SAFE-4")
def test_break_filter(sim):
    run("break_filter", "tb.rtl.test_break_filter", sim=sim)
