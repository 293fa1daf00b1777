# SPDX-License-Identifier: Apache-2.0
"""bcc: the exclusive or of all bytes since the last clear, against the model."""

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import seeded
from tb.model import fc_telegram


class Check:
    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, clear=0, bit_valid=0, bit_data=0)

    async def start(self) -> "Check":
        await self.bench.start()
        await self.clear()
        return self

    async def clear(self) -> None:
        await self.bench.strobe(self.dut.clear)

    async def feed(self, data: bytes) -> None:
        for byte in data:
            await self.bench.line_bits(byte)

    @property
    def good(self) -> bool:
        return bool(int(self.dut.good.value))


@cocotb.test()
async def bcc_agrees_with_the_model_after_any_number_of_bytes(dut):
    rng = seeded("telegrams")
    check = await Check(dut).start()
    for length in (4, 12, 28, 251):
        telegram = fc_telegram.build(rng.randbytes(length))
        for end in (1, 2, rng.randrange(3, len(telegram)), len(telegram) - 1):
            await check.clear()
            await check.feed(telegram[:end])
            # The value holds while there is no bit.
            dut.bit_data.value = rng.randint(0, 1)
            await check.bench.clocks(rng.randint(0, 3))
            bcc = fc_telegram.bcc(telegram[:end])
            assert check.good == (bcc == 0)
            for last in (bcc ^ 1 << rng.randrange(8), bcc):
                await check.feed(bytes([last]))
                assert check.good == (last == bcc)
                await check.feed(bytes([last]))


@pytest.mark.rule("FC-1")
def test_bcc(sim):
    run("bcc", "tb.rtl.test_bcc", sim=sim)
