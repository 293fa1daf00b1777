# SPDX-License-Identifier: Apache-2.0
"""commit_gate: what the firmware queued leaves after the commit, or never."""

from __future__ import annotations

from functools import reduce

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.lib.bench import Bench, Strobes
from tb.lib.runner import run

INPUTS = """
    candidate commit revoke broadcast writes_coils modbus_start_seen modbus_silent modbus_quiet
    drive_good drive_bad drive_quiet
    queue_reply reply_empty reply_after_drive queue_telegram use_waiting waiting_to_all repeat_telegram
    keep_write telegram_touched queue_ticket
    beat waiting_stop watch running period
    loopback_open
""".split()  # noqa: SIM905 (a table reads better than a list)


# Registers of candidate, commit and licence. On Verilator a write to a register that is a port is lost, so
# PORTS flip on Icarus only.
PORTS = [] if getattr(cocotb, "SIM_NAME", "") == "Verilator" else ["is_candidate", "telegram_queued"]
BITS = ["committed", "uncommitted", "licensed", "unlicensed", *PORTS]


# Where each bit lies in the machines of the gate.
PLACES = {
    "committed": "request_i.committed_i.held",
    "uncommitted": "request_i.committed_i.opposite",
    "licensed": "telegram_i.licence_i.held",
    "unlicensed": "telegram_i.licence_i.opposite",
    "is_candidate": "request_i.is_candidate",
    "telegram_queued": "telegram_i.queued",
}


async def flip(dut, name: str) -> None:
    bit = reduce(getattr, PLACES[name].split("."), dut)
    flipped = 1 - int(bit.value)
    bit.value = flipped
    await Timer(1, unit="ps")
    assert int(bit.value) == flipped


