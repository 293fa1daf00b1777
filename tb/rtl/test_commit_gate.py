# SPDX-License-Identifier: Apache-2.0
"""commit_gate: what a commit allows leaves the card, once; nothing else does.

The scenarios show what it is for, random histories and flipped bits what may go wrong. The proof has every
case, and test_mailbox_model.py compares all outputs with the model of the firmware's tests.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import cocotb
import pytest
from cocotb.triggers import ReadOnly

from tb.lib.bench import Bench, Strobes, inputs
from tb.lib.runner import run
from tb.lib.seeds import cases, seeded

# Kinds of telegrams, and the request whose commit licenses one.
NEWEST, IMAGE, ONE, ALL = range(4)
READING = {"broadcast": 0, "writes_coils": 0, "writes_parameter": 0}
COILS = {"broadcast": 0, "writes_coils": 1, "writes_parameter": 0}
COILS_FOR_ALL = {"broadcast": 1, "writes_coils": 1, "writes_parameter": 0}
PARAMETER = {"broadcast": 0, "writes_coils": 0, "writes_parameter": 1}
PARAMETER_FOR_ALL = {"broadcast": 1, "writes_coils": 0, "writes_parameter": 1}
REQUEST_OF = {NEWEST: READING, IMAGE: COILS, ONE: PARAMETER, ALL: PARAMETER_FOR_ALL}
OTHER_THAN = {NEWEST: COILS, IMAGE: PARAMETER, ONE: PARAMETER_FOR_ALL, ALL: COILS_FOR_ALL}


class Gate:
    """The gate with both lines silent, and verbs for what may happen to it."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, **dict.fromkeys(inputs("commit_gate"), 0))
        self.replies = Strobes(dut, "reply_start")
        self.telegrams = Strobes(dut, "telegram_start", "telegram_control", "telegram_stop")

    async def start(self) -> Gate:
        await self.bench.start()
        self.dut.modbus_silent.value = self.dut.modbus_quiet.value = self.dut.drive_quiet.value = 1
        return self

    async def pulse(self, *names: str, **levels: int) -> None:
        """One clock with these strobes high and these levels given."""
        for name, value in (levels | dict.fromkeys(names, 1)).items():
            getattr(self.dut, name).value = value
        await self.bench.clocks()
        for name in names:
            getattr(self.dut, name).value = 0

    @property
    def ticket(self) -> int:
        return self.dut.ticket.value.to_unsigned()

    async def candidate(self, request: dict[str, int]) -> None:
        await self.pulse("candidate", **request)

    async def committed(self, request: dict[str, int]) -> None:
        await self.candidate(request)
        await self.pulse("commit")

    async def character(self) -> None:
        """Begins on the network line and ends again."""
        self.dut.modbus_silent.value = self.dut.modbus_quiet.value = 0
        await self.pulse("modbus_start_seen")
        self.dut.modbus_silent.value = self.dut.modbus_quiet.value = 1

    async def order(self, kind: int, early: int = 0, stop: int = 0, ticket: int | None = None) -> None:
        await self.pulse(
            "order_telegram",
            order_kind=kind,
            order_early=early,
            order_stop=stop,
            order_no_reply=int(kind == ALL),
            order_ticket=self.ticket if ticket is None else ticket,
        )

    async def repeat(self) -> None:
        await self.pulse("order_repeat", order_ticket=self.ticket ^ 8)

    async def reply(self, after_drive: int = 0, empty: int = 0, ticket: int | None = None) -> None:
        ticket = self.ticket if ticket is None else ticket
        await self.pulse("order_reply", order_ticket=ticket, reply_after_drive=after_drive, reply_empty=empty)

    async def settle(self) -> tuple[int, int]:
        """How many replies and telegrams have started so far, some clocks on."""
        await self.bench.clocks(5)
        return len(self.replies), len(self.telegrams)

    async def flip(self, path: str, bit: int = 0) -> int:
        """Returns whether that is a fault in the same clock."""
        register = reduce(getattr, path.split("."), self.dut)
        register.value = int(register.value) ^ 1 << bit
        await ReadOnly()
        fault = int(self.dut.fault.value)
        await self.bench.clocks()
        return fault


