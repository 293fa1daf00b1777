# SPDX-License-Identifier: Apache-2.0
"""request_fate: candidate, committed or revoked, spent; and the rights of an order for it."""

from __future__ import annotations

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.lib.bench import Bench, Strobes
from tb.lib.runner import run

STROBES = """
    candidate commit revoke start_seen queue_reply keep used reply_left command_left
""".split()  # noqa: SIM905


class Fate:
    """The machine on a quiet line, and the request that it holds."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(
            dut, broadcast=0, writes_coils=1, silent=1, queue_ticket=0, **dict.fromkeys(STROBES, 0)
        )

    async def start(self) -> Fate:
        await self.bench.start()
        return self

    async def pulse(self, *names: str) -> None:
        for name in names:
            getattr(self.dut, name).value = 1
        await self.bench.clocks()
        for name in names:
            getattr(self.dut, name).value = 0

    async def candidate(self, *more: str, broadcast: int = 0) -> None:
        """A new candidate; orders are for it from now on."""
        self.dut.broadcast.value = broadcast
        await self.pulse("candidate", *more)
        self.dut.queue_ticket.value = self.dut.ticket.value.to_unsigned()
        await Timer(1, unit="ns")

    def are(self, *names: str) -> set[str]:
        """Which of these outputs are 1."""
        return {name for name in names if int(getattr(self.dut, name).value)}

    @property
    def status(self) -> set[str]:
        return self.are("is_candidate", "is_committed", "answerable")

    @property
    def rights(self) -> set[str]:
        return self.are("takes_reply", "takes_telegram", "licenses")


@cocotb.test()
async def a_candidate_may_prepare_and_a_committed_request_licenses(dut):
    fate = await Fate(dut).start()
    assert not fate.status and not fate.rights
    await fate.candidate()
    assert fate.status == {"is_candidate"} and fate.rights == {"takes_reply", "takes_telegram"}
    await fate.pulse("commit")
    assert fate.status == {"is_committed", "answerable"}
    assert fate.rights == {"takes_reply", "takes_telegram", "licenses"}


@cocotb.test()
@cocotb.parametrize(by=["revoke", "start_seen"])
async def a_character_takes_a_candidate_back(dut, by):
    fate = await Fate(dut).start()
    await fate.candidate()
    dut.silent.value = 0
    await fate.pulse(by)
    dut.silent.value = 1
    await fate.pulse("commit")
    assert not fate.status and not fate.rights


@cocotb.test()
async def a_commit_needs_a_silent_line_and_a_candidate(dut):
    fate = await Fate(dut).start()
    await fate.pulse("commit")
    assert not fate.status
    for early in (True, False):
        dut.silent.value = int(early)
        await fate.candidate(*([] if early else ["commit"]))
        dut.silent.value = 0
        if early:
            await fate.pulse("commit")
        assert not fate.status, "a candidate whose commit has passed would stay for ever"


@cocotb.test()
async def candidate_and_commit_may_come_in_one_clock(dut):
    fate = await Fate(dut).start()
    await fate.candidate("commit")
    assert fate.status == {"is_committed", "answerable"}


@cocotb.test()
async def a_character_after_the_commit_ends_the_answer_and_not_the_licence(dut):
    fate = await Fate(dut).start()
    await fate.candidate()
    await fate.pulse("commit")
    dut.silent.value = 0
    await fate.pulse("start_seen")
    assert fate.status == {"is_committed"} and fate.rights == {"takes_telegram", "licenses"}


@cocotb.test()
@cocotb.parametrize(by=["reply_left", "command_left"])
async def what_has_left_spends_the_request(dut, by):
    fate = await Fate(dut).start()
    await fate.candidate()
    await fate.pulse("commit")
    await fate.pulse(by)
    assert not fate.rights & {"licenses", "takes_telegram"}
    assert ("answerable" in fate.status) == (by == "command_left")
    await fate.candidate()
    await fate.pulse("commit")
    assert "licenses" in fate.rights, "the next one is as good as new"


@cocotb.test()
async def a_broadcast_takes_no_reply_and_is_spent_when_the_firmware_is_done(dut):
    fate = await Fate(dut).start()
    await fate.candidate(broadcast=1)
    await fate.pulse("commit")
    assert fate.rights == {"takes_telegram", "licenses"}
    await fate.pulse("queue_reply")
    assert not fate.rights


@cocotb.test()
async def an_older_ticket_has_no_rights(dut):
    fate = await Fate(dut).start()
    before = dut.ticket.value.to_unsigned()  # a reset does not set it back
    for number in range(before + 1, before + 18):
        await fate.candidate()
        assert dut.ticket.value.to_unsigned() == number % 16
        await fate.pulse("commit")
        for older in range(1, 16):
            dut.queue_ticket.value = (number - older) % 16
            await Timer(1, unit="ns")
            assert not fate.rights and not int(dut.current.value)


@cocotb.test()
@cocotb.parametrize(order=["before", "with", "after"])
async def a_licence_is_kept_at_the_commit_or_later_and_once(dut, order):
    """It spends the request, whose reply stays (FRAME-7)."""
    fate = await Fate(dut).start()
    kept = Strobes(dut, "kept")
    await fate.candidate()
    if order == "before":
        await fate.pulse("keep")
        assert not len(kept), "a candidate has no licence"
    await fate.pulse("commit", *(["keep"] if order == "with" else []))
    assert len(kept) == (order != "after")
    for _ in range(2):
        await fate.pulse("keep")
        assert len(kept) == 1
    assert fate.rights == {"takes_reply"} and "answerable" in fate.status


@cocotb.test()
@cocotb.parametrize(by=["revoke", "start_seen", "commit", "candidate", "rst"])
async def what_ends_a_candidate_ends_the_order_to_keep(dut, by):
    fate = await Fate(dut).start()
    kept = Strobes(dut, "kept")
    await fate.candidate()
    await fate.pulse("keep")
    dut.silent.value = int(by in ("candidate", "rst"))
    await fate.pulse(by)
    dut.silent.value = 1
    if by != "candidate":
        await fate.candidate()
    await fate.pulse("commit")
    assert "is_committed" in fate.status and not len(kept)


@cocotb.test()
async def a_request_with_a_telegram_of_its_own_keeps_nothing(dut):
    fate = await Fate(dut).start()
    kept = Strobes(dut, "kept")
    await fate.candidate()
    await fate.pulse("keep")
    await fate.pulse("commit", "used")
    await fate.pulse("keep", "used")
    dut.queue_ticket.value = (int(dut.ticket.value) - 1) % 16
    await fate.pulse("keep")
    assert not len(kept) and "licenses" not in fate.rights
    dut.queue_ticket.value = int(dut.ticket.value)
    await fate.pulse("keep")
    assert len(kept) == 1


@cocotb.test()
async def a_reset_forgets_the_request_and_keeps_the_count(dut):
    fate = await Fate(dut).start()
    await fate.candidate()
    await fate.pulse("commit")
    ticket = dut.ticket.value.to_unsigned()
    await fate.pulse("rst")
    assert not fate.status and not fate.rights
    assert dut.ticket.value.to_unsigned() == ticket


@pytest.mark.rule("FRAME-6", "FRAME-7", "FC-9", "MAP-9")
def test_request_fate(sim):
    run("request_fate", "tb.rtl.test_request_fate", sim=sim)
