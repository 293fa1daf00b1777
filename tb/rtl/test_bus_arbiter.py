# SPDX-License-Identifier: Apache-2.0
"""bus_arbiter: one access per clock, lines before the core, and the lock of the telegram frame."""

from __future__ import annotations

import random

import cocotb
import pytest
from cocotb.triggers import Timer

from regs.generated.mailbox import AREAS, BASE, FRAMES, FRAMES_BYTES, REGISTERS, STRIDE
from tb.lib.bench import Bench, inputs
from tb.lib.nightly import first
from tb.lib.runner import run
from tb.lib.seeds import seeded

SIZES = (6144, 8192)
LINES = ("modbus_write", "modbus_read", "drive_write", "drive_read")
TELEGRAM = AREAS["TELEGRAM_FRAME"]
# Slot of address 0 of each line, and the lane that it writes; reads use lane 0.
FIRST_SLOT = {
    "modbus_write": AREAS["REQUEST_FRAME_0"].slot,
    "modbus_read": AREAS["REPLY_FRAME"].slot,
    "drive_write": AREAS["DRIVE_FRAME"].slot,
    "drive_read": TELEGRAM.slot,
}
LANES = {"modbus_write": AREAS["REQUEST_FRAME_0"].lane, "drive_write": AREAS["DRIVE_FRAME"].lane}