@cocotb.test()
@cocotb.parametrize(kind=[NEWEST, IMAGE, ONE, ALL], early=[0, 1])
async def each_request_has_the_telegram_of_its_kind_prepared_early_or_not(dut, kind, early):
    gate = await Gate(dut).start()
    await gate.candidate(REQUEST_OF[kind])
    if early:
        await gate.order(kind, early=1)
    assert await gate.settle() == (0, 0), "not before the commit"
    await gate.pulse("commit")
    if not early:
        await gate.order(kind)
    assert await gate.settle() == (0, 1)
    assert gate.telegrams.values == [(int(kind == IMAGE), 0)], "only the image commands the drive (SAFE-1)"


@cocotb.test()
@cocotb.parametrize(end=["revoke", "character", "commit on a line that is not silent", "newer candidate"])
async def what_was_prepared_goes_with_its_candidate(dut, end):
    gate = await Gate(dut).start()
    await gate.candidate(COILS)
    await gate.reply()
    await gate.order(IMAGE, early=1)
    if end == "revoke":
        await gate.pulse("revoke")
    elif end == "character":
        await gate.character()
    elif end == "newer candidate":
        await gate.candidate(COILS)
    else:
        dut.modbus_silent.value = dut.modbus_quiet.value = 0
        await gate.pulse("commit")
        dut.modbus_silent.value = dut.modbus_quiet.value = 1
    assert not int(dut.reply_queued.value) and not int(dut.telegram_queued.value)
    await gate.pulse("commit")
    assert await gate.settle() == (0, 0)
    if end != "newer candidate":
        for early in (0, 1):
            await gate.order(IMAGE, early=early)
        await gate.reply()
        await gate.repeat()
        assert await gate.settle() == (0, 0), "nor may the firmware, which comes late, order it"


@cocotb.test()
@cocotb.parametrize(kind=[IMAGE, ONE, ALL], newer=["reading", "other write", "revoked", "answered"])
async def a_licence_stays_whatever_requests_come(dut, kind, newer):
    """FRAME-7"""
    gate = await Gate(dut).start()
    await gate.committed(REQUEST_OF[kind])
    for _ in range(3):
        await gate.candidate(OTHER_THAN[kind] if newer == "other write" else READING)
        await gate.pulse("revoke" if newer == "revoked" else "commit")
        if newer == "answered":
            await gate.reply()
    before = await gate.settle()
    await gate.order(kind)
    assert await gate.settle() == (before[0], 1)
    await gate.order(kind)
    assert await gate.settle() == (before[0], 1), "once"


@cocotb.test()
@cocotb.parametrize(kind=[IMAGE, ONE, ALL], early=[0, 1])
async def a_telegram_that_waits_for_the_line_is_dropped_by_a_newer_commit_of_its_kind(dut, kind, early):
    """It is not what was committed last; the licence stays for the telegram that is (SAFE-8)."""
    gate = await Gate(dut).start()
    dut.drive_quiet.value = 0
    await gate.candidate(REQUEST_OF[kind])
    if early:
        await gate.order(kind, early=1)
    await gate.pulse("commit")
    if not early:
        await gate.order(kind)
    await gate.settle()
    assert int(dut.telegram_queued.value)
    await gate.committed(REQUEST_OF[kind])
    dut.drive_quiet.value = 1
    assert await gate.settle() == (0, 0) and not int(dut.telegram_queued.value)
    await gate.order(kind)
    assert await gate.settle() == (0, 1)