class Gate:
    """The gate with both lines silent, and verbs for what may happen to it."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, **dict.fromkeys(INPUTS, 0))
        self.replies = Strobes(dut, "reply_start")
        self.telegrams = Strobes(dut, "telegram_start", "telegram_control")

    async def start(self) -> Gate:
        await self.bench.start()
        self.dut.modbus_silent.value = self.dut.modbus_quiet.value = 1
        self.dut.drive_quiet.value = 1
        return self

    async def pulse(self, *names: str, **levels: int) -> None:
        """One clock with these strobes high and these levels given."""
        for name, value in levels.items():
            getattr(self.dut, name).value = value
        for name in names:
            getattr(self.dut, name).value = 1
        await self.bench.clocks()
        for name in names:
            getattr(self.dut, name).value = 0

    async def candidate(self, broadcast: int = 0, writes_coils: int = 0) -> int:
        await self.pulse("candidate", broadcast=broadcast, writes_coils=writes_coils)
        return self.dut.ticket.value.to_unsigned()

    async def queue_reply(self, ticket: int, after_drive: int = 0, empty: int = 0) -> None:
        await self.pulse("queue_reply", queue_ticket=ticket, reply_after_drive=after_drive, reply_empty=empty)

    async def queue_telegram(self, ticket: int, repeat: int = 0) -> None:
        await self.pulse("repeat_telegram" if repeat else "queue_telegram", queue_ticket=ticket)

    async def keep(self, ticket: int) -> None:
        await self.pulse("keep_write", queue_ticket=ticket)

    async def use(self, ticket: int, to_all: int = 0) -> None:
        """Orders a telegram with the licence of a write that waits."""
        await self.pulse("use_waiting", queue_ticket=ticket, waiting_to_all=to_all)

    async def kept(self, early: bool = True, **kind: int) -> int:
        """A committed write whose licence waits; returns its ticket."""
        ticket = await self.candidate(**kind)
        if early:
            await self.keep(ticket)
        await self.pulse("commit")
        if not early:
            await self.keep(ticket)
        return ticket

    async def settle(self) -> tuple[int, int]:
        """How many replies and telegrams have started so far, some clocks on."""
        await self.bench.clocks(5)
        return len(self.replies), len(self.telegrams)


@cocotb.test()
async def what_is_queued_for_a_candidate_leaves_at_the_commit_and_not_before(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.queue_reply(ticket)
    await gate.queue_telegram(ticket)
    assert await gate.settle() == (0, 0) and not int(dut.telegram_started.value)
    await gate.pulse("commit")
    assert await gate.settle() == (1, 1) and int(dut.telegram_started.value)
    dut.drive_quiet.value = 0
    await gate.queue_telegram(ticket, repeat=1)
    assert not int(dut.telegram_started.value), "the repeat has not"


@cocotb.test()
async def a_revoke_drops_both_and_a_late_queue_too(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.queue_reply(ticket)
    await gate.queue_telegram(ticket)
    await gate.pulse("revoke")
    assert not int(dut.reply_queued.value) and not int(dut.telegram_queued.value)
    await gate.queue_reply(ticket)
    await gate.queue_telegram(ticket)
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 0)
    await gate.pulse("commit")  # of a frame for somebody else: none is signalled, but it must not help
    assert int(dut.telegram_queued.value) == 0 and int(dut.reply_queued.value) == 0


@cocotb.test()
@cocotb.parametrize(end=["revoke", "a newer candidate"])
async def the_next_commit_lets_nothing_of_an_uncommitted_request_out(dut, end):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.queue_reply(ticket)
    await gate.queue_telegram(ticket)
    if end == "revoke":
        await gate.pulse("revoke")
    await gate.candidate()
    assert not int(dut.reply_queued.value) and not int(dut.telegram_queued.value)
    await gate.pulse("commit")
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 0)


@cocotb.test()
async def a_stale_telegram_queued_in_the_very_clock_of_the_commit_is_not_licensed(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.pulse("commit", "queue_telegram", queue_ticket=(ticket - 1) % 16)
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 0)


@cocotb.test()
async def a_queue_after_the_commit_leaves_at_once(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.pulse("commit")
    await gate.queue_reply(ticket)
    await gate.queue_telegram(ticket)
    assert await gate.settle() == (1, 1)


@cocotb.test()
async def each_request_gets_one_reply(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.pulse("commit")
    await gate.queue_reply(ticket)
    await gate.queue_reply(ticket)
    await gate.queue_reply(ticket)
    assert await gate.settle() == (1, 0)


@cocotb.test()
async def every_wrong_ticket_is_ignored(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    for _ in ("candidate", "committed"):
        for wrong in range(16):
            if wrong != ticket:
                await gate.queue_reply(wrong)
                await gate.queue_telegram(wrong)
                assert not int(dut.reply_queued.value) and not int(dut.telegram_queued.value)
        await gate.pulse("commit")
    assert await gate.settle() == (0, 0)


@cocotb.test()
async def nothing_leaves_before_the_first_request(dut):
    gate = await Gate(dut).start()
    for ticket in range(16):
        await gate.queue_reply(ticket)
        await gate.queue_telegram(ticket)
        await gate.queue_telegram(ticket, repeat=1)
    await gate.pulse("commit")
    assert await gate.settle() == (0, 0)


@cocotb.test()
async def tickets_count_candidates(dut):
    gate = await Gate(dut).start()
    first = await gate.candidate()
    for n in range(1, 40):
        await gate.pulse("revoke" if n % 3 else "commit")
        assert await gate.candidate() == (first + n) % 16


@cocotb.test()
async def a_character_after_the_commit_drops_the_reply_but_not_the_telegram(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    dut.drive_quiet.value = 0
    await gate.pulse("commit")
    await gate.queue_telegram(ticket)
    dut.modbus_quiet.value = 0
    await gate.queue_reply(ticket)
    assert int(dut.reply_queued.value)
    await gate.pulse("modbus_start_seen")
    assert not int(dut.reply_queued.value)
    dut.modbus_quiet.value = 1
    await gate.queue_reply(ticket)
    assert await gate.settle() == (0, 0)
    dut.drive_quiet.value = 1
    assert await gate.settle() == (0, 1)


@cocotb.test()
async def a_reply_waits_for_a_quiet_line(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.pulse("commit")
    dut.modbus_quiet.value = 0
    await gate.queue_reply(ticket)
    assert await gate.settle() == (0, 0)
    dut.modbus_quiet.value = 1
    assert await gate.settle() == (1, 0)


@cocotb.test()
async def a_reply_after_the_drive_waits_for_good_and_dies_with_bad(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.pulse("commit")
    await gate.queue_reply(ticket, after_drive=1)
    assert await gate.settle() == (0, 0)
    await gate.pulse("drive_bad")
    dut.drive_good.value = 1
    assert await gate.settle() == (0, 0)
    dut.drive_good.value = 0
    await gate.queue_reply(ticket, after_drive=1)
    dut.reply_after_drive.value = 0  # it belongs to the order
    assert await gate.settle() == (0, 0)
    dut.drive_good.value = 1
    assert await gate.settle() == (1, 0)


@cocotb.test()
async def a_bad_telegram_from_the_drive_leaves_a_plain_reply_alone(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.queue_reply(ticket)
    await gate.pulse("drive_bad")
    await gate.pulse("commit")
    assert await gate.settle() == (1, 0)


@cocotb.test()
async def a_broadcast_is_never_answered_but_goes_to_the_drive(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate(broadcast=1)
    await gate.queue_reply(ticket)
    await gate.queue_telegram(ticket)
    await gate.pulse("commit")
    await gate.queue_reply(ticket)
    assert await gate.settle() == (0, 1)


@cocotb.test()
async def length_0_takes_a_reply_back(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.queue_reply(ticket)
    await gate.queue_reply(ticket, empty=1)
    await gate.pulse("commit")
    assert await gate.settle() == (0, 0)


@cocotb.test()
@cocotb.parametrize(first=["before", "after"])
async def a_telegram_has_one_repeat(dut, first):
    """Queued before or after its commit; a newer candidate, revoked or not, does not end it (FC-9)."""
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    if first == "after":
        await gate.pulse("commit")
    await gate.queue_telegram(ticket)
    await gate.queue_telegram(ticket, repeat=1)  # of what has not left yet
    await gate.queue_telegram(ticket)
    if first == "before":
        await gate.pulse("commit")
    assert await gate.settle() == (0, 1)
    await gate.candidate()
    assert await gate.settle() == (0, 1)
    await gate.pulse("revoke")
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 2)
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 2)


@cocotb.test()
@cocotb.parametrize(waits=[False, True])
async def a_newer_commit_ends_the_right_to_a_repeat(dut, waits):
    """No older command goes out once more after a newer one (FRAME-7, SAFE-4)."""
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.queue_telegram(ticket)
    await gate.pulse("commit")
    assert await gate.settle() == (0, 1)
    if waits:
        dut.drive_quiet.value = 0
        await gate.queue_telegram(ticket, repeat=1)
        assert int(dut.telegram_queued.value)
    newer = await gate.candidate()
    await gate.pulse("commit")
    dut.drive_quiet.value = 1
    if not waits:
        await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 1)
    await gate.queue_telegram(newer)
    assert await gate.settle() == (0, 2)


@cocotb.test()
async def what_left_behind_a_newer_commit_is_not_repeated(dut):
    gate = await Gate(dut).start()
    dut.drive_quiet.value = 0
    ticket = await gate.candidate()
    await gate.queue_telegram(ticket)
    await gate.pulse("commit")
    await gate.candidate()
    await gate.pulse("commit")
    dut.drive_quiet.value = 1
    assert await gate.settle() == (0, 1)
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 1)


@cocotb.test()
async def a_broadcast_is_not_repeated(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate(broadcast=1, writes_coils=1)
    await gate.queue_telegram(ticket)
    await gate.pulse("commit")
    assert await gate.settle() == (0, 1)
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 1)


@cocotb.test()
@cocotb.parametrize(writes_coils=[0, 1], broadcast=[0, 1])
async def a_write_of_coils_makes_one_telegram_other_requests_may_make_two(dut, writes_coils, broadcast):
    gate = await Gate(dut).start()
    ticket = await gate.candidate(writes_coils=writes_coils, broadcast=broadcast)
    await gate.pulse("commit")
    await gate.queue_telegram(ticket)
    assert await gate.settle() == (0, 1)
    await gate.queue_telegram(ticket)
    assert await gate.settle() == (0, 2 - writes_coils)


@cocotb.test()
async def a_commit_counts_on_a_silent_line_and_for_a_candidate_only(dut):
    """One flipped bit must not make one (SAFE-4)."""
    gate = await Gate(dut).start()
    await gate.pulse("commit")
    await gate.queue_telegram(dut.ticket.value.to_unsigned())
    assert await gate.settle() == (0, 0)
    ticket = await gate.candidate()
    await gate.queue_telegram(ticket)
    dut.modbus_silent.value = dut.modbus_quiet.value = 0
    await gate.pulse("commit")
    dut.modbus_silent.value = dut.modbus_quiet.value = 1
    assert dut.is_candidate.value == 0, "it would wait for ever"
    await gate.pulse("commit")
    assert await gate.settle() == (0, 0)


@cocotb.test()
async def a_pulse_in_the_clock_of_the_commit_costs_nothing(dut):
    """The line is silent, its pin is low (LINE-5)."""
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.queue_telegram(ticket)
    await gate.queue_reply(ticket)
    dut.modbus_quiet.value = 0
    await gate.pulse("commit")
    assert await gate.settle() == (0, 1)
    dut.modbus_quiet.value = 1
    assert await gate.settle() == (1, 1)


@cocotb.test()
async def a_start_bit_is_enough_to_revoke(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.queue_telegram(ticket)
    await gate.queue_reply(ticket)
    dut.modbus_silent.value = dut.modbus_quiet.value = 0
    await gate.pulse("modbus_start_seen")
    dut.modbus_silent.value = dut.modbus_quiet.value = 1
    assert dut.is_candidate.value == 0 and dut.is_committed.value == 0
    await gate.pulse("commit")
    assert await gate.settle() == (0, 0)


@cocotb.test()
@cocotb.parametrize(name=BITS)
async def no_single_bit_sends_what_is_not_committed(dut, name):
    gate = await Gate(dut).start()
    ticket = await gate.candidate(writes_coils=1)
    await gate.queue_telegram(ticket)
    await flip(dut, name)
    assert await gate.settle() == (0, 0)
    await gate.queue_telegram(ticket)
    assert await gate.settle() == (0, 0)
    assert dut.is_committed.value == 0


@cocotb.test()
@cocotb.parametrize(name=BITS, revoked_first=[False, True], queued_first=[False, True])
async def no_single_bit_sends_what_was_revoked(dut, name, revoked_first, queued_first):
    gate = await Gate(dut).start()
    ticket = await gate.candidate(writes_coils=1)
    if queued_first:
        await gate.queue_telegram(ticket)
    if revoked_first:
        await gate.pulse("revoke")
    await flip(dut, name)
    await gate.bench.clocks()
    if not revoked_first:
        await gate.pulse("revoke")
    for _ in range(2):
        assert await gate.settle() == (0, 0)
        assert dut.is_committed.value == 0, "nor is the firmware told so"
        await gate.queue_telegram(ticket)


@cocotb.test()
@cocotb.parametrize(name=["committed", "uncommitted"])
async def no_single_bit_outlives_the_next_request(dut, name):
    gate = await Gate(dut).start()
    for writes_coils in (0, 1):
        await flip(dut, name)
        ticket = await gate.candidate(writes_coils=writes_coils)
        assert dut.is_committed.value == 0
        await gate.queue_telegram(ticket)
        await gate.pulse("commit")
        assert dut.is_committed.value == 1
        assert await gate.settle() == (0, 1 + writes_coils)


@cocotb.test()
@cocotb.parametrize(name=PORTS[1:], older=["revoked", "of no request", "repeated", "answered"])
async def no_single_bit_licenses_an_older_telegram(dut, name, older):
    """Its bytes still lie in the memory; the newer request's commit is not for them."""
    gate = await Gate(dut).start()
    ticket = await gate.candidate(writes_coils=1)
    await gate.queue_telegram((ticket + (older == "of no request")) % 16)
    await gate.pulse("revoke" if older == "revoked" else "commit")
    await gate.settle()
    if older == "repeated":
        await gate.queue_telegram(ticket, repeat=1)
    elif older == "answered":
        await gate.queue_reply(ticket)
    sent = await gate.settle()
    assert sent == {"repeated": (0, 2), "answered": (1, 1)}.get(older, (0, 0))
    ticket = await gate.candidate(writes_coils=1)
    await flip(dut, name)
    await gate.pulse("commit")
    assert await gate.settle() == sent
    await gate.queue_telegram(ticket)
    assert await gate.settle() == (sent[0], sent[1] + 1), "its own leaves"


