# SPDX-License-Identifier: Apache-2.0
"""mailbox_regs: every register and field of the map, as the firmware's bus sees them."""

from __future__ import annotations

import itertools

import cocotb
import pytest
from cocotb.triggers import RisingEdge

from regs.generated.mailbox import REGISTERS, VALUES, Register
from tb.lib.bench import Bench, Strobes, inputs
from tb.lib.runner import run
from tb.lib.seeds import seeded

READ = {name: register for name, register in REGISTERS.items() if register.size == 1}
WRITTEN = {name: register for name, register in REGISTERS.items() if register.size == 4}
EVENTS = REGISTERS["EVENTS"].fields
# Field to the input that feeds it.
SOURCES = {
    (name, field): about.port
    for name, register in READ.items()
    for field, about in register.fields.items()
    if name != "EVENTS"
}
PULSES = [about.port for register in WRITTEN.values() for about in register.fields.values() if about.pulse]
COMMANDS = [
    *("order_reply", "order_telegram", "order_repeat", "listen_again", "listen_stop", "watchdog_kick"),
    *PULSES,
]
ACTIONS = VALUES["TELEGRAM", "action"]
KEY = REGISTERS["WATCHDOG"].fields["key"].reset


class Firmware:
    """The soft core's side of the bus, as bus_arbiter leads it here."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, **dict.fromkeys(inputs("mailbox_regs"), 0))

    async def start(self) -> Firmware:
        await self.bench.start()
        return self

    async def access(self, word: int, value: int | None = None) -> int:
        """One access to a word; returns what was read."""
        self.dut.word.value = word
        self.dut.write.value = int(value is not None)
        self.dut.wdata.value = value or 0
        self.dut.valid.value = 1
        await RisingEdge(self.dut.clk)
        self.dut.valid.value = 0
        await self.bench.clocks()
        data = self.dut.rdata.value.to_unsigned()
        await self.bench.clocks()
        assert not int(self.dut.rdata.value), "what nobody asked for"
        return data

    async def read(self, name: str) -> int:
        """The byte of a register."""
        register: Register = READ[name]
        return await self.access(register.offset // 4) >> 8 * (register.offset % 4) & 0xFF

    async def write(self, name: str, **fields: int) -> None:
        assert REGISTERS[name].offset % 4 == 0
        await self.access(REGISTERS[name].offset // 4, REGISTERS[name].pack(**fields))

    async def event(self, flags: int) -> None:
        for shown in (flags, 0):
            for about in EVENTS.values():
                getattr(self.dut, about.port).value = about.get(shown)
            if shown:
                await self.bench.clocks()


def feed(dut, rng) -> dict[tuple[str, str], int]:
    """Random levels on every input; returns what each field must read."""
    expected = {}
    for (register, field), source in SOURCES.items():
        value = rng.getrandbits(REGISTERS[register].fields[field].width)
        getattr(dut, source).value = value
        expected[register, field] = value
    return expected


@cocotb.test()
async def after_reset_every_field_reads_its_reset_value(dut):
    firmware = await Firmware(dut).start()
    for name, register in READ.items():
        word = await firmware.read(name)
        for field, about in register.fields.items():
            assert about.get(word) == about.reset, f"{name}.{field}"


@cocotb.test()
async def every_field_shows_its_own_input_and_nothing_else_is_read(dut):
    rng = seeded("levels")
    firmware = await Firmware(dut).start()
    for _ in range(20):
        expected = feed(dut, rng)
        for name, register in READ.items():
            word = await firmware.read(name)
            used = 0
            for field, about in register.fields.items():
                if name != "EVENTS":
                    assert about.get(word) == expected[name, field], f"{name}.{field}"
                used |= ((1 << about.width) - 1) << about.bit
            assert word & ~used == 0, f"{name}: {word:02X}h in bits that do not exist"


@cocotb.test()
async def an_event_stays_until_it_is_cleared_and_clears_no_other(dut):
    rng = seeded("events")
    firmware = await Firmware(dut).start()
    for about in EVENTS.values():
        await firmware.event(1 << about.bit)
        assert await firmware.read("EVENTS") == 1 << about.bit
        assert await firmware.read("EVENTS") == 1 << about.bit, "reading has no side effect"
        await firmware.write("EVENTS", **dict.fromkeys(EVENTS, 1))
        assert await firmware.read("EVENTS") == 0
    for _ in range(100):
        flags, cleared = rng.randrange(256), rng.randrange(256)
        await firmware.event(flags)
        await firmware.access(REGISTERS["EVENTS"].offset // 4, cleared)
        assert await firmware.read("EVENTS") == flags & ~cleared
        await firmware.access(REGISTERS["EVENTS"].offset // 4, 0xFF)
    assert await firmware.read("EVENTS") == 0


@cocotb.test()
async def an_event_in_the_clock_of_its_clearing_is_kept(dut):
    firmware = await Firmware(dut).start()
    for about in EVENTS.values():
        flag = 1 << about.bit
        await firmware.event(0xFF)
        dut.word.value, dut.write.value, dut.wdata.value = REGISTERS["EVENTS"].offset // 4, 1, 0xFF
        dut.valid.value = 1
        await firmware.event(flag)
        dut.valid.value = 0
        await firmware.bench.clocks()
        assert await firmware.read("EVENTS") == flag


@cocotb.test()
async def events_outlive_a_restart_of_the_firmware(dut):
    firmware = await Firmware(dut).start()
    await firmware.event(0x55)
    dut.rst.value = 1
    await firmware.event(0x2A)
    dut.rst.value = 0
    await firmware.bench.clocks()
    assert await firmware.read("EVENTS") == 0xFF


@cocotb.test()
async def each_command_comes_once_and_from_its_register_alone(dut):
    firmware = await Firmware(dut).start()
    strobes = {name: Strobes(dut, name) for name in COMMANDS}

    def seen() -> dict[str, int]:
        return {name: len(strobe) for name, strobe in strobes.items() if len(strobe)}

    await firmware.write("REPLY", length=9, ticket=3)
    assert seen() == {"order_reply": 1} and int(dut.reply_length.value) == 9
    await firmware.write("TELEGRAM", length=13, no_reply=1)
    assert seen() == {"order_reply": 1, "order_telegram": 1}
    await firmware.write("TELEGRAM", action=ACTIONS["repeat"])
    assert int(dut.telegram_length.value) == 13 and int(dut.telegram_no_reply.value) == 1, "the same telegram"
    await firmware.write("LISTEN", on=1)
    await firmware.write("LISTEN", on=0)
    orders = {"order_reply": 1, "order_telegram": 1, "order_repeat": 1, "listen_again": 1, "listen_stop": 1}
    assert seen() == orders
    for name in READ:
        await firmware.read(name)
    assert seen() == orders


@cocotb.test()
async def an_order_names_its_kind_with_its_length(dut):
    firmware = await Firmware(dut).start()
    orders = Strobes(dut, "order_telegram", "order_kind")
    kinds = {"first": (0, 0), "image": (1, 1), "write": (2, 3)}
    actions = list(itertools.product(kinds, (0, 1)))
    for length, (action, no_reply) in enumerate(actions, start=6):
        await firmware.write("TELEGRAM", action=ACTIONS[action], length=length, no_reply=no_reply)
        assert int(dut.telegram_length.value) == length and int(dut.telegram_no_reply.value) == no_reply
    assert orders.values == [(kinds[action][no_reply],) for action, no_reply in actions]


@cocotb.test()
async def while_a_telegram_is_sent_none_is_ordered(dut):
    firmware = await Firmware(dut).start()
    strobes = [Strobes(dut, name) for name in ("order_telegram", "order_repeat")]
    await firmware.write("TELEGRAM", length=13)
    dut.drive_sending.value = 1
    for action in ACTIONS.values():
        await firmware.write("TELEGRAM", action=action, length=5, no_reply=1)
    assert [len(strobe) for strobe in strobes] == [1, 0]
    assert int(dut.telegram_length.value) == 13 and int(dut.telegram_no_reply.value) == 0


@cocotb.test()
async def only_its_key_kicks_the_watchdog(dut):
    firmware = await Firmware(dut).start()
    kicks = Strobes(dut, "watchdog_kick")
    for key in range(256):
        await firmware.write("WATCHDOG", key=key)
        assert len(kicks) == (key >= KEY)


@cocotb.test()
async def each_written_field_reaches_its_port_and_no_other(dut):
    """A field without a reset value in the clock of the write; one with it until the next write or reset."""
    rng = seeded("written")
    firmware = await Firmware(dut).start()
    pulses = {port: Strobes(dut, port) for port in PULSES}
    kept: dict[str, int] = {}
    for register in 20 * list(WRITTEN.values()):
        word = rng.getrandbits(32)
        await firmware.access(register.offset // 4, word)
        values = {about: about.get(word) for about in register.fields.values() if about.port}
        kept |= {about.port: value for about, value in values.items() if about.reset == 0 and not about.pulse}
        now = {about.port: value for about, value in values.items() if about.reset is None}
        assert {port: int(getattr(dut, port).value) for port in kept | now} == kept | now
        asked = {about.port: 1 for about, value in values.items() if about.pulse and value}
        assert {port: len(strobe) for port, strobe in pulses.items() if len(strobe)} == asked
        for strobe in pulses.values():
            strobe.clear()
    for register in WRITTEN.values():
        await firmware.access(register.offset // 4, 0xFFFFFFFF)
    await firmware.bench.strobe(dut.rst)
    assert kept and not any(int(getattr(dut, port).value) for port in kept)


@pytest.mark.rule("SAFE-1", "FRAME-4", "WDG-1", "LED-5", "LOOP-1")
def test_mailbox_regs(sim):
    run("mailbox_regs", "tb.rtl.test_mailbox_regs", sim=sim)
