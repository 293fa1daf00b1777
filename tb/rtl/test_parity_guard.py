# SPDX-License-Identifier: Apache-2.0
"""parity_guard: each single flip in the register or in its parity shows until the next load."""

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import seeded

WIDTH = 12


class Guarded:
    """The guard with the register that it guards."""

    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, load=0, next=0, value=0)

    async def start(self) -> "Guarded":
        await self.bench.start()
        return self

    async def load(self, value: int) -> None:
        self.dut.next.value = value
        await self.bench.strobe(self.dut.load)
        self.dut.value.value = value
        await self.bench.clocks()

    async def damaged(self) -> bool:
        await self.bench.clocks()
        return bool(int(self.dut.damaged.value))


@cocotb.test()
async def an_intact_register_is_never_damaged(dut):
    rng = seeded("values")
    guarded = await Guarded(dut).start()
    assert not await guarded.damaged(), "at power-up"
    for value in (0, 1, (1 << WIDTH) - 1, *(rng.getrandbits(WIDTH) for _ in range(50))):
        await guarded.load(value)
        dut.next.value = value ^ 1
        await guarded.bench.clocks(rng.randint(0, 3))
        assert not await guarded.damaged(), "without a load nothing changes"


@cocotb.test()
async def a_flip_of_any_bit_is_seen_until_the_next_load(dut):
    rng = seeded("values")
    guarded = await Guarded(dut).start()
    for bit in range(WIDTH):
        value = rng.getrandbits(WIDTH)
        await guarded.load(value)
        dut.value.value = value ^ 1 << bit
        assert await guarded.damaged(), f"bit {bit}"
        await guarded.bench.clocks(5)
        assert await guarded.damaged(), f"bit {bit} later"
        await guarded.load(value)
        assert not await guarded.damaged()


@cocotb.test()
async def a_flip_of_the_parity_is_seen_until_the_next_load(dut):
    guarded = await Guarded(dut).start()
    for value in (0, 1):
        await guarded.load(value)
        dut.odd.value = 1 - value
        assert await guarded.damaged()
        await guarded.load(value)
        assert not await guarded.damaged()


@pytest.mark.rule("SAFE-4")
def test_parity_guard(sim):
    run("parity_guard", "tb.rtl.test_parity_guard", sim=sim, parameters={"WIDTH": WIDTH})