@cocotb.test()
async def the_end_of_the_loop_back_test_takes_back_what_is_queued(dut):
    gate = await Gate(dut).start()
    dut.loopback_open.value = 1
    dut.drive_quiet.value = 0
    dut.modbus_quiet.value = 0
    await gate.queue_telegram(5)
    await gate.queue_reply(5)
    dut.loopback_open.value = 0
    dut.drive_quiet.value = 1
    dut.modbus_quiet.value = 1
    assert await gate.settle() == (0, 0)
    assert not int(dut.reply_queued.value) and not int(dut.telegram_queued.value)
    await gate.candidate()
    await gate.pulse("commit")
    await gate.queue_telegram(5, repeat=1)
    assert await gate.settle() == (0, 0)


@cocotb.test()
@cocotb.parametrize(committed=[False, True], writes_coils=[0, 1])
async def only_a_write_of_coils_licenses_a_command(dut, committed, writes_coils):
    """Queued before or after its commit; the repeat is as the telegram was, whoever has come since."""
    gate = await Gate(dut).start()
    ticket = await gate.candidate(writes_coils=writes_coils)
    if committed:
        await gate.pulse("commit")
        await gate.queue_telegram(ticket)
    else:
        await gate.queue_telegram(ticket)
        await gate.pulse("commit")
    await gate.settle()
    await gate.candidate(writes_coils=1 - writes_coils)
    await gate.queue_telegram(ticket, repeat=1)
    await gate.settle()
    assert gate.telegrams.values == [(writes_coils,)] * 2


