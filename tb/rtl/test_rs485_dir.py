# SPDX-License-Identifier: Apache-2.0
"""rs485_dir: the driver is on a quarter bit before the first start bit and off with the last stop bit."""

from __future__ import annotations

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import seeded

LEAD = 4  # ticks


class Direction:
    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, tick16=0, request=0, tx_busy=0)

    async def start(self) -> Direction:
        await self.bench.start()
        return self

    async def clock(self, tick: int = 0) -> tuple[int, int]:
        """Waits one clock; returns (de, ready) after it."""
        self.dut.tick16.value = tick
        await self.bench.clocks()
        return int(self.dut.de.value), int(self.dut.ready.value)

    async def ticks(self, count: int, clocks_each: int = 5) -> list[tuple[int, int]]:
        """Waits `count` ticks; returns (de, ready) after each."""
        after = []
        for _ in range(count):
            for _ in range(clocks_each - 1):
                await self.clock()
            after.append(await self.clock(tick=1))
        return after


@cocotb.test()
async def reset_switches_the_driver_off_at_once(dut):
    line = await Direction(dut).start()
    dut.request.value = dut.tx_busy.value = 1
    await line.ticks(LEAD + 3)
    dut.rst.value = 1
    assert await line.clock() == (0, 0)
    assert set(await line.ticks(10)) == {(0, 0)}
    dut.request.value = dut.tx_busy.value = dut.rst.value = 0
    assert set(await line.ticks(10)) == {(0, 0)}


@cocotb.test()
async def the_driver_is_on_exactly_while_requested_or_still_sending(dut):
    rng = seeded("requests")
    line = await Direction(dut).start()
    de = request = busy = ticks = 0
    for _ in range(3000):
        request = rng.randint(0, 1) if rng.random() < 0.1 else request
        busy = rng.randint(0, 1) if rng.random() < 0.1 else busy
        tick = rng.randint(0, 1)
        dut.request.value, dut.tx_busy.value = request, busy
        ticks = ticks + tick if de else 0
        expected = int(request or (de and busy))
        de, ready = await line.clock(tick)
        assert de == expected
        assert ready == (ticks >= LEAD)


@pytest.mark.rule("LINE-6", "FC-10", "SAFE-2")
def test_rs485_dir(sim):
    run("rs485_dir", "tb.rtl.test_rs485_dir", sim=sim)
