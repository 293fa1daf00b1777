# SPDX-License-Identifier: Apache-2.0
"""master_loss: one licence, for a start that was committed, after the whole period without a commit."""

from __future__ import annotations

from functools import reduce

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import cases, seeded

STROBES = ["commits", "watch", "take"]
LEVELS = {"rights": 1, "writes_coils": 1, "running": 1, "period": 0}
PERIOD = 5


class Loss:
    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, **dict.fromkeys([*STROBES, "beat"], 0), **LEVELS)

    async def start(self) -> Loss:
        await self.bench.start()
        return self

    async def clock(self, tick: int = 0, **levels: int) -> None:
        for name, value in {**dict.fromkeys(STROBES, 0), **levels}.items():
            getattr(self.dut, name).value = value
        if tick:
            self.dut.beat.value = 1 - int(self.dut.beat.value)
        await self.bench.clocks()
        for name in STROBES:
            getattr(self.dut, name).value = 0
        await Timer(1, unit="ps")

    async def armed(self, period: int = PERIOD) -> None:
        """A start is committed, and the firmware reports it."""
        await self.clock(commits=1)
        await self.clock(watch=1, rights=1, writes_coils=1, running=1, period=period)

    async def ticks(self, count: int) -> None:
        for _ in range(count):
            await self.clock(tick=1)
            await self.clock()

    @property
    def due(self) -> int:
        return int(self.dut.due.value)


@cocotb.test()
@cocotb.parametrize(period=[1, 2, PERIOD, 300])
async def it_is_due_once_the_whole_period_has_passed(dut, period):
    loss = await Loss(dut).start()
    await loss.armed(period)
    await loss.ticks(period)
    assert not loss.due, "the first tick may have come at once"
    await loss.ticks(1)
    assert loss.due
    await loss.ticks(3 * period)
    assert loss.due, "until it is used"
    await loss.clock(take=1)
    assert not loss.due
    await loss.ticks(3 * period)
    await loss.clock(commits=1)
    await loss.ticks(3 * period)
    assert not loss.due, "once"
    await loss.armed(period)
    await loss.ticks(period + 1)
    assert loss.due, "after the next start"


@cocotb.test()
async def a_commit_begins_the_wait_anew_and_takes_the_licence_at_once(dut):
    loss = await Loss(dut).start()
    await loss.armed()
    for _ in range(4):
        await loss.ticks(PERIOD)
        assert not loss.due
        await loss.clock(commits=1)
    await loss.ticks(PERIOD + 1)
    assert loss.due
    dut.commits.value = 1
    await Timer(1, unit="ns")
    assert not loss.due, "in the very clock"
    await loss.clock(commits=1, take=1)
    await loss.ticks(PERIOD + 1)
    assert loss.due, "an order that was refused used nothing"


@cocotb.test()
async def a_restart_of_the_firmware_disarms(dut):
    loss = await Loss(dut).start()
    await loss.armed()
    await loss.ticks(PERIOD + 1)
    assert loss.due
    await loss.bench.strobe(dut.rst)
    await loss.ticks(3 * PERIOD)
    assert not loss.due


@cocotb.test()
@cocotb.parametrize(
    bit=["armed_i.held_i.half", "armed_i.opposite_i.half", "over_i.held_i.half", "over_i.opposite_i.half"],
    state=["idle", "armed", "due"],
)
async def a_flipped_half_is_never_due(dut, bit, state):
    loss = await Loss(dut).start()
    if state != "idle":
        await loss.armed()
    if state == "due":
        await loss.ticks(PERIOD + 1)
        assert loss.due
    half = reduce(getattr, bit.split("."), dut)
    half.value = 1 - int(half.value)
    await loss.clock()
    assert not loss.due
    await loss.armed()
    await loss.ticks(PERIOD + 1)
    assert loss.due, "the next start is as good as new"


@cocotb.test()
async def random_histories_agree_with_the_rule(dut):
    rng = seeded("loss of the master")
    loss = await Loss(dut).start()
    armed, since, limit, seen = False, 0, 0, 0
    for step in range(cases(2000, 6000)):
        due = armed and limit != 0 and since > limit
        assert loss.due == due, f"step {step}"
        seen += due
        tick = int(rng.random() < 0.4)
        what = rng.choices(["", *STROBES], (30, 1, 1, 1))[0]
        now = {name: rng.randint(0, 1) for name in ("rights", "writes_coils", "running")}
        now["period"] = rng.choice((0, 1, 3, 9))
        await loss.clock(tick=tick, **now, **({what: 1} if what else {}))
        since += tick
        if what == "commits":
            since = 0
        elif what == "watch" and now["rights"]:
            since, limit = 0, now["period"]
            if now["writes_coils"]:
                armed = bool(now["running"])
        elif what == "take" and due:
            armed = False
    assert seen > 30


@pytest.mark.rule("SAFE-7", "SAFE-4")
def test_master_loss(sim):
    run("master_loss", "tb.rtl.test_master_loss", sim=sim)