@cocotb.test()
@cocotb.parametrize(writes_coils=[0, 1])
async def a_telegram_that_waits_keeps_what_it_may_while_the_next_request_commits(dut, writes_coils):
    gate = await Gate(dut).start()
    dut.drive_quiet.value = 0
    ticket = await gate.candidate(writes_coils=writes_coils)
    await gate.queue_telegram(ticket)
    await gate.pulse("commit")
    newer = await gate.candidate(writes_coils=1 - writes_coils)
    await gate.pulse("commit")
    dut.drive_quiet.value = 1
    await gate.settle()
    assert gate.telegrams.values == [(writes_coils,)]
    await gate.queue_telegram(newer)
    await gate.settle()
    assert gate.telegrams.values == [(writes_coils,), (1 - writes_coils,)]


@cocotb.test()
async def touching_the_telegram_ends_its_licence(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.queue_telegram(ticket)
    await gate.pulse("commit")
    assert await gate.settle() == (0, 1)
    await gate.pulse("telegram_touched")
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 1)
    await gate.queue_telegram(ticket)  # the request still stands: a second exchange for it
    assert await gate.settle() == (0, 2)


@cocotb.test()
async def a_request_that_has_its_reply_licenses_nothing_more(dut):
    """Whatever a flipped bit makes the firmware queue (SAFE-4)."""
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.pulse("commit")
    await gate.queue_reply(ticket)
    assert await gate.settle() == (1, 0)
    await gate.queue_telegram(ticket)
    assert await gate.settle() == (1, 0)
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (1, 0)
    # A revoked candidate does not clear `spent`; the next committed request is not spent.
    newer = await gate.candidate()
    await gate.pulse("revoke")
    await gate.queue_telegram(newer)
    assert await gate.settle() == (1, 0)
    newest = await gate.candidate()
    await gate.pulse("commit")
    await gate.queue_telegram(newest)
    assert await gate.settle() == (1, 1)


