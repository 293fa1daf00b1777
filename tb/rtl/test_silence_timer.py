# SPDX-License-Identifier: Apache-2.0
"""silence_timer: half a character and two limits, paused by activity, restarted by a character.

test_network_port.py and test_drive_port.py measure the limits from the pin.
"""

import cocotb
import pytest

from regs.generated.card_tables import SILENCE_START, SILENCES
from tb.lib.bench import Bench, Strobes
from tb.lib.runner import run

HALF = 14
SHORT, LONG = 3 * HALF, 7 * HALF
# Ticks from the vote on the stop bit to the end of the character as the port sees it; see the module.
ONE_STOP_TICKS = 2
TWO_STOP_TICKS = ONE_STOP_TICKS + 16


def half_end(ticks: int) -> int:
    return SILENCE_START + ticks - 1


class Timer:
    """The timer with tick16 held high: a clock is a tick."""

    def __init__(self, dut, two_stop: int = 0, **levels: int):
        inputs = {
            "tick16": 1,
            "restart": 0,
            "sending": 0,
            "busy": 0,
            "half_end": half_end(HALF),
            "half_uneven": 0,
        }
        self.dut = dut
        self.bench = Bench(dut, two_stop=two_stop, **{**inputs, **levels})
        self.half = Strobes(dut, "half_reached")
        self.short = Strobes(dut, "short_reached")
        self.long = Strobes(dut, "long_reached")

    async def start(self) -> "Timer":
        await self.bench.start()
        await self.restart()
        return self

    async def restart(self) -> None:
        """Restarts the timer, as after a received character."""
        self.dut.restart.value = 1
        await self.bench.clocks()
        self.dut.restart.value = 0
        self.begun_ps = self.bench.last_edge_ps()
        for strobes in (self.half, self.short, self.long):
            strobes.clear()

    def ticks(self, strobes: Strobes) -> list[int]:
        """Times of the strobes in ticks since the restart."""
        return [round((t - self.begun_ps) / self.bench.period_ps) for t in strobes.times_ps]


@cocotb.test()
@cocotb.parametrize(two_stop=(0, 1))
async def all_limits_are_reached_once_and_exactly(dut, two_stop):
    timer = await Timer(dut, two_stop).start()
    rest = TWO_STOP_TICKS if two_stop else ONE_STOP_TICKS
    await timer.bench.clocks(3 * LONG)
    assert timer.ticks(timer.half) == [HALF + rest]
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
async def activity_pauses_the_count(dut):
    timer = await Timer(dut).start()
    await timer.bench.clocks(10)
    dut.busy.value = 1
    await timer.bench.clocks(25)
    dut.busy.value = 0
    await timer.bench.clocks(2 * LONG)
    assert timer.ticks(timer.short) == [SHORT + ONE_STOP_TICKS + 25]
    assert timer.ticks(timer.long) == [LONG + ONE_STOP_TICKS + 25]


@cocotb.test()
@cocotb.parametrize(two_stop=(0, 1))
async def silence_counts_from_the_end_of_the_cards_own_reply(dut, two_stop):
    """DE falls with the last stop bit, so the count starts there in every format."""
    timer = await Timer(dut, two_stop).start()
    dut.sending.value = 1
    await timer.bench.clocks(2 * LONG)
    assert len(timer.long) == 0 and dut.long_silent.value == 0
    dut.sending.value = 0
    timer.begun_ps = timer.bench.last_edge_ps()
    await timer.bench.clocks(2 * LONG)
    ticks = [timer.ticks(strobes) for strobes in (timer.half, timer.short, timer.long)]
    assert ticks == [[HALF], [SHORT], [LONG]]


@cocotb.test()
@cocotb.parametrize(line=list(SILENCES))
async def limits_of_every_rate_match_the_table(dut, line):
    """1.5 and 3.5 characters of 11 or 10 bits, above 19200 bit/s 750 and 1750 us, to two ticks."""
    silences = SILENCES[line]
    levels = {"half_end": half_end(silences.half_ticks), "half_uneven": silences.half_uneven}
    timer = await Timer(dut, 1, **levels).start()
    await timer.bench.clocks(silences.t35_ticks + 100)
    for strobes, limit in ((timer.short, silences.t15_ticks), (timer.long, silences.t35_ticks)):
        (ticks,) = timer.ticks(strobes)
        assert abs(ticks - TWO_STOP_TICKS - limit) <= 2


@pytest.mark.rule("FRAME-1", "FC-8")
def test_silence_timer(sim):
    run("silence_timer", "tb.rtl.test_silence_timer", sim=sim)
