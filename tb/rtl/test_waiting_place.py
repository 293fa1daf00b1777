# SPDX-License-Identifier: Apache-2.0
"""waiting_place: a licence stays until it is taken, a newer one comes, or a reset."""

from __future__ import annotations

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import seeded

INPUTS = ["fill", "writes_coils", "take"]


class Place:
    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, **dict.fromkeys(INPUTS, 0))

    async def start(self) -> Place:
        await self.bench.start()
        return self

    async def clock(self, **levels: int) -> None:
        for name in INPUTS:
            getattr(self.dut, name).value = levels.get(name, 0)
        await self.bench.clocks()

    @property
    def holds(self) -> tuple[int, int]:
        valid = int(self.dut.valid.value)
        return valid, valid and int(self.dut.control.value)


@cocotb.test()
async def it_holds_the_newest_licence_until_it_is_taken(dut):
    rng = seeded("licences")
    place = await Place(dut).start()
    expected = (0, 0)
    seen = set()
    for _ in range(400):
        now = {name: rng.randint(0, 1) for name in INPUTS} | {"take": int(rng.random() < 0.2)}
        now["fill"] &= int(rng.random() < 0.5)
        await place.clock(**now)
        if now["fill"]:
            expected = (1, now["writes_coils"])
        elif now["take"]:
            expected = (0, 0)
        assert place.holds == expected
        seen.add((expected, now["fill"], now["take"]))
    assert len(seen) == 8


@cocotb.test()
async def a_reset_empties_it(dut):
    place = await Place(dut).start()
    await place.clock(fill=1, writes_coils=1)
    await place.clock()
    assert place.holds == (1, 1)
    await place.bench.strobe(dut.rst)
    assert place.holds == (0, 0)


@cocotb.test()
@cocotb.parametrize(half=["held", "opposite"], full=[0, 1])
async def a_flipped_half_makes_no_licence(dut, half, full):
    place = await Place(dut).start()
    await place.clock(fill=full, writes_coils=1)
    bit = getattr(dut.valid_i, half)
    bit.value = 1 - int(bit.value)
    await Timer(1, unit="ps")
    assert place.holds == (0, 0) and int(dut.fault.value)
    await place.bench.strobe(dut.rst)
    assert not int(dut.fault.value)
    await place.clock(fill=1)
    assert place.holds == (1, 0), "after the reset it is as good as new"


@pytest.mark.rule("FRAME-7", "SAFE-4")
def test_waiting_place(sim):
    run("waiting_place", "tb.rtl.test_waiting_place", sim=sim)