@cocotb.test()
async def a_reply_ends_the_right_to_a_repeat(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.queue_telegram(ticket)
    await gate.pulse("commit")
    assert await gate.settle() == (0, 1)
    dut.drive_quiet.value = 0
    await gate.queue_telegram(ticket, repeat=1)
    await gate.queue_reply(ticket)
    assert await gate.settle() == (1, 1)
    dut.drive_quiet.value = 1
    assert await gate.settle() == (1, 1)
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (1, 1)


@cocotb.test()
async def a_reply_does_not_take_back_an_older_telegram_that_waits_for_the_line(dut):
    gate = await Gate(dut).start()
    dut.drive_quiet.value = 0
    ticket = await gate.candidate()
    await gate.queue_telegram(ticket)
    await gate.pulse("commit")
    newer = await gate.candidate()
    await gate.pulse("commit")
    await gate.queue_reply(newer)
    assert await gate.settle() == (1, 0)
    dut.drive_quiet.value = 1
    assert await gate.settle() == (1, 1)


@cocotb.test()
async def a_broadcast_is_spent_when_the_firmware_says_so(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate(broadcast=1)
    await gate.queue_telegram(ticket)
    await gate.pulse("commit")
    assert await gate.settle() == (0, 1)
    await gate.queue_reply((ticket - 1) % 16, empty=1)
    await gate.queue_telegram(ticket)
    assert await gate.settle() == (0, 2), "not by another's ticket"
    await gate.queue_reply(ticket, empty=1)
    await gate.queue_telegram(ticket)
    assert await gate.settle() == (0, 2)


@cocotb.test()
async def touching_in_the_very_clock_of_the_commit_licenses_nothing(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.queue_telegram(ticket)
    await gate.pulse("commit", "telegram_touched")
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 0)


@cocotb.test()
async def candidate_and_commit_in_one_clock_serve_a_card_that_does_not_prepare_early(dut):
    gate = await Gate(dut).start()
    await gate.pulse("candidate", "commit")
    ticket = dut.ticket.value.to_unsigned()
    await gate.queue_reply(ticket)
    await gate.queue_telegram(ticket)
    assert await gate.settle() == (1, 1)


@cocotb.test()
async def a_reset_forgets_what_was_queued_and_licensed(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    dut.drive_quiet.value = 0
    await gate.queue_telegram(ticket)
    await gate.pulse("commit")
    dut.modbus_quiet.value = 0
    await gate.queue_reply(ticket)
    assert int(dut.reply_queued.value) and int(dut.telegram_queued.value)
    await gate.pulse("rst")
    assert not int(dut.reply_queued.value) and not int(dut.telegram_queued.value)
    dut.modbus_quiet.value = 1
    dut.drive_quiet.value = 1
    await gate.queue_telegram(ticket, repeat=1)
    await gate.queue_telegram(ticket)
    await gate.queue_reply(ticket)
    assert await gate.settle() == (0, 0)


@cocotb.test()
async def the_open_loop_back_test_needs_no_request_the_closed_one_does(dut):
    gate = await Gate(dut).start()
    dut.loopback_open.value = 1
    await gate.queue_telegram(5)
    assert await gate.settle() == (0, 1)
    await gate.queue_reply(5)
    assert await gate.settle() == (1, 1)
    dut.writes_coils.value = 1
    await gate.queue_telegram(0)
    assert await gate.settle() == (1, 2)
    assert gate.telegrams.values == [(0,), (0,)], "and commands nothing"
    dut.loopback_open.value = 0
    await gate.queue_telegram(5)
    await gate.queue_reply(5)
    assert await gate.settle() == (1, 2)


# ---------------------------------------------------------------- committed writes that wait (FRAME-7)


@cocotb.test()
@cocotb.parametrize(to_all=[0, 1], early=[False, True], writes_coils=[0, 1])
async def a_kept_write_leaves_after_newer_requests(dut, to_all, early, writes_coils):
    gate = await Gate(dut).start()
    ticket = await gate.kept(early, broadcast=to_all, writes_coils=writes_coils)
    if writes_coils:
        await gate.queue_telegram(ticket)
        assert await gate.settle() == (0, 0), "its right is in the place"
    newer = await gate.candidate(writes_coils=1 - writes_coils)
    await gate.pulse("commit")
    await gate.queue_reply(newer)
    assert await gate.settle() == (1, 0)
    await gate.candidate()
    await gate.use(ticket, to_all)
    assert await gate.settle() == (1, 1) and gate.telegrams.values == [(writes_coils,)]
    await gate.use(ticket, to_all)
    assert await gate.settle() == (1, 1), "once"


@cocotb.test()
async def a_kept_write_of_a_parameter_may_need_a_second_telegram(dut):
    """While it is the newest: the number was refused, so the parameter is written as a text (MAP-8)."""
    gate = await Gate(dut).start()
    ticket = await gate.kept(writes_coils=0)
    await gate.use(ticket)
    assert await gate.settle() == (0, 1)
    await gate.queue_telegram(ticket)
    assert await gate.settle() == (0, 2)


@cocotb.test()
async def a_kept_write_that_is_still_the_newest_has_its_reply(dut):
    gate = await Gate(dut).start()
    ticket = await gate.kept(writes_coils=1)
    await gate.use(ticket)
    assert await gate.settle() == (0, 1)
    await gate.queue_reply(ticket)
    assert await gate.settle() == (1, 1)
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (1, 1), "answered"


@cocotb.test()
@cocotb.parametrize(end=["revoke", "modbus_start_seen", "a newer candidate", "an uncommitted use"])
async def what_was_kept_for_a_candidate_goes_with_it(dut, end):
    gate = await Gate(dut).start()
    ticket = await gate.candidate(writes_coils=1)
    await gate.keep(ticket)
    if end in ("revoke", "modbus_start_seen"):
        dut.modbus_silent.value = dut.modbus_quiet.value = int(end == "revoke")
        await gate.pulse(end)
        dut.modbus_silent.value = dut.modbus_quiet.value = 1
    if end != "an uncommitted use":
        await gate.candidate()
        await gate.pulse("commit")
    await gate.use(ticket)
    assert await gate.settle() == (0, 0)


@cocotb.test()
@cocotb.parametrize(by=["a stale ticket", "a reply", "a command"])
async def a_request_that_has_no_right_left_keeps_none(dut, by):
    gate = await Gate(dut).start()
    ticket = await gate.candidate(writes_coils=1)
    await gate.pulse("commit")
    if by == "a reply":
        await gate.queue_reply(ticket)
    elif by == "a command":
        await gate.queue_telegram(ticket)
    before = await gate.settle()
    await gate.keep((ticket - 1) % 16 if by == "a stale ticket" else ticket)
    await gate.use(ticket)
    assert await gate.settle() == before


@cocotb.test()
async def a_request_whose_telegram_waits_already_keeps_no_second_one(dut):
    gate = await Gate(dut).start()
    dut.drive_quiet.value = 0
    ticket = await gate.candidate(writes_coils=1)
    await gate.queue_telegram(ticket)
    await gate.keep(ticket)
    await gate.pulse("commit")
    await gate.keep(ticket)
    dut.drive_quiet.value = 1
    assert await gate.settle() == (0, 1)
    await gate.use(ticket)
    assert await gate.settle() == (0, 1)


@cocotb.test()
async def one_broadcast_and_one_unicast_write_wait_and_a_newer_one_of_a_kind_takes_the_place(dut):
    gate = await Gate(dut).start()
    dut.drive_quiet.value = 0
    older = await gate.candidate(writes_coils=0)
    await gate.queue_telegram(older)
    await gate.pulse("commit")
    await gate.kept(broadcast=1, writes_coils=1)
    await gate.kept(writes_coils=0)
    unicast = await gate.kept(early=False, writes_coils=1)
    assert int(dut.telegram_queued.value), "the telegram that waits for the line stays"
    dut.drive_quiet.value = 1
    assert await gate.settle() == (0, 1)
    await gate.use(unicast, to_all=1)
    assert await gate.settle() == (0, 2)
    await gate.use(unicast)
    assert await gate.settle() == (0, 3)
    assert gate.telegrams.values == [(0,), (1,), (1,)]
    for to_all in (0, 1):
        await gate.use(unicast, to_all)
    assert await gate.settle() == (0, 3), "both places are empty"


@cocotb.test()
async def a_write_that_had_waited_is_repeated_once_behind_a_reading_and_not_before_another_write(dut):
    for other_write in (False, True):
        gate = await Gate(dut).start()
        before = len(gate.telegrams)
        ticket = await gate.kept(writes_coils=1)
        await gate.candidate()
        await gate.pulse("commit")
        await gate.use(ticket)
        if other_write:
            await gate.kept()
        assert await gate.settle() == (0, before + 1)
        await gate.queue_telegram(ticket, repeat=1)
        assert await gate.settle() == (0, before + 2 - other_write)
        await gate.queue_telegram(ticket, repeat=1)
        assert await gate.settle() == (0, before + 2 - other_write)


@cocotb.test()
async def a_broadcast_that_had_waited_is_not_repeated(dut):
    gate = await Gate(dut).start()
    ticket = await gate.kept(broadcast=1)
    await gate.use(ticket, to_all=1)
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 0), "taken back before it left"
    ticket = await gate.kept(broadcast=1)
    await gate.use(ticket, to_all=1)
    assert await gate.settle() == (0, 1)
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 1)


@cocotb.test()
@cocotb.parametrize(by=["candidate", "revoke"])
async def a_candidate_takes_nobodys_place(dut, by):
    """Nor does it in the very clock of the order."""
    gate = await Gate(dut).start()
    ticket = await gate.kept(writes_coils=1)
    newer = await gate.candidate()
    await gate.keep(newer)
    await gate.pulse(by, "use_waiting", queue_ticket=ticket, waiting_to_all=0)
    assert await gate.settle() == (0, 1) and gate.telegrams.values == [(1,)]


@cocotb.test()
async def a_restart_empties_both_places(dut):
    gate = await Gate(dut).start()
    ticket = await gate.kept(broadcast=1, writes_coils=1)
    ticket = await gate.kept(writes_coils=1)
    await gate.pulse("rst")
    for to_all in (0, 1):
        await gate.use(ticket, to_all)
    assert await gate.settle() == (0, 0)


@cocotb.test()
@cocotb.parametrize(half=["held", "opposite"], writes_coils=[0, 1])
async def no_single_bit_makes_a_licence_that_waits(dut, half, writes_coils):
    gate = await Gate(dut).start()
    ticket = await gate.candidate(broadcast=1, writes_coils=writes_coils)
    await gate.pulse("commit")
    bit = getattr(dut.broadcast_i.valid_i, half)
    bit.value = 1 - int(bit.value)
    await gate.bench.clocks()
    assert int(dut.fault.value)
    await gate.use(ticket, to_all=1)
    assert await gate.settle() == (0, 0)


@cocotb.test()
async def small_keeps_the_broadcast_alone(dut):
    gate = await Gate(dut).start()
    broadcast = await gate.kept(broadcast=1, writes_coils=1)
    unicast = await gate.kept(writes_coils=1)
    await gate.use(unicast)
    assert await gate.settle() == (0, 0)
    await gate.queue_telegram(unicast)
    assert await gate.settle() == (0, 1), "the order to keep was ignored"
    await gate.use(broadcast, to_all=1)
    assert await gate.settle() == (0, 2)


# ---------------------------------------------------------------- the stop when the master is lost (SAFE-7)

PERIOD = 4


async def ticks(gate, count: int) -> None:
    for _ in range(count):
        await gate.pulse(beat=1 - int(gate.dut.beat.value))


async def watched(gate, **kind: int) -> int:
    """A committed request, and the order to watch the master from then on."""
    ticket = await gate.candidate(**{"writes_coils": 1, **kind})
    await gate.pulse("commit")
    await gate.pulse("watch", queue_ticket=ticket, running=1, period=PERIOD)
    return ticket


async def use_stop(gate, ticket: int = 0, to_all: int = 0) -> None:
    await gate.pulse("use_waiting", queue_ticket=ticket, waiting_to_all=to_all, waiting_stop=1)
    gate.dut.waiting_stop.value = 0


@cocotb.test()
async def a_gate_without_the_option_has_no_stop(dut):
    gate = await Gate(dut).start()
    ticket = await watched(gate)
    await ticks(gate, 2 * PERIOD)
    assert not int(dut.stop_due.value)
    await use_stop(gate, ticket)
    assert await gate.settle() == (0, 0)


@cocotb.test()
@cocotb.parametrize(to_all=[0, 1])
async def stop_leaves_once_without_the_start_bit_after_the_time(dut, to_all):
    gate = await Gate(dut).start()
    stops = Strobes(dut, "telegram_start", "telegram_control", "telegram_stop")
    ticket = await watched(gate, broadcast=to_all)
    await ticks(gate, PERIOD)
    await use_stop(gate, ticket ^ 8, to_all)
    assert await gate.settle() == (0, 0) and not int(dut.stop_due.value)
    await ticks(gate, 1)
    assert int(dut.stop_due.value)
    await use_stop(gate, ticket ^ 8, to_all)
    assert await gate.settle() == (0, 1) and stops.values == [(1, 1)]
    await gate.queue_telegram(ticket, repeat=1)
    await gate.queue_telegram(ticket, repeat=1)
    assert await gate.settle() == (0, 2) and stops.values == [(1, 1)] * 2, "one repeat"
    await ticks(gate, 3 * PERIOD)
    await use_stop(gate, ticket ^ 8, to_all)
    assert await gate.settle() == (0, 2), "once"


@cocotb.test()
@cocotb.parametrize(
    without=[{"running": 0}, {"writes_coils": 0}, {"period": 0}, {"late": 1}, {"stale": 1}, {"early": 1}]
)
async def stop_has_no_licence_without_a_committed_start_and_its_time(dut, without):
    gate = await Gate(dut).start()
    ticket = await gate.candidate(writes_coils=without.get("writes_coils", 1))
    order = {"running": 1, "period": PERIOD} | {
        k: v for k, v in without.items() if k in ("running", "period")
    }
    if "early" not in without:
        await gate.pulse("commit")
    if "late" in without:
        await gate.candidate()
    await gate.pulse("watch", queue_ticket=ticket ^ 8 * ("stale" in without), **order)
    await ticks(gate, 3 * PERIOD)
    assert not int(dut.stop_due.value)
    await use_stop(gate, ticket)
    assert await gate.settle() == (0, 0)


@cocotb.test()
async def stop_and_the_writes_that_wait_keep_their_places(dut):
    gate = await Gate(dut).start()
    stops = Strobes(dut, "telegram_start", "telegram_stop")
    await watched(gate)
    await gate.kept(broadcast=1, writes_coils=1)
    ticket = await gate.kept(writes_coils=1)
    await ticks(gate, PERIOD + 1)
    await use_stop(gate, ticket ^ 8)
    assert await gate.settle() == (0, 1)
    for to_all in (0, 1):
        await gate.use(ticket, to_all)
        assert await gate.settle() == (0, 2 + to_all)
    assert stops.values == [(1,), (0,), (0,)]


@cocotb.test()
async def stop_is_refused_in_the_clock_of_a_commit(dut):
    gate = await Gate(dut).start()
    await watched(gate)
    await ticks(gate, PERIOD + 1)
    await gate.candidate()
    await gate.pulse("commit", "use_waiting", waiting_stop=1)
    assert await gate.settle() == (0, 0)


@cocotb.test()
async def stop_is_forgotten_by_a_restart(dut):
    gate = await Gate(dut).start()
    await watched(gate)
    await ticks(gate, PERIOD + 1)
    await gate.pulse("rst")
    await use_stop(gate)
    assert await gate.settle() == (0, 0)


@cocotb.test()
@cocotb.parametrize(
    bit=["armed_i.held", "armed_i.opposite", "over_i.held", "over_i.opposite"],
    state=["no start", "not yet"],
)
async def stop_is_not_licensed_by_a_single_bit(dut, bit, state):
    gate = await Gate(dut).start()
    if state == "not yet":
        await watched(gate)
        await ticks(gate, 2)
    half = reduce(getattr, bit.split("."), dut.g_loss.loss_i)
    half.value = 1 - int(half.value)
    await use_stop(gate)
    assert await gate.settle() == (0, 0)


@pytest.mark.rule("FRAME-6", "FRAME-7", "FC-9", "MAP-9", "LOOP-1", "SAFE-1", "SAFE-4")
def test_commit_gate(sim):
    run("commit_gate", "tb.rtl.test_commit_gate", sim=sim, testcase=r"(?!small_|stop_)\w+")


@pytest.mark.rule("FRAME-7")
def test_commit_gate_with_one_place(sim):
    run("commit_gate", "tb.rtl.test_commit_gate", sim=sim, parameters={"PLACES": 1}, testcase="small_.*")


@pytest.mark.rule("SAFE-7", "SAFE-4")
def test_commit_gate_with_the_stop(sim):
    run(
        "commit_gate",
        "tb.rtl.test_commit_gate",
        sim=sim,
        parameters={"MASTER_LOSS_STOP": 1},
        testcase="stop_.*",
    )
