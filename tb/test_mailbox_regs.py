# SPDX-License-Identifier: Apache-2.0
"""mailbox_regs: every register and field of the map, as the firmware's bus sees them."""

from __future__ import annotations

import cocotb
import pytest

from tb.generated.mailbox import AREAS, FRAME_MEMORY, REGISTERS
from tb.lib.bench import Bench, Strobes
from tb.lib.runner import run
from tb.lib.seeds import seeded

# Field of the map to the input that feeds it.
SOURCES = {
    ("SW_BAUD", "switches"): "sw_baud",
    ("SW_ADDR", "switches"): "sw_addr",
    ("TIME", "ms"): "ms",
    ("REQUEST", "ticket"): "request_ticket",
    ("REQUEST", "candidate"): "request_candidate",
    ("REQUEST", "committed"): "request_committed",
    ("REQUEST", "broadcast"): "request_broadcast",
    ("REQUEST", "bank"): "request_bank",
    ("REQUEST_LENGTH", "bytes"): "request_length",
    ("REPLY", "queued"): "reply_queued",
    ("REPLY", "sending"): "reply_sending",
    ("EXCHANGE", "queued"): "telegram_queued",
    ("EXCHANGE", "sending"): "telegram_sending",
    ("EXCHANGE", "started"): "telegram_started",
    ("EXCHANGE", "listening"): "drive_listening",
    ("EXCHANGE", "candidate"): "drive_candidate",
    ("EXCHANGE", "good"): "drive_good",
    ("EXCHANGE", "lge"): "drive_lge",
    ("SUPERVISOR", "loopback"): "loopback_open",
    ("SUPERVISOR", "bites"): "watchdog_bites",
}
PARAMETERS = {"CLK_HZ": 24_500_000, "STRICT_T15": 0, "PREPARE_EARLY": 1, "SOFT_CORE_ID": 1}
BUILD = {"strict_t15": 0, "prepare_early": 1, "soft_core": 1, "clk_mhz": 24}
COMMANDS = """
    queue_reply queue_telegram telegram_touched listen_again listen_stop watchdog_kick halt loopback_close
""".split()  # noqa: SIM905
KEY = REGISTERS["WATCHDOG"].fields["key"].reset
TELEGRAM = AREAS["TELEGRAM_FRAME"]


class Firmware:
    """The soft core's side of the bus; the frame memory answers at once unless told otherwise."""

    def __init__(self, dut):
        self.dut = dut
        inputs = dict.fromkeys((*SOURCES.values(), "bus_valid", "bus_write", "bus_word", "bus_wdata"), 0)
        self.bench = Bench(dut, **inputs, write_ready=1, read_ready=1, read_data=0)

    async def start(self) -> Firmware:
        await self.bench.start()
        return self

    async def access(self, offset: int, value: int | None = None) -> int:
        """One bus access at a byte offset; returns what was read."""
        self.dut.bus_word.value = offset // 4
        self.dut.bus_write.value = int(value is not None)
        self.dut.bus_wdata.value = value or 0
        self.dut.bus_valid.value = 1
        await self.bench.clocks()
        for _ in range(20):
            if int(self.dut.bus_ready.value):
                break
            await self.bench.clocks()
        else:
            raise AssertionError("no answer within 20 clocks")
        data = self.dut.bus_rdata.value.to_unsigned()
        self.dut.bus_valid.value = 0
        await self.bench.clocks()
        return data

    async def read(self, name: str) -> int:
        return await self.access(REGISTERS[name].offset)

    async def write(self, name: str, **fields: int) -> None:
        await self.access(REGISTERS[name].offset, REGISTERS[name].pack(**fields))


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
    for name, register in REGISTERS.items():
        word = await firmware.read(name)
        for field, about in register.fields.items():
            if about.access != "wo" and about.reset is not None:
                assert about.get(word) == about.reset, f"{name}.{field}"
    assert REGISTERS["BUILD"].unpack(await firmware.read("BUILD")) == BUILD


@cocotb.test()
async def every_field_shows_its_own_input_and_nothing_else_is_read(dut):
    rng = seeded("levels")
    firmware = await Firmware(dut).start()
    for _ in range(20):
        expected = feed(dut, rng)
        for name, register in REGISTERS.items():
            word = await firmware.read(name)
            used = 0
            for field, about in register.fields.items():
                if (name, field) in SOURCES:
                    assert about.get(word) == expected[name, field], f"{name}.{field}"
                if about.access != "wo":
                    used |= ((1 << about.width) - 1) << about.bit
            assert word & ~used == 0, f"{name}: {word:04X}h in bits that do not exist"


@cocotb.test()
async def words_between_the_registers_read_0(dut):
    firmware = await Firmware(dut).start()
    feed(dut, seeded("levels"))
    known = {register.offset for register in REGISTERS.values()}
    for offset in range(0, FRAME_MEMORY, 4):
        if offset not in known:
            assert await firmware.access(offset) == 0, f"offset {offset:03X}h"


