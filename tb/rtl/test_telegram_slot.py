# SPDX-License-Identifier: Apache-2.0
"""telegram_slot: no telegram without a licence, and one repeat at most."""

from __future__ import annotations

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.lib.bench import Bench, Strobes
from tb.lib.runner import run

STROBES = "queue use_place again touched candidate commits withdrawn reply_left closing".split()  # noqa: SIM905
PLACE = {"place_valid": 0, "place_control": 0, "place_to_all": 0, "place_stop": 0, "others_wait": 0}
LEVELS = {"broadcast": 0, "writes_coils": 0, "quiet": 1, "loopback_open": 0, **PLACE}
# Rights of the newest request, as request_fate gives them.
NOBODY = {"current": 0, "takes_telegram": 0, "licenses": 0}
CANDIDATE = {"current": 1, "takes_telegram": 1, "licenses": 0}
COMMITTED = {"current": 1, "takes_telegram": 1, "licenses": 1}


class Slot:
    """The place on a quiet line, and a candidate."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, **dict.fromkeys(STROBES, 0), **LEVELS, **CANDIDATE)
        self.starts = Strobes(dut, "start", "control")

    async def start(self) -> Slot:
        await self.bench.start()
        return self

    def levels(self, **levels: int) -> None:
        for name, value in levels.items():
            getattr(self.dut, name).value = value

    async def pulse(self, *names: str) -> None:
        for name in names:
            getattr(self.dut, name).value = 1
        await self.bench.clocks()
        for name in names:
            getattr(self.dut, name).value = 0

    async def committed(self) -> None:
        await self.pulse("commits")
        self.levels(**COMMITTED)

    async def newer(self, commits: bool) -> None:
        """A newer request."""
        await self.pulse("candidate")
        self.levels(**CANDIDATE)
        if commits:
            await self.committed()

    async def left(self) -> int:
        await self.bench.clocks(4)
        return len(self.starts)


@cocotb.test()
async def a_prepared_telegram_leaves_with_the_commit(dut):
    slot = await Slot(dut).start()
    await slot.pulse("queue")
    assert await slot.left() == 0 and int(dut.queued.value)
    await slot.committed()
    assert await slot.left() == 1 and int(dut.started.value) and not int(dut.queued.value)


@cocotb.test()
@cocotb.parametrize(by=["withdrawn", "candidate", "touched", "rst"])
async def what_ends_the_candidate_or_its_bytes_takes_the_telegram(dut, by):
    slot = await Slot(dut).start()
    await slot.pulse("queue")
    await slot.pulse(by)
    await slot.committed()
    assert await slot.left() == 0


@cocotb.test()
async def an_order_without_rights_makes_nothing(dut):
    slot = await Slot(dut).start()
    slot.levels(**NOBODY)
    await slot.pulse("queue")
    await slot.pulse("commits")
    assert await slot.left() == 0


@cocotb.test()
async def a_licence_outlives_newer_requests_until_the_line_is_quiet(dut):
    slot = await Slot(dut).start()
    slot.levels(quiet=0)
    await slot.pulse("queue")
    await slot.committed()
    await slot.newer(commits=True)
    assert await slot.left() == 0
    slot.levels(quiet=1)
    assert await slot.left() == 1
    await slot.pulse("again")
    assert await slot.left() == 1, "a newer request has committed: no repeat"


@cocotb.test()
@cocotb.parametrize(
    ended_by=["nothing", "reply_left", "a newer commit", "touched", "a broadcast", "a newer candidate"]
)
async def there_is_one_repeat_and_it_can_be_lost(dut, ended_by):
    slot = await Slot(dut).start()
    slot.levels(broadcast=int(ended_by == "a broadcast"))
    await slot.pulse("queue")
    await slot.committed()
    assert await slot.left() == 1
    if ended_by in ("reply_left", "touched"):
        await slot.pulse(ended_by)
    elif ended_by.startswith("a newer"):
        await slot.newer(commits=ended_by == "a newer commit")
    await slot.pulse("again")
    assert await slot.left() == 1 + (ended_by in ("nothing", "a newer candidate"))
    await slot.pulse("again")
    assert await slot.left() == 1 + (ended_by in ("nothing", "a newer candidate"))


@cocotb.test()
@cocotb.parametrize(writes=[0, 1], early=[False, True])
async def only_a_write_of_coils_has_control(dut, writes, early):
    slot = await Slot(dut).start()
    command = Strobes(dut, "command_left")
    slot.levels(writes_coils=writes)
    if early:
        await slot.pulse("queue")
    await slot.committed()
    if not early:
        await slot.pulse("queue")
    assert await slot.left() == 1
    assert slot.starts.values == [(writes,)] and len(command) == writes


@cocotb.test()
@cocotb.parametrize(order=["queue", "use_place", "again", "touched"])
async def no_telegram_starts_in_the_clock_of_an_order(dut, order):
    slot = await Slot(dut).start()
    slot.levels(quiet=0)
    await slot.pulse("queue")
    await slot.committed()
    slot.levels(quiet=1)
    await slot.pulse(order)
    assert not len(slot.starts)


@cocotb.test()
@cocotb.parametrize(valid=[0, 1], control=[0, 1], also=["", "candidate", "withdrawn", "commits"])
async def a_licence_from_a_place_counts_at_once_whatever_a_candidate_does(dut, valid, control, also):
    slot = await Slot(dut).start()
    slot.levels(**NOBODY, writes_coils=1 - control, place_valid=valid, place_control=control)
    await slot.pulse("use_place", *([also] if also else []))
    assert await slot.left() == valid and slot.starts.values == [(control,)] * valid


@cocotb.test()
@cocotb.parametrize(
    ended_by=[
        *("nothing", "a newer commit", "another that waits", "to all", "touched"),
        *("reply_left", "reply to it"),
    ]
)
async def what_came_from_a_place_has_one_repeat_and_can_lose_it(dut, ended_by):
    slot = await Slot(dut).start()
    slot.levels(**(COMMITTED if ended_by == "reply to it" else NOBODY), place_valid=1)
    slot.levels(place_to_all=int(ended_by == "to all"))
    await slot.pulse("use_place")
    slot.levels(place_valid=0)
    assert await slot.left() == 1
    if ended_by == "a newer commit":
        await slot.newer(commits=True)
    elif ended_by == "another that waits":
        slot.levels(others_wait=1)
    elif ended_by in ("touched", "reply_left"):
        await slot.pulse(ended_by)
    elif ended_by == "reply to it":
        await slot.pulse("reply_left")
    for _ in range(2):
        await slot.pulse("again")
        # A reply to a newer request does not answer this one.
        assert await slot.left() == 1 + (ended_by in ("nothing", "a newer commit", "reply_left"))


@cocotb.test()
async def the_stop_is_shown_until_the_next_order(dut):
    slot = await Slot(dut).start()
    slot.levels(**NOBODY, place_valid=1, place_control=1, place_stop=1)
    await slot.pulse("use_place")
    slot.levels(place_stop=0)
    await slot.pulse("candidate")
    await slot.pulse("commits")
    assert await slot.left() == 1 and int(dut.stop.value)
    await slot.pulse("again")
    assert await slot.left() == 2 and int(dut.stop.value), "its repeat, too"
    await slot.pulse("use_place")
    assert not int(dut.stop.value)
    slot.levels(**COMMITTED, place_stop=1)
    await slot.pulse("queue")
    assert not int(dut.stop.value), "an order of a request is no stop"


@cocotb.test()
async def own_shows_that_the_newest_request_licenses_the_telegram_here(dut):
    async def own() -> int:
        await Timer(1, unit="ns")
        return int(dut.own.value)

    slot = await Slot(dut).start()
    slot.levels(quiet=0)
    await slot.pulse("queue")
    assert not await own(), "a candidate has no licence"
    dut.commits.value = 1
    assert await own(), "in the clock of the commit"
    await slot.committed()
    assert await own()
    await slot.pulse("candidate")
    slot.levels(**CANDIDATE)
    dut.commits.value = 1
    assert not await own(), "the newest request is another"
    await slot.committed()
    assert not await own()
    slot.levels(quiet=1)
    assert await slot.left() == 1


@cocotb.test()
async def the_loop_back_test_has_licence_and_no_command_and_its_end_takes_all(dut):
    slot = await Slot(dut).start()
    slot.levels(**NOBODY, loopback_open=1, writes_coils=1)
    await slot.pulse("queue")
    assert await slot.left() == 1 and slot.starts.values == [(0,)]
    slot.levels(quiet=0)
    await slot.pulse("queue")
    slot.levels(loopback_open=0, quiet=1, closing=1)
    await slot.bench.clocks()
    slot.levels(closing=0)
    assert await slot.left() == 1


@cocotb.test()
@cocotb.parametrize(half=["held", "opposite"])
async def a_flip_lets_no_repeat_pass_a_newer_request(dut, half):
    """The repeat waits for a busy line. Its licence has gone with the newer commit (FC-9, SAFE-4)."""
    slot = await Slot(dut).start()
    await slot.pulse("queue")
    await slot.committed()
    assert await slot.left() == 1
    slot.levels(quiet=0)
    await slot.pulse("again")
    await slot.newer(commits=False)
    bit = getattr(dut.fresh_i, half)
    bit.value = 1 - int(bit.value)
    await Timer(1, unit="ps")
    assert int(dut.fault.value)
    await slot.committed()
    slot.levels(quiet=1)
    assert await slot.left() == 1


@pytest.mark.rule("FRAME-6", "FC-8", "FC-9", "LOOP-1", "SAFE-1", "SAFE-7")
def test_telegram_slot(sim):
    run("telegram_slot", "tb.rtl.test_telegram_slot", sim=sim)
