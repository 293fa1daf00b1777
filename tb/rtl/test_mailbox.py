# SPDX-License-Identifier: Apache-2.0
"""mailbox and bus_arbiter: the firmware on its bus, both ports at their sides, the gate between them."""

from __future__ import annotations

import itertools
import random

import cocotb
import pytest
from cocotb.triggers import Timer

from regs.generated.mailbox import AREAS, BASE, FRAMES, REGISTERS, VALUES, Area
from tb.lib.bench import Bench, Strobes
from tb.lib.memory_ports import WordMemory
from tb.lib.runner import ROOT, run
from tb.lib.seeds import cases, seeded

INPUTS = """
    core_valid core_addr core_wdata core_wstrb
    modbus_write_valid modbus_write_addr modbus_write_data modbus_read_valid modbus_read_addr
    modbus_quiet modbus_start_seen modbus_silent candidate commit revoke
    frame_length frame_broadcast frame_writes_coils frame_writes_parameter frame_bank
    count_crc count_parity count_framing count_t15 count_overrun count_foreign
    drive_write_valid drive_write_addr drive_write_data drive_read_valid drive_read_addr
    drive_sending drive_quiet drive_candidate drive_good drive_bad loopback_open loopback_heard restarts ticks
""".split()  # noqa: SIM905 (a table reads better than a list)
# Field of the map to the input that feeds it, as far as it needs no request.
SOURCES = {
    ("TIME", "ticks"): "ticks",
    ("REQUEST", "broadcast"): "frame_broadcast",
    ("REQUEST", "bank"): "frame_bank",
    ("LENGTH", "bytes"): "frame_length",
    ("EXCHANGE", "sending"): "drive_sending",
    ("EXCHANGE", "candidate"): "drive_candidate",
    ("EXCHANGE", "good"): "drive_good",
    ("EXCHANGE", "loopback"): "loopback_open",
    ("EXCHANGE", "heard"): "loopback_heard",
    ("RESTARTS", "count"): "restarts",
}
# What is flagged by hardware, and the strobe that says so.
EVENTS = {
    "crc": "count_crc",
    "parity": "count_parity",
    "framing": "count_framing",
    "t15": "count_t15",
    "overrun": "count_overrun",
    "revoked": "revoke",
    "foreign": "count_foreign",
    "drive_bad": "drive_bad",
}
# Fields that the gate makes; scenarios of their own follow them.
MADE_BY_THE_GATE = {
    ("REQUEST", "ticket"),
    ("REQUEST", "candidate"),
    ("REQUEST", "committed"),
    ("EXCHANGE", "queued"),
    ("EXCHANGE", "started"),
    ("EXCHANGE", "stop_due"),
}
ACTIONS = VALUES["TELEGRAM", "action"]
REPLY, TELEGRAM, DRIVE = (AREAS[f"{name}_FRAME"] for name in ("REPLY", "TELEGRAM", "DRIVE"))
LGE = AREAS["DRIVE_LGE"]
REQUEST_BANKS = (AREAS["REQUEST_FRAME_0"], AREAS["REQUEST_FRAME_1"])
TICKS = 0x5B
MEMORY_BYTES = 6144
NOTHING = b"\x5a\x5a\x5a\x5a"  # what no access carries
LONGEST_WAIT = 16  # clocks of a bus access


