# SPDX-License-Identifier: Apache-2.0
"""supervisor: resets a silent firmware, halts on a fault, enables the loop-back test."""

from __future__ import annotations

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run

# Number of beats without a kick at which the watchdog bites.
BITES_AT = 3
LOOPBACK = 0b1_1110_0111  # switch 9 ... switch 1
NORMAL = 0b0_0001_1111
INPUTS = {
    "beat": 0,
    "kick": 0,
    "halt": 0,
    "loopback_close": 0,
    "core_trap": 0,
    "start_seen": 0,
    "driven": 0,
    "sw_baud": NORMAL,
    "address_valid": 1,
    "reply_start": 0,
    "drive_good": 0,
}


class Watched:
    """The supervisor and the firmware it watches; a beat comes every ten clocks."""

    def __init__(self, dut, **inputs: int):
        self.dut = dut
        self.bench = Bench(dut, **{**INPUTS, **inputs})

    async def start(self) -> Watched:
        await self.bench.start()
        return self

    async def beats(self, count: int, kicking: bool = False) -> int:
        """Waits `count` beats; returns how many of them reset the soft core."""
        resets = 0
        for _ in range(count):
            self.dut.beat.value = 1 - int(self.dut.beat.value)
            await self.bench.clocks()
            if kicking:
                await self.bench.strobe(self.dut.kick)
            seen = int(self.dut.core_rst.value)
            for _ in range(8 - kicking):
                await self.bench.clocks()
                seen |= int(self.dut.core_rst.value)
            resets += seen
        return resets

    @property
    def fault(self) -> bool:
        return bool(int(self.dut.fault.value))


@cocotb.test()
async def a_kicking_firmware_is_never_reset(dut):
    watched = await Watched(dut).start()
    assert await watched.beats(50, kicking=True) == 0
    assert not watched.fault


@cocotb.test()
async def a_silent_firmware_is_reset_once_at_the_third_beat(dut):
    watched = await Watched(dut).start()
    assert await watched.beats(BITES_AT - 1) == 0
    assert await watched.beats(1) == 1
    assert int(dut.bites.value) == 1 and not watched.fault
    assert await watched.beats(10, kicking=True) == 0, "the firmware runs on"
    assert await watched.beats(BITES_AT - 1) == 0, "beats count from the last kick"
    assert await watched.beats(1) == 1
    assert int(dut.restarts.value) == 2


@cocotb.test()
async def the_third_bite_halts_until_a_reset(dut):
    watched = await Watched(dut).start()
    await watched.beats(3 * BITES_AT)
    assert watched.fault and int(dut.core_rst.value)
    await watched.beats(20, kicking=True)
    assert watched.fault and int(dut.core_rst.value)
    await watched.bench.strobe(dut.rst)
    assert not watched.fault


@cocotb.test()
@cocotb.parametrize(evidence=["reply_start", "drive_good"])
async def an_exchange_clears_the_count_of_bites(dut, evidence):
    watched = await Watched(dut).start()
    for _ in range(4):
        await watched.beats(BITES_AT)
        assert not watched.fault
        await watched.bench.strobe(getattr(dut, evidence))
    assert int(dut.bites.value) == 0


@cocotb.test()
async def a_constant_drive_good_does_not_clear_the_count_of_bites(dut):
    watched = await Watched(dut, drive_good=1).start()
    await watched.beats(3 * BITES_AT)
    assert watched.fault


@cocotb.test()
async def a_reply_at_the_time_of_the_halt_does_not_clear_the_fault(dut):
    watched = await Watched(dut).start()
    for _ in range(2):
        await watched.bench.strobe(dut.core_trap)
        await watched.bench.clocks(3)
    await watched.bench.strobe(dut.core_trap)
    assert watched.fault
    await watched.bench.strobe(dut.reply_start)
    assert watched.fault and int(dut.bites.value) == 3


@cocotb.test()
async def a_trap_resets_the_core_at_once(dut):
    watched = await Watched(dut).start()
    for bites in (1, 2, 3):
        await watched.bench.strobe(dut.core_trap)
        await watched.bench.clocks(5)
        assert int(dut.bites.value) == bites
    assert watched.fault


@cocotb.test()
async def a_firmware_that_reports_its_image_damaged_is_halted(dut):
    watched = await Watched(dut).start()
    await watched.bench.strobe(dut.halt)
    assert watched.fault
    await watched.bench.clocks(1)
    assert int(dut.core_rst.value), "the soft core stops one clock after the fault"


@cocotb.test()
async def an_invalid_address_is_a_fault_except_during_the_loopback_test(dut):
    watched = await Watched(dut, address_valid=0).start()
    assert watched.fault
    dut.sw_baud.value = LOOPBACK
    await watched.bench.strobe(dut.rst)
    assert not watched.fault and int(dut.loopback_open.value)
    await watched.bench.strobe(dut.loopback_close)
    assert watched.fault


@cocotb.test()
async def the_loopback_test_opens_only_for_its_switches_and_only_once(dut):
    watched = await Watched(dut).start()
    for bit in range(9):
        dut.sw_baud.value = LOOPBACK ^ 1 << bit
        await watched.bench.clocks()
        assert not int(dut.loopback_open.value)
    dut.sw_baud.value = LOOPBACK
    await watched.bench.clocks()
    assert int(dut.loopback_open.value)
    await watched.bench.strobe(dut.loopback_close)
    await watched.beats(2 * BITES_AT)
    assert not int(dut.loopback_open.value)
    await watched.bench.strobe(dut.rst)
    assert int(dut.loopback_open.value)


@cocotb.test()
async def a_character_is_foreign_unless_a_port_is_sending(dut):
    watched = await Watched(dut).start()
    dut.driven.value = 1
    await watched.bench.strobe(dut.start_seen)
    dut.driven.value = 0
    await watched.beats(2)
    assert not int(dut.loopback_heard.value)
    await watched.bench.strobe(dut.start_seen)
    dut.driven.value = 1
    await watched.beats(2 * BITES_AT)
    assert int(dut.loopback_heard.value), "until the next reset"
    await watched.bench.strobe(dut.rst)
    assert not int(dut.loopback_heard.value)


@pytest.mark.rule("WDG-1", "LED-5", "LOOP-1", "LINE-7")
def test_supervisor(sim):
    run("supervisor", "tb.rtl.test_supervisor", sim=sim)