@cocotb.test()
async def only_the_led_register_keeps_what_is_written(dut):
    firmware = await Firmware(dut).start()
    before = {name: await firmware.read(name) for name in REGISTERS}
    for register in REGISTERS.values():
        await firmware.access(register.offset, 0xFFFF)
    for name in REGISTERS:
        assert await firmware.read(name) == (0xF if name == "LED" else before[name]), name
    for field in REGISTERS["LED"].fields:
        await firmware.write("LED", **{field: 1})
        lit = {other: int(getattr(dut, f"led_{other}").value) for other in REGISTERS["LED"].fields}
        assert lit == {other: int(other == field) for other in lit}


@cocotb.test()
async def each_command_comes_once_and_from_its_register_alone(dut):
    firmware = await Firmware(dut).start()
    strobes = {name: Strobes(dut, name) for name in COMMANDS}

    def seen() -> dict[str, int]:
        return {name: len(strobe) for name, strobe in strobes.items() if len(strobe)}

    await firmware.write("REPLY", length=9, ticket=3)
    assert seen() == {"queue_reply": 1} and int(dut.reply_length.value) == 9
    await firmware.write("TELEGRAM", length=13, no_reply=1)
    assert seen() == {"queue_reply": 1, "queue_telegram": 1}
    assert int(dut.telegram_length.value) == 13 and int(dut.telegram_no_reply.value) == 1
    await firmware.write("TELEGRAM", repeat=1)  # the same telegram: its length and kind stay
    assert int(dut.telegram_length.value) == 13 and int(dut.telegram_no_reply.value) == 1
    await firmware.write("LISTEN", on=1)
    await firmware.write("LISTEN", on=0)
    assert seen() == {"queue_reply": 1, "queue_telegram": 2, "listen_again": 1, "listen_stop": 1}
    for name in REGISTERS:
        await firmware.read(name)
    assert seen() == {"queue_reply": 1, "queue_telegram": 2, "listen_again": 1, "listen_stop": 1}


@cocotb.test()
async def only_its_key_kicks_the_watchdog(dut):
    firmware = await Firmware(dut).start()
    kicks = Strobes(dut, "watchdog_kick")
    for key in range(256):
        await firmware.write("WATCHDOG", key=key)
        assert len(kicks) == (key >= KEY)


@cocotb.test()
async def the_supervisor_is_told_one_thing_at_a_time(dut):
    firmware = await Firmware(dut).start()
    halts, closes = Strobes(dut, "halt"), Strobes(dut, "loopback_close")
    await firmware.write("SUPERVISOR")
    assert (len(halts), len(closes)) == (0, 0)
    await firmware.write("SUPERVISOR", loopback=1)
    assert (len(halts), len(closes)) == (0, 1)
    await firmware.write("SUPERVISOR", halt=1)
    assert (len(halts), len(closes)) == (1, 1)


@cocotb.test()
async def every_byte_of_the_frame_memory_has_a_word_of_its_own(dut):
    firmware = await Firmware(dut).start()
    writes = Strobes(dut, "write_valid", "frame_addr", "write_data")
    reads = Strobes(dut, "read_valid", "frame_addr")
    for index in range(256):
        await firmware.access(FRAME_MEMORY + 4 * index, 0xA500 | (index ^ 0x5A))
        dut.read_data.value = index
        assert await firmware.access(FRAME_MEMORY + 4 * index) == index
    assert writes.values == [(index, index ^ 0x5A) for index in range(256)]
    assert reads.values == [(index,) for index in range(256)]


@cocotb.test()
async def an_access_waits_until_the_memory_has_a_clock_to_spare(dut):
    firmware = await Firmware(dut).start()
    for value, ready in ((None, dut.read_ready), (0x12, dut.write_ready)):
        dut.read_ready.value = dut.write_ready.value = 0
        done = cocotb.start_soon(firmware.access(FRAME_MEMORY, value))
        await firmware.bench.clocks(7)
        assert not done.done()
        ready.value = 1
        await done


@cocotb.test()
async def a_telegram_on_the_wire_cannot_be_changed(dut):
    firmware = await Firmware(dut).start()
    touched = Strobes(dut, "telegram_touched")
    written = Strobes(dut, "write_valid", "frame_addr")
    first, last = TELEGRAM.index, TELEGRAM.index + TELEGRAM.length - 1
    for index in (first - 1, first, last, last + 1):
        await firmware.access(FRAME_MEMORY + 4 * index, 1)
    assert len(touched) == 2 and len(written) == 4
    dut.telegram_sending.value = 1
    for index in (first - 1, first, last, last + 1):
        await firmware.access(FRAME_MEMORY + 4 * index, 1)
    assert len(touched) == 2
    assert [addr for (addr,) in written.values[4:]] == [first - 1, last + 1]


@cocotb.test()
async def no_telegram_is_queued_over_the_one_on_the_wire(dut):
    firmware = await Firmware(dut).start()
    queued = Strobes(dut, "queue_telegram")
    await firmware.write("TELEGRAM", length=13)
    dut.telegram_sending.value = 1
    await firmware.write("TELEGRAM", length=5, no_reply=1)
    assert len(queued) == 1
    assert int(dut.telegram_length.value) == 13 and not int(dut.telegram_no_reply.value)


@pytest.mark.rule("SAFE-1", "LINE-8", "WDG-1", "LED-5", "LOOP-1")
def test_mailbox_regs(sim):
    run("mailbox_regs", "tb.test_mailbox_regs", sim=sim, parameters=PARAMETERS)