class Mailbox:
    """Both lines silent and both ports idle, until a test sets them otherwise."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, core_rst=1, **dict.fromkeys(INPUTS, 0))
        WordMemory(self.bench)
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

    async def access(self, address: int, size: int, value: int | None = None) -> int:
        """One bus access as the soft core makes it, bytes in their lanes; returns what was read."""
        dut = self.dut
        lane = address % 4
        dut.core_addr.value = address - lane
        dut.core_wstrb.value = 0 if value is None else ((1 << size) - 1) << lane
        # The lanes that are not written carry something else, and all of them do after the access.
        data = bytearray(NOTHING)
        data[lane : lane + size] = (value or 0).to_bytes(size, "little")
        dut.core_wdata.value = int.from_bytes(data, "little")
        dut.core_valid.value = 1
        for _ in range(LONGEST_WAIT):
            await self.bench.clocks()
            if int(dut.core_ready.value):
                break
        else:
            raise AssertionError(f"no answer within {LONGEST_WAIT} clocks")
        read = dut.core_rdata.value.to_unsigned()
        dut.core_valid.value = 0
        dut.core_wdata.value = int.from_bytes(NOTHING, "little")
        await self.bench.clocks()
        return read >> 8 * lane & ((1 << 8 * size) - 1)

    async def read(self, name: str) -> dict[str, int]:
        register = REGISTERS[name]
        return register.unpack(await self.access(BASE + register.offset, register.size))

    async def write(self, name: str, **fields: int) -> None:
        register = REGISTERS[name]
        await self.access(BASE + register.offset, register.size, register.pack(**fields))

    async def peek(self, area: Area, n: int) -> int:
        return await self.access(FRAMES + area.at(n), area.size)

    async def poke(self, area: Area, n: int, value: int) -> None:
        await self.access(FRAMES + area.at(n), area.size, value)

    async def put(self, area: Area, data: bytes) -> None:
        for n, byte in enumerate(data):
            await self.poke(area, n, byte)

    async def get(self, area: Area) -> bytes:
        return bytes([await self.peek(area, n) for n in range(area.length)])

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

    async def port(self, access: str, addr: int, byte: int | None = None) -> tuple[int, int]:
        """A port's access, for example "drive_write"; returns the byte read and the clocks waited."""
        valid, ready, lane = (getattr(self.dut, f"{access}_{part}") for part in ("valid", "ready", "addr"))
        lane.value, valid.value = addr, 1
        if byte is not None:
            getattr(self.dut, f"{access}_data").value = byte
        waited, taken = -1, False
        while not taken:
            await Timer(self.bench.period_ps // 4, unit="ps")
            taken = int(ready.value)
            await self.bench.clocks()
            waited += 1
        valid.value = 0
        return self.dut.read_data.value.to_unsigned(), waited

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
async def a_request_comes_in_and_its_reply_goes_out_through_the_frame_memory(dut):
    rng = seeded("frames")
    mailbox = await Mailbox(dut).start()
    for bank, area in enumerate(REQUEST_BANKS):
        adu = rng.randbytes(32)
        for n, byte in enumerate(adu):
            await mailbox.port("modbus_write", 32 * bank + n, byte)
        assert await mailbox.get(area) == adu
    reply = rng.randbytes(32)
    await mailbox.put(REPLY, reply)
    assert bytes([(await mailbox.port("modbus_read", n))[0] for n in range(32)]) == reply


@cocotb.test()
async def a_telegram_goes_out_and_the_drives_reply_comes_in_through_the_frame_memory(dut):
    rng = seeded("frames")
    mailbox = await Mailbox(dut).start()
    telegram, answer = rng.randbytes(32), rng.randbytes(32)
    await mailbox.put(TELEGRAM, telegram)
    assert bytes([(await mailbox.port("drive_read", n))[0] for n in range(32)]) == telegram
    for n, byte in enumerate(answer):
        await mailbox.port("drive_write", n, byte)
    assert await mailbox.get(DRIVE) == answer[: DRIVE.length]
    assert await mailbox.peek(LGE, 0) == answer[LGE.slot - DRIVE.slot]
    assert await mailbox.get(TELEGRAM) == telegram


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
async def the_counters_are_the_firmwares_own_and_no_part_of_the_telegram(dut):
    """They share words with the telegram, but no byte: counting never ends a licence."""
    mailbox = await Mailbox(dut).start()
    counters = {name: area for name, area in AREAS.items() if name.startswith("COUNT_")}
    telegram = bytes(range(32))
    await mailbox.put(TELEGRAM, telegram)
    touched = Strobes(mailbox.dut, "telegram_touched")
    mailbox.dut.drive_sending.value = 1
    for n, area in enumerate(counters.values()):
        await mailbox.poke(area, 0, 0xA000 + n)
    mailbox.dut.drive_sending.value = 0
    assert [await mailbox.peek(area, 0) for area in counters.values()] == [
        0xA000 + n for n in range(len(counters))
    ]
    for n, area in enumerate(counters.values()):
        await mailbox.poke(area, 0, 0xB000 + n)
    assert not len(touched)
    assert [await mailbox.peek(area, 0) for area in counters.values()] == [
        0xB000 + n for n in range(len(counters))
    ]
    assert await mailbox.get(TELEGRAM) == telegram


@cocotb.test()
async def what_was_prepared_for_a_candidate_leaves_at_its_commit(dut):
    mailbox = await Mailbox(dut).start()
    ticket = await mailbox.request()
    await mailbox.write("REPLY", length=17, ticket=ticket)
    await mailbox.write("TELEGRAM", length=13, early=1, ticket=ticket)
    assert int(mailbox.dut.mailbox_i.reply_queued.value) and (await mailbox.read("EXCHANGE"))["queued"]
    assert await mailbox.settle() == (0, 0)
    await mailbox.pulse("commit")
    assert await mailbox.settle() == (1, 1)
    assert mailbox.replies.values == [(17,)] and mailbox.telegrams.values == [(13, 0, 0)]
    exchange = await mailbox.read("EXCHANGE")
    assert exchange["started"] and not exchange["queued"]
    assert not int(mailbox.dut.mailbox_i.reply_queued.value)
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
    assert (len(again), len(stop)) == (1, 0)
    await mailbox.write("LISTEN", on=0)
    assert (len(again), len(stop)) == (1, 1)


@cocotb.test()
async def a_telegram_on_the_wire_can_neither_be_changed_nor_misread(dut):
    rng = seeded("telegram")
    mailbox = await Mailbox(dut).start()
    telegram = rng.randbytes(32)
    await mailbox.put(TELEGRAM, telegram)
    await mailbox.put(REPLY, bytes(byte ^ 0xFF for byte in telegram))
    mailbox.dut.drive_sending.value = 1
    await mailbox.put(TELEGRAM, bytes(32))
    assert await mailbox.get(TELEGRAM) == telegram
    # The same while the network port reads in every clock but a few.
    for n in range(32):
        mailbox.dut.modbus_read_addr.value, mailbox.dut.modbus_read_valid.value = n, 1
        reading = cocotb.start_soon(mailbox.peek(TELEGRAM, n))
        await mailbox.bench.clocks(rng.randint(1, 5))
        mailbox.dut.modbus_read_valid.value = 0
        assert await reading == telegram[n], f"byte {n}"
    mailbox.dut.drive_sending.value = 0
    await mailbox.put(TELEGRAM, bytes(32))
    assert await mailbox.get(TELEGRAM) == bytes(32)


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
    await mailbox.put(TELEGRAM, bytes(13))
    await mailbox.write("TELEGRAM", length=13, ticket=ticket)
    assert await mailbox.settle() == (0, 1)
    mailbox.dut.drive_sending.value = 1
    await mailbox.poke(TELEGRAM, 12, 4)
    mailbox.dut.drive_sending.value = 0
    await mailbox.write("TELEGRAM", action=1)
    assert await mailbox.settle() == (0, 2), "nothing was changed while it was sent"
    assert mailbox.telegrams.values[1] == (13, 0, 0), "a repeat is the same telegram"
    await mailbox.write("TELEGRAM", length=13, ticket=ticket)
    assert await mailbox.settle() == (0, 3)
    await mailbox.poke(TELEGRAM, 12, 4)
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
    """Whichever clock the write comes in: what starts is what was committed."""
    mailbox = await Mailbox(dut).start()
    for clocks in range(-3, 4):
        mailbox.dut.drive_quiet.value = 0
        ticket = await mailbox.request()
        await mailbox.pulse("commit")
        await mailbox.poke(TELEGRAM, 1, 0x00)
        await mailbox.write("TELEGRAM", length=5, ticket=ticket)
        before = len(mailbox.telegrams)
        write = None
        for now in range(-4, 6):
            if now == clocks:
                write = cocotb.start_soon(mailbox.poke(TELEGRAM, 1, 0x04))
            if now == 0:
                mailbox.dut.drive_quiet.value = 1
            await mailbox.bench.clocks()
            # The drive port says that it sends from the clock after the start on.
            mailbox.dut.drive_sending.value = int(len(mailbox.telegrams) > before)
        await write
        started = len(mailbox.telegrams) > before
        byte = await mailbox.peek(TELEGRAM, 1)
        mailbox.dut.drive_sending.value = 0
        assert not (started and byte == 0x04), f"write {clocks} clocks after the silence"
        assert started or byte == 0x04, "one of the two must be"


@cocotb.test()
async def a_restart_of_the_firmware_drops_what_it_queued_and_nothing_else(dut):
    mailbox = await Mailbox(dut).start()
    await mailbox.events()
    await mailbox.write("LED", modbus_green=1, drive_red=1)
    await mailbox.put(REPLY, bytes(range(32)))
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
    assert await mailbox.get(REPLY) == bytes(range(32))
    assert await mailbox.events() == {"crc"}


@cocotb.test()
async def while_the_loop_back_test_is_open_both_ports_send_without_a_request(dut):
    mailbox = await Mailbox(dut).start()
    mailbox.dut.loopback_open.value = 1
    await mailbox.write("REPLY", length=6)
    await mailbox.write("TELEGRAM", length=5)
    assert await mailbox.settle() == (1, 1)
    mailbox.dut.loopback_open.value = 0
    await mailbox.put(TELEGRAM, bytes(5))
    await mailbox.write("REPLY", length=6)
    await mailbox.write("TELEGRAM", length=5)
    assert await mailbox.settle() == (1, 1)


class Traffic:
    """Everybody on the memory at once, more often than ever on the card.

    Each byte has one writer while it lasts, so that what must be read is always known: the firmware
    writes the even bytes of its frames, the ports read the odd ones.
    """

    def __init__(self, mailbox: Mailbox, rng: random.Random):
        self.mailbox, self.rng = mailbox, rng
        self.bytes: dict[tuple[Area, int], int] = {}
        self.waits: dict[str, int] = {}

    async def _port(self, access: str, places: list[tuple[Area, int]]) -> None:
        write = access.endswith("write")
        for area, n in places:
            await self.mailbox.bench.clocks(self.rng.randint(1, 9))
            byte = self.rng.randrange(256) if write else None
            bank = 32 if area is REQUEST_BANKS[1] else 0
            got, waited = await self.mailbox.port(access, bank + n, byte)
            self.waits[access] = max(waited, self.waits.get(access, 0))
            if write:
                self.bytes[area, n] = byte
            else:
                assert got == self.bytes[area, n], f"{access} of byte {n}"

    async def _firmware(self, count: int) -> None:
        own = [(area, n) for area in (REPLY, TELEGRAM) for n in range(32)]
        for _ in range(count):
            area, n = self.rng.choice(own)
            if n % 2 == 0 and self.rng.random() < 0.5:
                byte = self.rng.randrange(256)
                await self.mailbox.poke(area, n, byte)
                self.bytes[area, n] = byte
            elif self.rng.random() < 0.2:
                assert (await self.mailbox.read("TIME"))["ticks"] == TICKS
            else:
                assert await self.mailbox.peek(area, n) == self.bytes[area, n], f"byte {n:02X}h"
            await self.mailbox.bench.clocks(self.rng.randint(1, 3))

    async def round(self) -> None:
        rng = self.rng
        requests = [(bank, n) for bank in REQUEST_BANKS for n in range(32)]
        replies, telegrams = ([(area, n) for n in range(1, 32, 2)] for area in (REPLY, TELEGRAM))
        answers = [(DRIVE, n) for n in range(DRIVE.length)]
        modbus = {"modbus_write": rng.sample(requests, 64), "modbus_read": rng.choices(replies, k=60)}
        drive = {"drive_write": rng.sample(answers, 28), "drive_read": rng.choices(telegrams, k=60)}
        # A port never writes and reads at once.
        for pair in itertools.product(modbus.items(), drive.items()):
            running = [cocotb.start_soon(self._port(access, places)) for access, places in pair]
            running.append(cocotb.start_soon(self._firmware(80)))
            for task in running:
                await task
        await self.mailbox.bench.clocks(20)


@cocotb.test()
async def nothing_is_lost_when_lines_and_firmware_meet_in_the_memory(dut):
    mailbox = await Mailbox(dut).start()
    mailbox.dut.ticks.value = TICKS
    traffic = Traffic(mailbox, seeded("traffic"))
    for area in (REPLY, TELEGRAM):
        for n in range(32):
            traffic.bytes[area, n] = n ^ area.offset
            await mailbox.poke(area, n, n ^ area.offset)
    for _ in range(cases(2, 8)):
        await traffic.round()
        for (area, n), byte in traffic.bytes.items():
            assert await mailbox.peek(area, n) == byte, f"byte {n:02X}h"
    # The network line never waits, the drive line for one access of the network line.
    assert traffic.waits["modbus_write"] == traffic.waits["modbus_read"] == 0
    assert traffic.waits["drive_write"] <= 1 and traffic.waits["drive_read"] <= 1
    assert traffic.waits["drive_write"] + traffic.waits["drive_read"] > 0, "they never met"


def simulate(sim: str, testcase: str, **more: int) -> None:
    run(
        "mailbox_bus",
        "tb.rtl.test_mailbox",
        sim=sim,
        extra_sources=[ROOT / "tb/rtl/mailbox_bus.v"],
        parameters={"MEMORY_BYTES": MEMORY_BYTES, **more},
        testcase=testcase,
    )


@pytest.mark.rule("FRAME-4", "FRAME-5", "FRAME-6", "FRAME-7", "FC-9", "MAP-9", "SAFE-1", "LOOP-1", "WDG-1")
def test_mailbox(sim):
    simulate(sim, r"(?!stop_)\w+")


@pytest.mark.rule("SAFE-7")
def test_mailbox_with_the_stop_of_a_lost_master(sim):
    simulate(sim, r"stop_\w+", MASTER_LOSS_STOP=1)


def test_every_field_that_is_read_has_a_source():
    """A register of the map without an entry in SOURCES would be read by no scenario."""
    read = {(name, field) for name, entry in REGISTERS.items() if entry.size == 1 for field in entry.fields}
    flags = {("EVENTS", name) for name in EVENTS}
    assert read == {*SOURCES, *flags, *MADE_BY_THE_GATE}