@cocotb.test()
@cocotb.parametrize(kind=[NEWEST, IMAGE, ONE, ALL])
async def a_telegram_has_one_repeat_and_a_broadcast_none(dut, kind):
    gate = await Gate(dut).start()
    await gate.committed(REQUEST_OF[kind])
    await gate.order(kind)
    repeats = int(kind != ALL)
    await gate.settle()
    await gate.candidate(READING)
    assert await gate.settle() == (0, 1), "not without its order"
    await gate.repeat()
    assert await gate.settle() == (0, 1 + repeats)
    await gate.pulse("revoke")
    await gate.repeat()
    assert await gate.settle() == (0, 1 + repeats)


@cocotb.test()
async def each_request_gets_one_reply_if_the_firmware_has_one(dut):
    gate = await Gate(dut).start()
    await gate.candidate(READING)
    await gate.reply()
    await gate.reply(empty=1)
    await gate.pulse("commit")
    assert await gate.settle() == (0, 0), "length 0 takes it back"
    for _ in range(3):
        await gate.reply()
        assert await gate.settle() == (1, 0)


@cocotb.test()
async def the_open_loop_back_test_needs_no_request_and_commands_nothing(dut):
    gate = await Gate(dut).start()
    dut.loopback_open.value = 1
    await gate.order(IMAGE, ticket=gate.ticket ^ 5)
    assert await gate.settle() == (0, 1) and gate.telegrams.values == [(0, 0)]
    await gate.reply(ticket=gate.ticket ^ 5)
    assert await gate.settle() == (1, 1)
    dut.drive_quiet.value = dut.modbus_quiet.value = 0
    await gate.order(NEWEST)
    await gate.reply()
    await gate.pulse("loopback_close")
    dut.loopback_open.value = 0
    dut.drive_quiet.value = dut.modbus_quiet.value = 1
    await gate.pulse("commit")
    await gate.order(NEWEST)
    await gate.reply()
    assert await gate.settle() == (1, 1), "its end takes back what is queued"


# ------------------------------------------------------ one flipped bit (SAFE-4)

PAIRS = ["request_i.committed_i", "telegram_i.licence_i"] + [
    f"licences_i.{name}_i" for name in ("image", "one", "all")
]
SLOT = [("telegram_i.state_i.code", bit) for bit in range(3)]
STATES = [("request_i.state", bit) for bit in range(3)] + SLOT
FLIPS = [(f"{pair}.{half}.half", 0) for pair in PAIRS for half in ("held_i", "opposite_i")] + STATES


@cocotb.test()
@cocotb.parametrize(flip=FLIPS, when=["before", "after"], revoked=[False, True])
async def no_single_bit_sends_what_is_not_committed(dut, flip, when, revoked):
    gate = await Gate(dut).start()
    await gate.candidate(COILS)
    if when == "before":
        await gate.flip(*flip)
    await gate.order(IMAGE, early=1)
    if when == "after":
        await gate.flip(*flip)
    if revoked:
        await gate.pulse("revoke")
    assert await gate.settle() == (0, 0)
    for kind in (NEWEST, IMAGE, ONE, ALL):
        await gate.order(kind)
        assert await gate.settle() == (0, 0)
    assert not int(dut.is_committed.value), "nor is the firmware told so"


@cocotb.test()
@cocotb.parametrize(flip=[*SLOT, *(("request_i.ticket", bit) for bit in range(4))], sends=[0, 1])
async def a_flipped_state_or_ticket_is_a_fault_and_sends_nothing(dut, flip, sends):
    """Also no repeat that nobody ordered."""
    gate = await Gate(dut).start()
    await gate.committed(COILS)
    if sends:
        await gate.order(IMAGE)
    assert await gate.settle() == (0, sends)
    assert not int(dut.fault.value)
    assert await gate.flip(*flip)
    assert await gate.settle() == (0, sends)
    await gate.pulse("rst")
    assert not int(dut.fault.value)


@cocotb.test()
@cocotb.parametrize(pair=PAIRS, half=["held_i", "opposite_i"])
async def a_flipped_half_is_a_fault(dut, pair, half):
    gate = await Gate(dut).start()
    assert not int(dut.fault.value)
    await gate.flip(f"{pair}.{half}.half")
    assert int(dut.fault.value)


