# SPDX-License-Identifier: Apache-2.0
"""mailbox: the firmware at its registers, both ports at their sides, the gate between them."""

from __future__ import annotations

import cocotb
import pytest

from regs.areas import Register
from regs.generated.mailbox import REGISTERS, VALUES
from tb.lib.bench import Bench, Strobes, inputs
from tb.lib.runner import run
from tb.lib.seeds import seeded

INPUTS = inputs("mailbox")
# Field to the input that feeds it. The gate makes the others; scenarios of their own follow them.
SOURCES = {
    (name, field): about.port
    for name, register in REGISTERS.items()
    for field, about in register.fields.items()
    if register.size == 1 and name != "EVENTS" and about.port in INPUTS
}
EVENTS = {name: about.port for name, about in REGISTERS["EVENTS"].fields.items()}
ACTIONS = VALUES["TELEGRAM", "action"]
TICKS = 0x5B
NOTHING = b"\x5a\x5a\x5a\x5a"  # what no access carries


class Mailbox:
    """Both lines silent and both ports idle, until a test sets them otherwise."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, **dict.fromkeys(INPUTS, 0) | {"core_rst": 1})
        self.replies = Strobes(dut, "reply_start", "reply_length")
        self.telegrams = Strobes(
            dut, "telegram_start", "telegram_length", "telegram_no_reply", "telegram_control"
        )

    async def start(self) -> Mailbox:
        await self.bench.start()
        self.dut.core_rst.value = 0
        for name in ("modbus_silent", "modbus_quiet", "drive_quiet"):
            getattr(self.dut, name).value = 1
        await self.bench.clocks()
        return self

    # the firmware

    async def access(self, register: Register, value: int | None = None) -> int:
        """One access as bus_arbiter makes it, bytes in their lanes; returns what was read."""
        dut = self.dut
        lane = register.offset % 4
        dut.regs_valid.value, dut.regs_write.value = 1, int(value is not None)
        dut.regs_word.value = register.offset // 4
        # The lanes that are not written carry something else, and all of them do after the access.
        data = bytearray(NOTHING)
        data[lane : lane + register.size] = (value or 0).to_bytes(register.size, "little")
        dut.regs_wdata.value = int.from_bytes(data, "little")
        await self.bench.clocks()
        read = dut.regs_rdata.value.to_unsigned()
        dut.regs_valid.value = 0
        dut.regs_wdata.value = int.from_bytes(NOTHING, "little")
        await self.bench.clocks()
        return read >> 8 * lane & ((1 << 8 * register.size) - 1)

    async def read(self, name: str) -> dict[str, int]:
        return REGISTERS[name].unpack(await self.access(REGISTERS[name]))

    async def write(self, name: str, **fields: int) -> None:
        await self.access(REGISTERS[name], REGISTERS[name].pack(**fields))

    async def events(self) -> set[str]:
        """The flags that are set; they are cleared."""
        flags = await self.read("EVENTS")
        await self.write("EVENTS", **flags)
        return {name for name, flag in flags.items() if flag}

    def lit(self) -> dict[str, int]:
        return {name: int(getattr(self.dut, f"lit_{name}").value) for name in REGISTERS["LED"].fields}

    # the ports

    async def pulse(self, *names: str) -> None:
        for name in names:
            getattr(self.dut, name).value = 1
        await self.bench.clocks()
        for name in names:
            getattr(self.dut, name).value = 0

    async def request(self) -> int:
        """A candidate; returns its ticket."""
        await self.pulse("candidate")
        request = await self.read("REQUEST")
        assert request["candidate"] and not request["committed"]
        return request["ticket"]

    async def settle(self) -> tuple[int, int]:
        """How many replies and telegrams have started so far."""
        await self.bench.clocks(5)
        return len(self.replies), len(self.telegrams)


@cocotb.test()
async def every_input_is_seen_in_its_own_field(dut):
    rng = seeded("levels")
    mailbox = await Mailbox(dut).start()
    for _ in range(10):
        expected = {}
        for (register, field), source in SOURCES.items():
            value = rng.getrandbits(REGISTERS[register].fields[field].width)
            getattr(mailbox.dut, source).value = value
            expected[register, field] = value
        for (register, field), value in expected.items():
            assert (await mailbox.read(register))[field] == value, f"{register}.{field}"


@cocotb.test()
async def each_event_has_a_flag_of_its_own(dut):
    mailbox = await Mailbox(dut).start()
    assert await mailbox.events() == set()
    for name, strobe in EVENTS.items():
        await mailbox.pulse(strobe)
        assert await mailbox.events() == {name}
    await mailbox.pulse(*EVENTS.values())
    assert await mailbox.events() == set(EVENTS)
    assert await mailbox.events() == set()


@cocotb.test()
async def what_was_prepared_for_a_candidate_leaves_at_its_commit(dut):
    mailbox = await Mailbox(dut).start()
    ticket = await mailbox.request()
    await mailbox.write("REPLY", length=17, ticket=ticket)
    await mailbox.write("TELEGRAM", length=13, early=1, ticket=ticket)
    assert int(mailbox.dut.reply_queued.value) and (await mailbox.read("EXCHANGE"))["queued"]
    assert await mailbox.settle() == (0, 0)
    await mailbox.pulse("commit")
    assert await mailbox.settle() == (1, 1)
    assert mailbox.replies.values == [(17,)] and mailbox.telegrams.values == [(13, 0, 0)]
    exchange = await mailbox.read("EXCHANGE")
    assert exchange["started"] and not exchange["queued"]
    assert not int(mailbox.dut.reply_queued.value)
    request = await mailbox.read("REQUEST")
    assert request["committed"] and not request["candidate"] and request["ticket"] == ticket


@cocotb.test()
async def a_revoke_takes_everything_back(dut):
    mailbox = await Mailbox(dut).start()
    ticket = await mailbox.request()
    await mailbox.write("REPLY", length=6, ticket=ticket)
    await mailbox.write("TELEGRAM", length=5, early=1, ticket=ticket)
    await mailbox.pulse("revoke")
    request, exchange = await mailbox.read("REQUEST"), await mailbox.read("EXCHANGE")
    assert not request["candidate"] and not request["committed"]
    assert not exchange["queued"] and not exchange["started"]
    await mailbox.write("REPLY", length=6, ticket=ticket)
    await mailbox.write("TELEGRAM", length=5, ticket=ticket)
    assert await mailbox.settle() == (0, 0)


@cocotb.test()
async def a_stale_ticket_sends_nothing(dut):
    mailbox = await Mailbox(dut).start()
    old = await mailbox.request()
    new = await mailbox.request()
    await mailbox.pulse("commit")
    for ticket in range(16):
        if ticket != new:
            await mailbox.write("REPLY", length=6, ticket=ticket)
            await mailbox.write("TELEGRAM", length=5, ticket=ticket)
    assert old != new and await mailbox.settle() == (0, 0)
    await mailbox.write("REPLY", length=0, ticket=new)
    assert await mailbox.settle() == (0, 0), "length 0 is no reply"
    await mailbox.write("TELEGRAM", length=5, ticket=new)
    await mailbox.write("REPLY", length=6, ticket=new)
    assert await mailbox.settle() == (1, 1)
    assert mailbox.telegrams.values == [(5, 0, 0)]


@cocotb.test()
@cocotb.parametrize(
    kind=[
        ("image", {"writes_coils": 1}),
        ("image", {"writes_coils": 1, "broadcast": 1}),
        ("write", {"writes_parameter": 1}),
        ("write", {"writes_parameter": 1, "broadcast": 1}),
    ]
)
async def each_kind_of_write_licenses_its_telegram_also_after_newer_requests(dut, kind):
    """It waits for a running exchange. Only the image commands; a broadcast has no reply (FRAME-7)."""
    action, request = kind
    to_all = request.get("broadcast", 0)
    mailbox = await Mailbox(dut).start()
    mailbox.dut.drive_sending.value = 1
    for name, value in request.items():
        getattr(mailbox.dut, f"frame_{name}").value = value
    ticket = await mailbox.request()
    await mailbox.pulse("commit")
    await mailbox.write("REPLY", length=6, ticket=ticket)
    await mailbox.write("TELEGRAM", action=ACTIONS[action], length=9, no_reply=to_all, ticket=ticket)
    assert not (await mailbox.read("EXCHANGE"))["queued"], "over the telegram on the line"
    for name in request:
        getattr(mailbox.dut, f"frame_{name}").value = 0
    ticket = await mailbox.request()
    await mailbox.pulse("commit")
    mailbox.dut.drive_sending.value = 0
    for other, no_reply in (("image", 0), ("write", 0), ("write", 1)):
        if other != action or (action == "write" and no_reply != to_all):
            await mailbox.write("TELEGRAM", action=ACTIONS[other], length=9, no_reply=no_reply, ticket=ticket)
    assert await mailbox.settle() == (1 - to_all, 0), "no licence of another kind"
    await mailbox.write("TELEGRAM", action=ACTIONS[action], length=6, no_reply=to_all, ticket=ticket)
    assert await mailbox.settle() == (1 - to_all, 1)
    assert mailbox.telegrams.values == [(6, to_all, int(action == "image"))]


@cocotb.test()
@cocotb.parametrize(outcome=("drive_good", "drive_bad"))
async def a_reply_after_the_drive_waits_for_the_verdict_on_its_telegram(dut, outcome):
    mailbox = await Mailbox(dut).start()
    ticket = await mailbox.request()
    await mailbox.pulse("commit")
    await mailbox.write("REPLY", length=6, after_drive=1, ticket=ticket)
    assert await mailbox.settle() == (0, 0)
    getattr(mailbox.dut, outcome).value = 1
    await mailbox.bench.clocks()
    mailbox.dut.drive_bad.value, mailbox.dut.drive_good.value = 0, 1
    assert await mailbox.settle() == (int(outcome == "drive_good"), 0)


@cocotb.test()
async def each_line_holds_back_what_has_to_wait_for_its_silence(dut):
    mailbox = await Mailbox(dut).start()
    ticket = await mailbox.request()
    await mailbox.pulse("commit")
    mailbox.dut.modbus_quiet.value = mailbox.dut.drive_quiet.value = 0
    await mailbox.write("REPLY", length=6, ticket=ticket)
    assert await mailbox.settle() == (0, 0)
    mailbox.dut.modbus_quiet.value = 1
    assert await mailbox.settle() == (1, 0)
    ticket = await mailbox.request()
    await mailbox.pulse("commit")
    await mailbox.write("TELEGRAM", length=5, ticket=ticket)
    assert await mailbox.settle() == (1, 0)
    mailbox.dut.drive_quiet.value = mailbox.dut.drive_sending.value = 1
    assert await mailbox.settle() == (1, 0), "the telegram before it is not over"
    mailbox.dut.drive_sending.value = 0
    assert await mailbox.settle() == (1, 1)


@cocotb.test()
async def a_character_after_the_commit_drops_the_reply(dut):
    mailbox = await Mailbox(dut).start()
    ticket = await mailbox.request()
    await mailbox.pulse("commit")
    await mailbox.pulse("modbus_start_seen")
    await mailbox.write("REPLY", length=6, ticket=ticket)
    assert await mailbox.settle() == (0, 0)


@cocotb.test()
async def listening_is_switched_by_the_firmware(dut):
    mailbox = await Mailbox(dut).start()
    again, stop = Strobes(mailbox.dut, "listen_again"), Strobes(mailbox.dut, "listen_stop")
    await mailbox.write("LISTEN", on=1)
    assert len(again) and not len(stop)
    again.clear()
    await mailbox.write("LISTEN", on=0)
    assert len(stop) and not len(again)


@cocotb.test()
async def lamps_show_what_the_firmware_wrote_until_it_restarts(dut):
    mailbox = await Mailbox(dut).start()
    lamps = ("modbus_red", "modbus_green", "drive_red", "drive_green")
    for lit in lamps:
        await mailbox.write("LED", **{lit: 1})
        assert mailbox.lit() == {name: int(name == lit) for name in lamps}
    await mailbox.pulse("core_rst")
    assert not any(mailbox.lit().values())


@cocotb.test()
async def a_changed_telegram_needs_a_new_licence(dut):
    mailbox = await Mailbox(dut).start()
    ticket = await mailbox.request()
    await mailbox.pulse("commit")
    await mailbox.write("TELEGRAM", length=13, ticket=ticket)
    assert await mailbox.settle() == (0, 1)
    await mailbox.write("TELEGRAM", action=1)
    assert await mailbox.settle() == (0, 2)
    assert mailbox.telegrams.values[1] == (13, 0, 0), "a repeat is the same telegram"
    await mailbox.write("TELEGRAM", length=13, ticket=ticket)
    assert await mailbox.settle() == (0, 3)
    await mailbox.pulse("telegram_touched")
    await mailbox.write("TELEGRAM", action=1)
    assert await mailbox.settle() == (0, 3)


@cocotb.test()
async def stop_leaves_when_the_master_is_lost_and_not_before(dut):
    """SAFE-7, through the registers: the order to watch, the time from the card's ticks, the stop."""
    period = 3
    mailbox = await Mailbox(dut).start()
    mailbox.telegrams = stops = Strobes(mailbox.dut, "telegram_start", "telegram_control", "telegram_stop")
    mailbox.dut.frame_writes_coils.value = 1
    ticket = await mailbox.request()
    await mailbox.pulse("commit")
    await mailbox.write("TELEGRAM", length=6, action=ACTIONS["image"], ticket=ticket)
    assert await mailbox.settle() == (0, 1)
    await mailbox.write("TELEGRAM", length=6, action=ACTIONS["image"], stop=1, ticket=ticket)
    # The supervisor is written for other things, too.
    await mailbox.write("SUPERVISOR", running=1, period=1, ticket=ticket)
    for beat in range(2 * period):
        mailbox.dut.ticks.value = TICKS ^ beat & 1
        await mailbox.bench.clocks(2)
    assert not (await mailbox.read("EXCHANGE"))["stop_due"], "nobody ordered to watch"
    await mailbox.write("SUPERVISOR", watch=1, running=1, period=period, ticket=ticket)
    for _ in range(period + 1):
        assert not (await mailbox.read("EXCHANGE"))["stop_due"], "before its time"
        assert await mailbox.settle() == (0, 1)
        mailbox.dut.ticks.value = mailbox.dut.ticks.value.to_unsigned() ^ 1
        await mailbox.bench.clocks(2)
    assert (await mailbox.read("EXCHANGE"))["stop_due"]
    await mailbox.write("TELEGRAM", length=6, action=ACTIONS["image"], ticket=ticket)
    assert await mailbox.settle() == (0, 1), "nothing was committed"
    await mailbox.write("TELEGRAM", length=6, action=ACTIONS["image"], stop=1, ticket=ticket)
    assert await mailbox.settle() == (0, 2)
    assert stops.values == [(1, 0), (1, 1)]


