# SPDX-License-Identifier: Apache-2.0
"""commit_gate: what the firmware queued leaves after the commit, or never."""

from __future__ import annotations

from functools import reduce

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.lib.bench import Bench, Strobes
from tb.lib.runner import run
from tb.lib.seeds import seeded

INPUTS = """
    candidate commit revoke broadcast writes_coils modbus_start_seen modbus_quiet
    drive_good drive_bad drive_quiet
    queue_reply reply_empty reply_after_drive queue_telegram telegram_repeat telegram_touched queue_ticket
    loopback_open
""".split()  # noqa: SIM905 (a table reads better than a list)


# What tells a candidate, a commit and a licence. Verilator hands out a copy of a register that is a port, and
# what is written to it is lost: these two flip on Icarus.
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
        self.dut.modbus_quiet.value = 1
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
        await self.pulse("queue_telegram", queue_ticket=ticket, telegram_repeat=repeat)

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
    assert await gate.settle() == (0, 0)
    await gate.pulse("commit")
    assert await gate.settle() == (1, 1)


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
    await gate.pulse("commit", "queue_telegram", queue_ticket=(ticket - 1) % 16, telegram_repeat=0)
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
    """No older command goes out once more behind a newer one (FRAME-7, SAFE-4)."""
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
    dut.modbus_quiet.value = 0
    await gate.pulse("commit")
    dut.modbus_quiet.value = 1
    assert await gate.settle() == (0, 0)
    await gate.pulse("commit")
    assert await gate.settle() == (0, 1)


@cocotb.test()
async def a_start_bit_is_enough_to_revoke(dut):
    gate = await Gate(dut).start()
    ticket = await gate.candidate()
    await gate.queue_telegram(ticket)
    await gate.queue_reply(ticket)
    dut.modbus_quiet.value = 0
    await gate.pulse("modbus_start_seen")
    dut.modbus_quiet.value = 1
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
    await gate.queue_telegram(ticket + (older == "of no request"))
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
    # Neither does it stain the next one, nor does the next one's candidate wash it clean.
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


ODDS = {
    "candidate": 0.08,
    "commit": 0.12,
    "revoke": 0.03,
    "modbus_start_seen": 0.03,
    "drive_bad": 0.03,
    "queue_reply": 0.2,
    "queue_telegram": 0.2,
    "telegram_touched": 0.05,
}


@cocotb.test()
async def no_random_history_lets_anything_out_without_its_commit(dut):
    """Against the promise told from the inputs alone: who may leave in this clock, not who must."""
    rng = seeded("gate history")
    gate = await Gate(dut).start()
    pending, committed, fresh, licence, queued_mine, spent = False, False, False, False, False, False
    current = dut.ticket.value.to_unsigned()  # a reset does not set it back
    may_command = False  # of the telegram that is queued
    commands = 0
    sends, newest_telegram = 0, False
    left = {"reply": 0, "telegram": 0}
    for step in range(9000):
        names = {name for name, odds in ODDS.items() if rng.random() < odds}
        # The receiver never gives two of these at once, and commits only what is pending.
        fate = [n for n in ("candidate", "commit", "revoke", "modbus_start_seen") if n in names]
        names -= set(fate[1:])
        if not pending:
            names.discard("commit")
        levels = {name: rng.randint(0, 1) for name in ("modbus_quiet", "drive_quiet", "drive_good")}
        levels["modbus_quiet"] |= "commit" in names and rng.random() < 0.8
        if not levels["modbus_quiet"]:
            names.discard("commit")
        repeat = int(rng.random() < 0.3)
        ticket = current if rng.random() < 0.8 else rng.randrange(16)
        for name, value in levels.items():
            getattr(dut, name).value = value
        dut.queue_ticket.value = ticket
        dut.telegram_repeat.value = repeat
        if "candidate" in names:
            dut.writes_coils.value = rng.randint(0, 1)
        dut.reply_after_drive.value = rng.randint(0, 1)
        dut.reply_empty.value = int(rng.random() < 0.1)
        for name in ODDS:
            getattr(dut, name).value = int(name in names)
        await Timer(1, unit="ns")
        reply, telegram = int(dut.reply_start.value), int(dut.telegram_start.value)
        assert not reply or (fresh and levels["modbus_quiet"]), f"reply in step {step}"
        assert not telegram or (licence and levels["drive_quiet"]), f"telegram in step {step}"
        left["reply"] += reply
        left["telegram"] += telegram
        assert not telegram or int(dut.telegram_control.value) == may_command, f"command in step {step}"
        commands += telegram and may_command
        await gate.bench.clocks()

        if reply or "modbus_start_seen" in names:
            fresh = False
        was_spent, spent = spent, spent or bool(reply)
        if telegram:
            sends += 1
            spent |= bool(may_command) and newest_telegram
            licence &= sends == 1 and newest_telegram
        licence &= not (reply and newest_telegram)
        # A new telegram is licensed if its request is committed; what changes is not licensed any more.
        if "queue_telegram" in names and not repeat:
            queued_mine = ticket == current and (committed or pending)
            queued_mine &= pending or not was_spent
            licence = queued_mine and committed
            may_command = bool(int(dut.writes_coils.value))
            sends, newest_telegram = 0, True
        new = "queue_telegram" in names and not repeat
        if "candidate" in names and new:
            licence = False
        if ("candidate" in names or ("revoke" in names and pending)) and (new or not licence):
            queued_mine = False
        if "candidate" in names:
            current, pending, committed, fresh = (current + 1) % 16, True, False, False
        if "commit" in names:
            pending, committed, fresh, spent = False, True, True, False
            if licence and not new:
                newest_telegram = False
                licence = not sends
            else:
                licence = licence or queued_mine
        if "revoke" in names:
            pending = False
        if "telegram_touched" in names:
            licence = queued_mine = False
    dut._log.info("%s, %d commands", left, commands)
    assert min(left.values()) > 100 and 20 < commands < left["telegram"] - 20, (
        "the history was too dull to show anything"
    )


@pytest.mark.rule("FRAME-6", "FRAME-7", "FC-9", "MAP-9", "LOOP-1", "SAFE-1", "SAFE-4")
def test_commit_gate(sim):
    run("commit_gate", "tb.rtl.test_commit_gate", sim=sim)