# ------------------------------------------------------ random histories


@dataclass
class Ordered:
    """The telegram that was ordered last."""

    kind: int
    no_reply: int
    contains: int  # commits of its kind that it stands for
    undecided: bool  # made for a candidate that has not committed
    sends: int = 0
    again: bool = False


class Rules:
    """FRAME-6, FRAME-7, FC-9, SAFE-1 and SAFE-8 from the inputs alone: what may leave in this clock."""

    def __init__(self):
        self.state = "none"  # the newest request: none, candidate, committed or answered
        self.request = READING
        self.commits = [0, 0, 0, 0]  # so far, by kind; those of all requests for NEWEST
        self.told = [0, 0, 0, 0]  # how many of them the drive has been told
        self.telegram: Ordered | None = None

    def kind(self) -> int:
        if self.request["writes_coils"]:
            return IMAGE
        return NEWEST if not self.request["writes_parameter"] else ALL if self.request["broadcast"] else ONE

    def due(self, kind: int) -> bool:
        return self.told[kind] < self.commits[kind]

    def check(self, control: int, now: dict[str, int]) -> None:
        telegram = self.telegram
        assert telegram and not telegram.undecided, "no commit"
        assert now["drive_quiet"] and not now["order_telegram"] and not now["order_repeat"]
        assert not control or telegram.kind == IMAGE, "command"
        assert telegram.sends or telegram.kind == NEWEST or self.due(telegram.kind), "no licence"
        if telegram.sends or telegram.kind != NEWEST:
            assert telegram.contains == self.commits[telegram.kind], "not as it is"
        if telegram.sends:
            assert telegram.sends == 1 and telegram.again and not telegram.no_reply, "repeat"

    def order(self, now: dict[str, int], mine: bool, before: str) -> None:
        """A telegram made with the candidate needs its commit, one made without it must not wait for it."""
        kind, own = now["order_kind"], self.state == "candidate"
        refused = not mine or now["candidate"] or now["telegram_touched"]
        refused |= self.state == "none" if now["order_early"] else before == "candidate"
        refused |= kind == NEWEST and (self.state in ("none", "answered") or self.request["broadcast"])
        contains = self.commits[kind] + (own and kind in (NEWEST, self.kind()))
        self.telegram = None if refused else Ordered(kind, now["order_no_reply"], contains, own)

    def clock(self, now: dict[str, int], mine: bool, replied: int, sent: int) -> None:
        before = self.state
        commits = before == "candidate" and now["commit"] and now["modbus_silent"]
        ends = now["commit"] or now["revoke"] or now["modbus_start_seen"]
        withdrawn = before == "candidate" and ends and not commits
        if commits:
            self.state = "committed"
            for kind in {NEWEST, self.kind()}:
                self.commits[kind] += 1
        elif withdrawn:
            self.state = "none"
        elif replied and before == "committed":
            self.state = "answered"
        telegram = self.telegram
        if sent:
            telegram.sends += 1
            self.told[telegram.kind] = telegram.contains
            if telegram.kind == NEWEST and telegram.sends == 1:
                telegram.contains = self.commits[NEWEST]
        if telegram:
            telegram.again |= bool(now["order_repeat"] and telegram.sends)
            if now["telegram_touched"] or (telegram.undecided and (now["candidate"] or withdrawn)):
                self.telegram = None
            telegram.undecided &= not commits
        if now["order_telegram"]:
            self.order(now, mine, before)
        if now["candidate"]:
            self.state, self.request = "candidate", {name: now[name] for name in READING}


