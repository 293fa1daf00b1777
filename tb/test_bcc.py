# SPDX-License-Identifier: Apache-2.0
"""bcc: the exclusive or of all bytes since the clearing, against the model."""

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import seeded
from tb.model import fc_telegram


class Check:
    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, clear=1, byte_valid=0, byte_data=0)

    async def start(self) -> "Check":
        await self.bench.start()
        return self

    async def clock(self, byte: int | None = None, clear: int = 0) -> int:
        """One clock, with or without a byte; returns the value after it."""
        self.dut.clear.value = clear
        self.dut.byte_valid.value = int(byte is not None)
        self.dut.byte_data.value = 0xA5 if byte is None else byte
        await self.bench.clocks()
        return self.dut.value.value.to_unsigned()


@cocotb.test()
async def after_each_byte_the_value_is_what_the_bcc_has_to_be(dut):
    rng = seeded("telegrams")
    check = await Check(dut).start()
    for length in (4, 12, 28, 251):
        telegram = fc_telegram.build(rng.randbytes(length))
        await check.clock(clear=1)
        for n, byte in enumerate(telegram, 1):
            assert await check.clock(byte) == fc_telegram.bcc(telegram[:n])
            for _ in range(rng.randint(0, 3)):
                await check.clock()
        assert check.dut.value.value.to_unsigned() == 0, "BCC included it comes out as 0"


@cocotb.test()
async def without_a_byte_the_value_stays(dut):
    check = await Check(dut).start()
    await check.clock(clear=1)
    assert await check.clock(0x02) == 0x02
    assert [await check.clock() for _ in range(5)] == [0x02] * 5


@cocotb.test()
async def clear_held_before_a_telegram_does_not_swallow_its_first_byte(dut):
    check = await Check(dut).start()
    await check.clock(0x77)
    assert await check.clock(clear=1) == 0
    assert await check.clock(0x02, clear=1) == 0x02
    assert await check.clock(0x06) == 0x04


@pytest.mark.rule("FC-1")
def test_bcc(sim):
    run("bcc", "tb.test_bcc", sim=sim)
