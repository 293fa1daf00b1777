# SPDX-License-Identifier: Apache-2.0
"""switch_sampler: reads both DIP switches once after reset; marks valid addresses."""

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run

SETTLE_CLOCKS = 20


async def sample(dut, bench: Bench, baud: int, addr: int) -> None:
    """Resets with these switches and waits until the card has read them."""
    dut.sw_baud.value, dut.sw_addr.value = baud, addr
    await bench.strobe(dut.rst)
    await bench.clocks(SETTLE_CLOCKS)
    assert not int(dut.ready.value)
    await bench.strobe(dut.settled)
    assert int(dut.ready.value)
    await bench.clocks()


async def running(dut) -> Bench:
    return await Bench(dut, settled=0, sw_baud=0, sw_addr=0).start()


@cocotb.test()
async def every_switch_sets_its_own_bit(dut):
    bench = await running(dut)
    for n in range(9):
        await sample(dut, bench, 1 << n, 1 << n & 0xFF)
        assert int(dut.baud.value) == 1 << n and int(dut.addr.value) == 1 << n & 0xFF


@cocotb.test()
async def switches_that_move_later_are_ignored_until_the_next_reset(dut):
    bench = await running(dut)
    await sample(dut, bench, 0b0_0001_0111, 17)
    for moved in (200, 201):  # both parities
        dut.sw_baud.value, dut.sw_addr.value = 0b1_1110_1000, moved
        await bench.clocks(50)
        assert int(dut.baud.value) == 0b0_0001_0111 and int(dut.addr.value) == 17
        assert int(dut.addr_valid.value) == 1
    await sample(dut, bench, 0b1_1110_1000, 200)
    assert int(dut.baud.value) == 0b1_1110_1000 and int(dut.addr.value) == 200


@cocotb.test()
async def switches_may_settle_until_the_last_moment(dut):
    bench = await running(dut)
    await bench.clocks(1000)
    assert not int(dut.ready.value)
    dut.sw_baud.value, dut.sw_addr.value = 0b101, 0x2A
    await bench.clocks(2)
    dut.sw_baud.value, dut.sw_addr.value = 0b010, 0x15
    await bench.strobe(dut.settled)
    assert int(dut.ready.value) and int(dut.baud.value) == 0b101 and int(dut.addr.value) == 0x2A
    await bench.clocks(100)
    assert int(dut.ready.value) and int(dut.baud.value) == 0b101 and int(dut.addr.value) == 0x2A


@cocotb.test()
async def addresses_1_to_247_are_valid(dut):
    bench = await running(dut)
    for addr in range(256):
        await sample(dut, bench, 0, addr)
        assert int(dut.addr_valid.value) == (1 <= addr <= 247), addr


@pytest.mark.rule("LINE-7", "LINE-8")
def test_switch_sampler(sim):
    run("switch_sampler", "tb.rtl.test_switch_sampler", sim=sim)