ODDS = {
    "candidate": 0.06,
    "commit": 0.2,
    "revoke": 0.02,
    "modbus_start_seen": 0.03,
    "order_telegram": 0.2,
    "order_repeat": 0.2,
    "order_reply": 0.1,
    "telegram_touched": 0.02,
}
AT_ONCE = (
    ("candidate", "commit", "revoke", "modbus_start_seen"),
    ("order_telegram", "order_repeat", "order_reply"),
)
REST = {"modbus_silent": 1, "modbus_quiet": 1, "drive_quiet": 1, "order_early": 0, "order_no_reply": 0}


@cocotb.test()
async def random_histories_send_what_the_rules_allow_and_lose_nothing(dut):
    rng = seeded("gate history")
    gate = await Gate(dut).start()
    rules = Rules()
    left = dict.fromkeys(("telegram", "command", "repeat", "due"), 0)

    async def clock(mine: bool = True, **inputs: int) -> int:
        now = dict.fromkeys(ODDS, 0) | REST | inputs
        now["order_ticket"] = (gate.ticket + (0 if mine else rng.randint(1, 15))) % 16
        for name, value in now.items():
            getattr(dut, name).value = value
        await gate.bench.clocks(0.1)
        replied, sent, control = (
            int(getattr(dut, name).value) for name in ("reply_start", "telegram_start", "telegram_control")
        )
        await gate.bench.clocks()
        if sent:
            rules.check(control, now)
            left["telegram"] += 1
            left["command"] += control
            left["repeat"] += rules.telegram.sends
        rules.clock(now, mine, replied, sent)
        return sent

    for _ in range(cases(200, 400)):
        for _ in range(40):
            now = {name: int(rng.random() < odds) for name, odds in ODDS.items()}
            for names in AT_ONCE:  # neither the receiver nor the firmware says two of these in one clock
                first = next((name for name in names if now[name]), "")
                now |= {name: int(name == first) for name in names}
            if now["candidate"]:
                now |= rng.choice((READING, COILS, COILS_FOR_ALL, PARAMETER, PARAMETER_FOR_ALL))
            now["modbus_silent"] = int(not now["modbus_start_seen"] and rng.random() < 0.8)
            now["modbus_quiet"] = now["modbus_silent"]
            now |= {name: int(rng.random() < 0.4) for name in ("drive_quiet", "order_no_reply")}
            # A firmware that knows what waits and looks at the request, most of the time.
            due = [kind for kind in (IMAGE, ONE, ALL) if rules.due(kind)] or [NEWEST]
            now["order_kind"] = rng.choice(due) if rng.random() < 0.6 else rng.randrange(4)
            now["order_early"] = int((rules.state == "candidate") == (rng.random() < 0.9))
            await clock(mine=rng.random() < 0.8, **now)
        # Both lines come to rest: what was committed and not told leaves once it is ordered (SAFE-8).
        for revoke in (1, 0, 0, 0, 0):
            await clock(revoke=revoke)
        for kind in rng.sample((IMAGE, ONE, ALL), 3):
            due = rules.due(kind)
            await clock(order_telegram=1, order_kind=kind)
            assert sum([await clock() for _ in range(4)]) == due, f"kind {kind}"
            left["due"] += due
    dut._log.info("%s", left)
    assert min(left.values()) > 10, "too dull to show anything"


# ------------------------------------------------------ the stop when the master is lost (SAFE-7)

PERIOD = 4


async def ticks(gate: Gate, count: int) -> None:
    for _ in range(count):
        await gate.pulse(beat=1 - int(gate.dut.beat.value))


async def watched(gate: Gate, request: dict[str, int] = COILS) -> None:
    """A committed request whose telegram has left, and the order to watch the master from then on."""
    await gate.committed(request)
    await gate.order(IMAGE)
    await gate.settle()
    await gate.pulse("watch", order_ticket=gate.ticket, running=1, period=PERIOD)


