# SPDX-License-Identifier: Apache-2.0
"""event_counters with its memory: no event is lost or counted twice, whoever else uses the memory."""

from __future__ import annotations

from pathlib import Path

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import ROOT, run
from tb.lib.seeds import seeded

EVENTS = 7
WRAPPER = ROOT / "tb/hdl/counted_memory.v"


class Counters:
    """The counters on the frame memory; `lines` keeps the lines' share of the memory busy."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, 10e6, events=0, line_write=0, line_read=0, peek_addr=0)

    async def start(self) -> Counters:
        await self.bench.start()
        return self

    async def clock(self, events: int = 0, busy: int = 0) -> None:
        self.dut.events.value = events
        self.dut.line_write.value = self.dut.line_read.value = busy
        await self.bench.clocks()

    async def read(self, event: int) -> int:
        """The 16-bit count, once everything is worked off."""
        word = 0
        for half in (0, 1):
            self.dut.peek_addr.value = 2 * event + half
            await self.bench.clocks(3)
            word |= self.dut.peek_data.value.to_unsigned() << 8 * half
        return word

    async def idle(self) -> None:
        self.dut.events.value = 0
        self.dut.line_write.value = self.dut.line_read.value = 0
        await self.bench.clocks(100)


@cocotb.test()
async def each_event_has_a_counter_of_its_own(dut):
    counters = await Counters(dut).start()
    for event in range(EVENTS):
        for _ in range(event + 1):
            await counters.clock(events=1 << event)
            await counters.idle()
    assert [await counters.read(e) for e in range(EVENTS)] == [e + 1 for e in range(EVENTS)]


@cocotb.test()
async def all_at_once_are_all_counted(dut):
    counters = await Counters(dut).start()
    before = [await counters.read(e) for e in range(EVENTS)]
    await counters.clock(events=(1 << EVENTS) - 1)
    await counters.idle()
    assert [await counters.read(e) for e in range(EVENTS)] == [n + 1 for n in before]


@cocotb.test()
async def a_carry_reaches_the_high_byte_and_a_reset_forgets_nothing(dut):
    counters = await Counters(dut).start()
    before = await counters.read(3)
    for _ in range(600):
        await counters.clock(events=1 << 3)
        await counters.clock()
        for _ in range(12):
            await counters.clock()
    await counters.idle()
    await counters.bench.strobe(dut.rst)
    assert await counters.read(3) == before + 600


@cocotb.test()
async def events_during_the_lines_own_accesses_are_counted(dut):
    rng = seeded("events")
    counters = await Counters(dut).start()
    given = [await counters.read(e) for e in range(EVENTS)]
    for _ in range(200):
        event = rng.randrange(EVENTS)
        given[event] += 1
        await counters.clock(events=1 << event, busy=rng.randint(0, 1))
        # An event of one kind comes at most once a character: hundreds of clocks.
        for _ in range(40):
            await counters.clock(busy=int(rng.random() < 0.6))
    await counters.idle()
    assert [await counters.read(e) for e in range(EVENTS)] == given


@pytest.mark.rule("FRAME-4", "FC-8")
def test_event_counters(sim):
    run("counted_memory", "tb.test_event_counters", sim=sim, extra_sources=[Path(WRAPPER)])
