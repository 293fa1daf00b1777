# SPDX-License-Identifier: Apache-2.0
"""reply_slot: one order, one reply at most."""

from __future__ import annotations

import cocotb
import pytest

from tb.lib.bench import Bench, Strobes
from tb.lib.runner import run

INPUTS = {
    "queue_reply": 0,
    "empty": 0,
    "after_drive": 0,
    "takes_reply": 1,
    "candidate": 0,
    "withdrawn": 0,
    "is_committed": 1,
    "answerable": 0,
    "start_seen": 0,
    "quiet": 1,
    "drive_good": 0,
    "drive_bad": 0,
    "loopback_open": 0,
    "closing": 0,
}


class Slot:
    """The place, for a committed request whose reply may not leave yet."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, **INPUTS)
        self.starts = Strobes(dut, "start")

    async def start(self) -> Slot:
        await self.bench.start()
        return self

    async def pulse(self, name: str) -> None:
        await self.bench.strobe(getattr(self.dut, name))

    async def order(self, **levels: int) -> None:
        """One order, with these levels from then on."""
        for name, value in levels.items():
            getattr(self.dut, name).value = value
        await self.pulse("queue_reply")

    async def left(self) -> int:
        """Replies that have left once the request may be answered."""
        self.dut.answerable.value = 1
        await self.bench.clocks(4)
        return len(self.starts)


@cocotb.test()
async def an_order_makes_one_reply(dut):
    slot = await Slot(dut).start()
    await slot.order()
    await slot.bench.clocks(3)
    assert not len(slot.starts) and int(dut.queued.value)
    assert await slot.left() == 1 and not int(dut.queued.value)


@cocotb.test()
@cocotb.parametrize(name=["empty", "takes_reply"])
async def an_order_that_does_not_count_empties_the_place(dut, name):
    slot = await Slot(dut).start()
    await slot.order()
    await slot.order(**{name: 1 - INPUTS[name]})
    assert await slot.left() == 0


@cocotb.test()
@cocotb.parametrize(by=["candidate", "withdrawn", "start_seen", "closing", "rst"])
async def the_end_of_the_request_empties_the_place(dut, by):
    slot = await Slot(dut).start()
    await slot.order()
    await slot.pulse(by)
    assert await slot.left() == 0


@cocotb.test()
async def a_character_before_the_commit_is_a_matter_of_the_request(dut):
    slot = await Slot(dut).start()
    dut.is_committed.value = 0
    await slot.order()
    await slot.pulse("start_seen")
    assert await slot.left() == 1


@cocotb.test()
async def it_leaves_on_a_quiet_line_only(dut):
    slot = await Slot(dut).start()
    dut.quiet.value = 0
    await slot.order()
    assert await slot.left() == 0
    dut.quiet.value = 1
    assert await slot.left() == 1


@cocotb.test()
@cocotb.parametrize(verdict=["drive_good", "drive_bad"])
async def after_drive_waits_for_the_drive(dut, verdict):
    slot = await Slot(dut).start()
    await slot.order(after_drive=1)
    assert await slot.left() == 0
    await slot.pulse(verdict)
    dut.drive_good.value = 1
    assert await slot.left() == int(verdict == "drive_good")


@cocotb.test()
async def without_after_drive_a_bad_reply_of_the_drive_does_not_matter(dut):
    slot = await Slot(dut).start()
    await slot.order(after_drive=1)
    await slot.order(after_drive=0)
    await slot.pulse("drive_bad")
    assert await slot.left() == 1


@cocotb.test()
async def the_loop_back_test_needs_no_request_and_sends_nothing_at_its_end(dut):
    slot = await Slot(dut).start()
    dut.loopback_open.value = 1
    await slot.order(takes_reply=0)
    await slot.bench.clocks(3)
    assert len(slot.starts) == 1
    dut.quiet.value = 0
    await slot.order()
    dut.closing.value = 1
    dut.quiet.value = 1
    await slot.bench.clocks()
    dut.closing.value, dut.loopback_open.value = 0, 0
    assert await slot.left() == 1


@pytest.mark.rule("FRAME-6", "FRAME-7", "LOOP-1", "PERF-3")
def test_reply_slot(sim):
    run("reply_slot", "tb.rtl.test_reply_slot", sim=sim)