@cocotb.test()
@cocotb.parametrize(request=[COILS, COILS_FOR_ALL])
async def stop_leaves_once_without_the_start_bit_after_the_time(dut, request):
    gate = await Gate(dut).start()
    await watched(gate, request)
    await ticks(gate, PERIOD)
    await gate.order(IMAGE, stop=1)
    assert await gate.settle() == (0, 1) and not int(dut.stop_due.value)
    await ticks(gate, 1)
    assert int(dut.stop_due.value)
    await gate.order(IMAGE, stop=1)
    assert await gate.settle() == (0, 2)
    await gate.repeat()
    await gate.repeat()
    assert await gate.settle() == (0, 3) and gate.telegrams.values == [(1, 0), (1, 1), (1, 1)], "one repeat"
    await ticks(gate, 3 * PERIOD)
    await gate.order(IMAGE, stop=1)
    assert await gate.settle() == (0, 3), "once"


@cocotb.test()
@cocotb.parametrize(
    bit=["armed_i.held_i.half", "armed_i.opposite_i.half", "over_i.held_i.half", "over_i.opposite_i.half"],
    started=[False, True],
)
async def stop_is_not_licensed_by_a_single_bit(dut, bit, started):
    gate = await Gate(dut).start()
    if started:
        await watched(gate)
        await ticks(gate, 2)
    await gate.flip(f"g_loss.loss_i.{bit}")
    assert int(dut.fault.value)
    await gate.order(IMAGE, stop=1)
    assert await gate.settle() == (0, int(started))


@cocotb.test()
async def stop_has_no_start_bit_although_a_write_of_coils_has_not_left(dut):
    """As a write of coil 65, which has no telegram."""
    gate = await Gate(dut).start()
    await watched(gate)
    await gate.committed(COILS)
    await ticks(gate, PERIOD + 1)
    await gate.order(IMAGE, stop=1)
    assert await gate.settle() == (0, 2) and gate.telegrams.values == [(1, 0), (1, 1)]
    await gate.repeat()
    assert await gate.settle() == (0, 3) and gate.telegrams.values[2] == (1, 1)
    assert not int(dut.stop_due.value), "once"


# ------------------------------------------------------ the second telegram of a parameter write (MAP-8)


@cocotb.test()
async def second_telegram_of_a_parameter_write_leaves_whatever_requests_come(dut):
    gate = await Gate(dut).start()
    for request in (PARAMETER, PARAMETER_FOR_ALL):
        await gate.committed(request)
    await gate.order(ONE)
    assert await gate.settle() == (0, 1)
    await gate.committed(READING)
    await gate.order(ONE)
    assert await gate.settle() == (0, 2)
    await gate.order(ONE)
    assert await gate.settle() == (0, 2), "no third one"
    for expected in (3, 3):
        await gate.order(ALL)
        assert await gate.settle() == (0, expected), "nobody refuses a broadcast"


@cocotb.test()
@cocotb.parametrize(pair=["g_stop.free_i", "g_second.second_i"], half=["held_i", "opposite_i"])
async def second_licence_or_start_bit_is_not_given_by_a_single_bit(dut, pair, half):
    gate = await Gate(dut).start()
    await gate.flip(f"licences_i.{pair}.{half}.half")
    assert int(dut.fault.value)
    for kind in (ONE, IMAGE):
        await gate.order(kind)
        assert await gate.settle() == (0, 0)


OPTIONS = r"(stop|second)_\w+"


@pytest.mark.rule("FRAME-6", "FRAME-7", "FC-9", "MAP-9", "LOOP-1", "SAFE-1", "SAFE-4", "SAFE-8")
def test_commit_gate(sim):
    run("commit_gate", "tb.rtl.test_commit_gate", sim=sim, testcase=rf"(?!{OPTIONS})\w+")


@pytest.mark.rule("SAFE-7", "SAFE-4", "FRAME-7")
def test_commit_gate_with_its_parameters(sim):
    both = {"MASTER_LOSS_STOP": 1, "SECOND_TELEGRAM": 1}
    run("commit_gate", "tb.rtl.test_commit_gate", sim=sim, parameters=both, testcase=OPTIONS)