@cocotb.test()
async def a_telegram_is_never_changed_in_the_moment_of_its_start(dut):
    """A write to its memory up to the clock of the start keeps it from starting."""
    mailbox = await Mailbox(dut).start()
    for touched in range(-2, 4):
        mailbox.dut.drive_quiet.value = 0
        ticket = await mailbox.request()
        await mailbox.pulse("commit")
        await mailbox.write("TELEGRAM", length=5, ticket=ticket)
        before = len(mailbox.telegrams)
        for clock in range(-2, 5):
            mailbox.dut.telegram_touched.value = int(clock == touched)
            mailbox.dut.drive_quiet.value = int(clock >= 0)
            await mailbox.bench.clocks()
        assert len(mailbox.telegrams) - before == int(touched > 0), (
            f"write {touched} clocks after the silence"
        )


@cocotb.test()
async def a_restart_of_the_firmware_drops_what_it_queued_and_nothing_else(dut):
    mailbox = await Mailbox(dut).start()
    await mailbox.events()
    await mailbox.write("LED", modbus_green=1, drive_red=1)
    mailbox.dut.drive_quiet.value = mailbox.dut.modbus_quiet.value = 0
    ticket = await mailbox.request()
    await mailbox.pulse("commit")
    await mailbox.write("REPLY", length=6, ticket=ticket)
    await mailbox.write("TELEGRAM", length=5, ticket=ticket)
    await mailbox.pulse("core_rst", "count_crc")
    mailbox.dut.drive_quiet.value = mailbox.dut.modbus_quiet.value = 1
    await mailbox.write("TELEGRAM", action=1)
    await mailbox.write("TELEGRAM", length=5, ticket=ticket)
    await mailbox.write("REPLY", length=6, ticket=ticket)
    assert await mailbox.settle() == (0, 0)
    assert not any(mailbox.lit().values())
    assert await mailbox.events() == {"crc"}


@cocotb.test()
async def while_the_loop_back_test_is_open_both_ports_send_without_a_request(dut):
    mailbox = await Mailbox(dut).start()
    mailbox.dut.loopback_open.value = 1
    await mailbox.write("REPLY", length=6)
    await mailbox.write("TELEGRAM", length=5)
    assert await mailbox.settle() == (1, 1)
    mailbox.dut.loopback_open.value = 0
    await mailbox.pulse("telegram_touched")
    await mailbox.write("REPLY", length=6)
    await mailbox.write("TELEGRAM", length=5)
    assert await mailbox.settle() == (1, 1)


@pytest.mark.rule("FRAME-4", "FRAME-5", "FRAME-6", "FRAME-7", "FC-9", "MAP-9", "SAFE-1", "LOOP-1", "WDG-1")
def test_mailbox(sim):
    run("mailbox", "tb.rtl.test_mailbox", sim=sim, testcase=r"(?!stop_)\w+")


@pytest.mark.rule("SAFE-7")
def test_mailbox_with_the_stop_of_a_lost_master(sim):
    parameters = {"MASTER_LOSS_STOP": 1}
    run("mailbox", "tb.rtl.test_mailbox", sim=sim, testcase=r"stop_\w+", parameters=parameters)
