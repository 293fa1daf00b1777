# SPDX-License-Identifier: Apache-2.0
"""driver_limit: DE is off in reset without a clock, and off after the longest frame at every rate."""

from __future__ import annotations

import cocotb
import pytest
from cocotb.triggers import Timer

from regs.generated.card_tables import EXTENDED_RATES
from tb.lib.bench import Bench
from tb.lib.runner import run

UNITS_HZ = 1200  # of ticks
CLOCKS = 5  # a unit; far fewer than on the card
LONGEST_BITS = 375  # docs/guide/proofs.md, Ports
LIMIT_BEATS = (14, 15)
# Ratio of each rate's divider to its mask: 38400 / rate - 1.
MASKS = {rate.baud: max(0, 38_400 // rate.baud - 1) for rate in EXTENDED_RATES.values()}


class Driver:
    def __init__(self, dut, mask: int):
        self.dut = dut
        self.bench = Bench(dut, UNITS_HZ * CLOCKS, rst=0, ticks=0, mask=mask, driven=0)
        self.units = 0

    async def start(self) -> Driver:
        await self.bench.start()
        return self

    async def unit(self) -> int:
        """The time of a unit; returns DE at its end."""
        await self.bench.clocks(CLOCKS - 2)
        self.units += 1
        self.dut.ticks.value = self.units % 128
        await self.bench.clocks(2)
        return int(self.dut.de.value)

    async def on_for(self, most: int) -> int:
        """Units from the rise of the request to the fall of DE."""
        self.dut.driven.value = 1
        for count in range(most):
            if not await self.unit():
                return count + 1
        raise AssertionError(f"DE is still high after {most} units")


@cocotb.test()
@cocotb.parametrize(baud=tuple(MASKS))
async def a_request_that_does_not_end_is_cut_after_the_longest_frame(dut, baud):
    driver = await Driver(dut, MASKS[baud]).start()
    beat = MASKS[baud] + 1
    for phase in range(0, beat, max(1, beat // 4)):
        while driver.units % beat != phase:
            await driver.unit()
        units = await driver.on_for(16 * beat)
        least, most = (beats * beat for beats in LIMIT_BEATS)
        assert least <= units <= most, f"{units} units, {least} to {most} allowed"
        assert units / UNITS_HZ > LONGEST_BITS / baud, "the longest frame is not cut"
        # It stays off as long as the request lasts, and a new one gets the whole time again.
        for _ in range(2 * beat):
            assert not await driver.unit()
        dut.driven.value = 0
        await driver.unit()


@cocotb.test()
async def driver_follows_each_shorter_request_one_clock_later(dut):
    driver = await Driver(dut, 3).start()
    for length in (1, 2, 20, 55, 1):
        dut.driven.value = 1
        await Timer(1, unit="ns")
        assert not int(dut.de.value)
        await driver.bench.clocks()
        assert int(dut.de.value)
        for _ in range(length):
            assert await driver.unit()
        dut.driven.value = 0
        await Timer(1, unit="ns")
        assert int(dut.de.value)
        await driver.bench.clocks()
        assert not int(dut.de.value)


@cocotb.test()
async def reset_switches_off_without_a_clock(dut):
    driver = await Driver(dut, 3).start()
    dut.driven.value = 1
    await driver.unit()
    driver.bench.clock.stop()
    assert int(dut.de.value)
    dut.rst_n.value = 0
    await Timer(1, unit="ns")
    assert not int(dut.de.value)


@cocotb.test()
async def driver_stays_off_as_long_as_the_reset_is_asked_for(dut):
    driver = await Driver(dut, 3).start()
    dut.driven.value = 1
    await driver.unit()
    dut.rst.value = 1
    dut.rst_n.value = 0
    await Timer(1, unit="ns")
    dut.rst_n.value = 1
    for _ in range(3):
        assert not await driver.unit()
    dut.rst.value = 0
    assert await driver.unit()


@pytest.mark.rule("SAFE-2", "SAFE-6")
def test_driver_limit(sim):
    run("driver_limit", "tb.rtl.test_driver_limit", sim=sim)