class Arbiter:
    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, **dict.fromkeys(inputs("bus_arbiter"), 0))
        self.size = int(dut.MEMORY_BYTES.value)

    async def start(self) -> Arbiter:
        await self.bench.start()
        return self

    def word(self, address: int) -> int:
        """The memory word that an address of the soft core selects."""
        address &= 8191
        if address >= self.size:
            address -= 2048
        return address // 4

    @property
    def frames(self) -> int:
        """The first word of the frame memory."""
        return (self.size - FRAMES_BYTES) // 4

    def offer(self, address: int, strobes: int, data: int = 0, valid: int = 1) -> None:
        dut = self.dut
        dut.core_valid.value, dut.core_addr.value = valid, address
        dut.core_wstrb.value, dut.core_wdata.value = strobes, data

    async def done(self) -> int:
        """Waits for the end of the offered access; returns its clocks."""
        clocks = 0
        while True:
            await self.bench.clocks()
            clocks += 1
            if int(self.dut.core_ready.value):
                break
        self.dut.core_valid.value = 0
        await self.bench.clocks()
        return clocks

    async def seen(self) -> dict[str, int]:
        """The signals of the memory side within this clock, after the inputs have settled."""
        await Timer(self.bench.period_ps // 4, unit="ps")
        names = ("ram_enable", "ram_word", "ram_wdata", "ram_wstrb", "regs_valid", "telegram_touched")
        return {name: int(getattr(self.dut, name).value) for name in names}


@cocotb.test()
async def soft_core_in_reset_reaches_neither_memory_nor_registers(dut):
    """Whatever its bus shows from the first moment on (SAFE-5); the lines are served (WDG-1)."""
    rng = seeded("bus of a soft core in reset")
    arbiter = Arbiter(dut)
    arbiter.offer(0, 15, 0xFFFFFFFF)
    await arbiter.start()
    for _ in range(200):
        dut.rst.value = 1
        arbiter.offer(rng.getrandbits(32), rng.randrange(16), rng.getrandbits(32))
        dut.drive_write_valid.value = line = rng.randrange(2)
        seen = await arbiter.seen()
        assert (seen["ram_enable"], seen["ram_wstrb"]) == ((1, 4) if line else (0, 0))
        assert not seen["regs_valid"] and not seen["telegram_touched"]
        assert int(dut.drive_write_ready.value) == line
        await arbiter.bench.clocks()
        assert not int(dut.core_ready.value)


@cocotb.test()
async def any_set_of_requests_has_one_winner_and_lines_come_first(dut):
    rng = seeded("requests")
    arbiter = await Arbiter(dut).start()
    for _ in range(6):
        for who in range(2 ** (len(LINES) + 1)):
            await one_clock(arbiter, rng, {line for n, line in enumerate(LINES) if who >> n & 1}, who >> 4)


async def one_clock(arbiter: Arbiter, rng: random.Random, requests: set[str], core: int) -> None:
    """One clock with a set of requests: exactly one is served, with its own address and data."""
    if {"modbus_write", "modbus_read"} <= requests or {"drive_write", "drive_read"} <= requests:
        return
    dut = arbiter.dut
    addr = {line: rng.randrange(64 if line == "modbus_write" else 32) for line in LINES}
    data = {line: rng.randrange(256) for line in LANES}
    for line in LINES:
        getattr(dut, f"{line}_valid").value = int(line in requests)
        getattr(dut, f"{line}_addr").value = addr[line]
    for line, byte in data.items():
        getattr(dut, f"{line}_data").value = byte
    strobes, word = rng.randrange(16), rng.getrandbits(32)
    address = rng.randrange(0, 4096, 4)
    arbiter.offer(address, strobes, word, core)
    seen = await arbiter.seen()
    winner = next((line for line in LINES if line in requests), None)
    ready = {line for line in LINES if int(getattr(dut, f"{line}_ready").value)}
    assert ready == ({winner} if winner else set())
    assert seen["ram_enable"] == bool(winner or core)
    written = seen["ram_wstrb"]
    if winner:
        assert seen["ram_word"] == arbiter.frames + FIRST_SLOT[winner] + addr[winner], winner
        lane = LANES.get(winner)
        assert written == (0 if lane is None else 1 << lane), winner
        if lane is not None:
            assert seen["ram_wdata"] >> 8 * lane & 0xFF == data[winner]
    else:
        assert written == (strobes if core else 0)
        if core:
            assert seen["ram_word"] == arbiter.word(address) and seen["ram_wdata"] == word
    await arbiter.bench.clocks()
    for line in LINES:
        getattr(dut, f"{line}_valid").value = 0
    assert int(dut.core_ready.value) == bool(core and not winner)
    if core:
        if winner:
            assert await arbiter.done() == 1, "served in the very next clock"
        else:
            dut.core_valid.value = 0
            await arbiter.bench.clocks()


@cocotb.test()
async def an_access_happens_once_after_any_wait(dut):
    """A write to a register waits for no line."""
    rng = seeded("waits")
    arbiter = await Arbiter(dut).start()
    for _ in range(100):
        to_regs, waits = rng.randint(0, 1), rng.randrange(4)
        strobes = rng.randrange(0 if to_regs else 1, 16)
        arbiter.offer(BASE if to_regs else 4 * rng.randrange(1024), strobes, 1)
        dut.drive_read_valid.value = int(waits > 0)
        happened = []
        for clock in range(waits + 3):
            if clock == waits:
                dut.drive_read_valid.value = 0
            seen = await arbiter.seen()
            if seen["regs_valid"] or seen["ram_wstrb"]:
                happened.append(clock)
            ready = int(dut.core_ready.value)
            await arbiter.bench.clocks()
            if ready:
                dut.core_valid.value = 0
        assert happened == [0 if to_regs and strobes else waits]


@cocotb.test()
async def registers_and_memory_respond_at_their_own_addresses(dut):
    rng = seeded("addresses")
    arbiter = await Arbiter(dut).start()
    for register in REGISTERS.values():
        for strobes in (0, 0b1111, 1 << register.offset % 4):
            arbiter.offer(BASE + register.offset // 4 * 4, strobes)
            seen = await arbiter.seen()
            assert seen["regs_valid"] and not seen["ram_enable"] and not seen["ram_wstrb"]
            assert int(dut.regs_word.value) == register.offset // 4
            assert int(dut.regs_write.value) == (strobes != 0)
            await arbiter.done()
    for _ in range(300):
        offset = rng.randrange(0, FRAMES_BYTES, 4)
        for address in (FRAMES + offset, arbiter.size - FRAMES_BYTES + offset):
            arbiter.offer(address, 0)
            seen = await arbiter.seen()
            assert seen["ram_enable"] and not seen["regs_valid"]
            assert seen["ram_word"] == arbiter.frames + offset // STRIDE
            await arbiter.done()
        address = rng.randrange(0, arbiter.size, 4)
        arbiter.offer(address, 0)
        assert (await arbiter.seen())["ram_word"] == address // 4
        await arbiter.done()


@cocotb.test()
async def read_data_comes_from_memory_or_registers(dut):
    rng = seeded("data")
    await Arbiter(dut).start()
    for _ in range(50):
        ram, regs = rng.getrandbits(32), rng.getrandbits(32)
        for from_ram, from_regs in ((ram, 0), (0, regs)):
            dut.ram_rdata.value, dut.regs_rdata.value = from_ram, from_regs
            await Timer(1, unit="ns")
            read = from_ram or from_regs
            assert int(dut.core_rdata.value) == read and int(dut.read_data.value) == read & 0xFF


def aliases(size: int) -> list[int]:
    """All aliases of the first address of the telegram frame, also with address bits above the memory."""
    first = TELEGRAM.offset
    found = [FRAMES + first, size - FRAMES_BYTES + first, 8192 - FRAMES_BYTES + first]
    return [
        *found,
        *(found[1] + (n << 13) for n in (1, 2, 0x1FFFF)),
        0x7FFF_FF00 + first,
        0xFFFF_FF00 + first,
    ]


@cocotb.test()
async def writes_by_any_alias_touch_the_telegram_and_are_blocked_while_it_is_sent(dut):
    arbiter = await Arbiter(dut).start()
    for sending in (0, 1):
        dut.telegram_sending.value = sending
        for base in aliases(arbiter.size):
            for slot in (0, 1, 12, 31):
                for strobes in range(16):
                    arbiter.offer(base + STRIDE * slot, strobes)
                    seen = await arbiter.seen()
                    assert seen["ram_word"] == arbiter.frames + TELEGRAM.slot + slot
                    assert seen["telegram_touched"] == (strobes & 1 and not sending)
                    assert seen["ram_wstrb"] == (strobes & ~1 if sending else strobes)
                    await arbiter.done()


@cocotb.test()
async def writes_elsewhere_never_touch_the_telegram(dut):
    arbiter = await Arbiter(dut).start()
    telegram = range(arbiter.frames + TELEGRAM.slot, arbiter.frames + TELEGRAM.slot + TELEGRAM.length)
    dut.telegram_sending.value = 1
    for word in range(arbiter.size // 4):
        if word not in telegram:
            arbiter.offer(4 * word, 0b1111)
            assert (await arbiter.seen())["ram_wstrb"] == 0b1111, f"word {word}"
            await arbiter.done()
    dut.telegram_sending.value = 0
    for word in range(arbiter.size // 4):
        if word not in telegram:
            arbiter.offer(4 * word, 0b1111)
            assert not (await arbiter.seen())["telegram_touched"], f"word {word}"
            await arbiter.done()
    for register in REGISTERS.values():
        arbiter.offer(BASE + register.offset // 4 * 4, 0b1111)
        assert not (await arbiter.seen())["telegram_touched"]
        await arbiter.done()


@cocotb.test()
async def a_waiting_write_touches_the_telegram_from_its_first_clock_on(dut):
    arbiter = await Arbiter(dut).start()
    dut.drive_read_valid.value = 1
    arbiter.offer(FRAMES + TELEGRAM.offset, 1)
    for _ in range(5):
        seen = await arbiter.seen()
        assert seen["telegram_touched"] and not seen["ram_wstrb"]
        await arbiter.bench.clocks()
    dut.drive_read_valid.value = 0
    seen = await arbiter.seen()
    assert seen["telegram_touched"] and seen["ram_wstrb"] == 1
    await arbiter.bench.clocks()
    seen = await arbiter.seen()
    assert not seen["telegram_touched"] and not seen["ram_wstrb"], "the access happened twice"


@cocotb.test()
async def a_reset_clears_ready(dut):
    arbiter = await Arbiter(dut).start()
    arbiter.offer(0, 0)
    dut.rst.value = 1
    for _ in range(3):
        await arbiter.bench.clocks()
        assert not int(dut.core_ready.value)


@pytest.mark.parametrize("size", first(SIZES))
@pytest.mark.rule("FRAME-5", "SAFE-1", "TOP-2")
def test_bus_arbiter(sim, size):
    run("bus_arbiter", "tb.rtl.test_bus_arbiter", sim=sim, parameters={"MEMORY_BYTES": size})
