# SPDX-License-Identifier: Apache-2.0
"""silence_timer: two limits counted in ticks, stopped by activity, cleared by a character.

The limits as seen from the pin are measured in test_network_port.py and test_drive_port.py.
"""

import cocotb
import pytest

from tb.lib.bench import Bench, Strobes
from tb.lib.runner import run

SHORT, LONG = 40, 100
# From the vote on the stop bit to the line's end of character as the port sees it; see the module.
ONE_STOP_TICKS = 2
TWO_STOP_TICKS = ONE_STOP_TICKS + 16


class Timer:
    """The timer with tick16 held high: a clock is a tick."""

    def __init__(self, dut, two_stop: int = 0, **levels: int):
        inputs = {
            "tick16": 1,
            "restart": 0,
            "sending": 0,
            "busy": 0,
            "short_ticks": SHORT,
            "long_ticks": LONG,
        }
        self.dut = dut
        self.bench = Bench(dut, two_stop=two_stop, **{**inputs, **levels})
        self.short = Strobes(dut, "short_reached")
        self.long = Strobes(dut, "long_reached")

    async def start(self) -> "Timer":
        await self.bench.start()
        await self.restart()
        return self

    async def restart(self) -> None:
        """A character has just been received."""
        self.dut.restart.value = 1
        await self.bench.clocks()
        self.dut.restart.value = 0
        self.begun_ps = self.bench.last_edge_ps()
        self.short.clear()
        self.long.clear()

    def ticks(self, strobes: Strobes) -> list[int]:
        """When the strobes came, in ticks since the restart."""
        return [round((t - self.begun_ps) / self.bench.period_ps) for t in strobes.times_ps]


@cocotb.test()
@cocotb.parametrize(two_stop=(0, 1))
async def both_limits_are_reached_once_and_exactly(dut, two_stop):
    timer = await Timer(dut, two_stop).start()
    rest = TWO_STOP_TICKS if two_stop else ONE_STOP_TICKS
    await timer.bench.clocks(3 * LONG)
    assert timer.ticks(timer.short) == [SHORT + rest]
    assert timer.ticks(timer.long) == [LONG + rest]


@cocotb.test()
async def silence_is_a_level_until_the_next_character(dut):
    timer = await Timer(dut).start()
    await timer.bench.clocks(LONG)
    assert dut.long_silent.value == 0
    await timer.bench.clocks(LONG)
    assert dut.long_silent.value == 1
    await timer.restart()
    assert dut.long_silent.value == 0


@cocotb.test()
async def activity_stops_the_count_for_as_long_as_it_lasts(dut):
    timer = await Timer(dut).start()
    await timer.bench.clocks(10)
    dut.busy.value = 1
    await timer.bench.clocks(25)
    dut.busy.value = 0
    await timer.bench.clocks(2 * LONG)
    assert timer.ticks(timer.short) == [SHORT + ONE_STOP_TICKS + 25]
    assert timer.ticks(timer.long) == [LONG + ONE_STOP_TICKS + 25]


@cocotb.test()
async def character_just_before_a_limit_starts_the_count_again(dut):
    timer = await Timer(dut).start()
    await timer.bench.clocks(SHORT)
    await timer.restart()
    await timer.bench.clocks(SHORT)
    assert len(timer.short) == 0
    await timer.bench.clocks(5)
    assert timer.ticks(timer.short) == [SHORT + ONE_STOP_TICKS]


@cocotb.test()
async def held_restart_reaches_nothing(dut):
    timer = await Timer(dut).start()
    dut.restart.value = 1
    await timer.bench.clocks(3 * LONG)
    assert len(timer.short) == 0 and len(timer.long) == 0 and dut.long_silent.value == 0


@cocotb.test()
@cocotb.parametrize(two_stop=(0, 1))
async def after_the_card_s_own_sending_the_silence_counts_from_its_very_end(dut, two_stop):
    """DE falls with the last stop bit, so nothing of a character is left, whatever the format."""
    timer = await Timer(dut, two_stop).start()
    dut.sending.value = 1
    await timer.bench.clocks(2 * LONG)
    assert len(timer.long) == 0 and dut.long_silent.value == 0
    dut.sending.value = 0
    timer.begun_ps = timer.bench.last_edge_ps()
    await timer.bench.clocks(2 * LONG)
    assert timer.ticks(timer.short) == [SHORT] and timer.ticks(timer.long) == [LONG]


@cocotb.test()
async def limits_up_to_those_of_the_fastest_rate_fit(dut):
    """t3.5 of 115200 bit/s is 1750 us: 3226 ticks."""
    timer = await Timer(dut, 1, short_ticks=1383, long_ticks=3226).start()
    await timer.bench.clocks(3300)
    assert timer.ticks(timer.short) == [1383 + TWO_STOP_TICKS]
    assert timer.ticks(timer.long) == [3226 + TWO_STOP_TICKS]


@pytest.mark.rule("FRAME-1", "FC-8")
def test_silence_timer(sim):
    run("silence_timer", "tb.test_silence_timer", sim=sim)
