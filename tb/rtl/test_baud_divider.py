# SPDX-License-Identifier: Apache-2.0
"""baud_divider: one tick of 1/16 bit for every `ratio` base ticks, for each port separately."""

import cocotb
import pytest

from regs.generated.card_tables import EXTENDED_RATES, Rate
from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import cases, seeded

DRIVE = 12


@cocotb.test()
async def ticks_since_power_up_follow_the_count(dut):
    """There is no reset: the count starts at 0 at power-up. Base ticks are random."""
    rng = seeded("since power-up")
    rates = list(EXTENDED_RATES.values())
    bench = await Bench(dut, **levels(rates[0], tick_base=0)).start()
    await bench.clocks(3)
    base = 0
    for rate in rng.sample(rates, len(rates)) * cases(1, 4):
        for name, level in levels(rate).items():
            getattr(dut, name).value = level
        for _ in range(rng.randrange(100, 300) + 5 * rate.ratio):
            level = rng.randint(0, 1)
            dut.tick_base.value = level
            base += level
            await bench.clocks()
            for name, ratio in (("tick16_modbus", rate.ratio), ("tick16_drive", DRIVE)):
                assert int(getattr(dut, name).value) == (level and base % ratio == 0), f"{name}, {base}"


def levels(rate: Rate, **more: int) -> dict[str, int]:
    return {"modbus_undivided": rate.ratio == 1, "modbus_mask": rate.mask, **more}


@pytest.mark.rule("LINE-2", "LINE-4", "FC-1")
def test_baud_divider(sim):
    run("baud_divider", "tb.rtl.test_baud_divider", sim=sim)
