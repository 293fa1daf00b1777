# SPDX-License-Identifier: Apache-2.0
"""crc16_modbus: compared with the model bit by bit; shifts its CRC out; residue 0 after a good frame."""

import cocotb
import pytest

from tb.agents.crc16 import CHECK_INPUT, CHECK_VALUE, crc16, with_crc
from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import seeded


async def cleared(dut) -> Bench:
    bench = await Bench(dut, clear=0, bit_valid=0, bit_data=0).start()
    await bench.strobe(dut.clear)
    return bench


async def feed(bench: Bench, data: bytes) -> None:
    for byte in data:
        await bench.line_bits(byte)


async def shifted_out(dut, bench: Bench) -> int:
    """Shifts the CRC out; each bit is fed back as it is sent."""
    value = 0
    dut.bit_valid.value = 1
    for n in range(16):
        bit = int(dut.check_bit.value)
        dut.bit_data.value = bit
        value |= bit << n
        await bench.clocks()
    dut.bit_valid.value = 0
    return value


@cocotb.test()
async def crc_has_the_published_check_value(dut):
    bench = await cleared(dut)
    await feed(bench, CHECK_INPUT)
    assert await shifted_out(dut, bench) == CHECK_VALUE


@cocotb.test()
async def random_bytes_agree_with_the_model(dut):
    rng = seeded("frames")
    bench = await cleared(dut)
    for _ in range(40):
        data = rng.randbytes(rng.randint(1, 40))
        await feed(bench, data)
        # The value holds while there is no bit.
        dut.bit_data.value = rng.randint(0, 1)
        await bench.clocks(rng.randint(0, 3))
        assert await shifted_out(dut, bench) == crc16(data)
        assert dut.good.value == 1, "residue 0 after the CRC was shifted out"
        await bench.strobe(dut.clear)


@cocotb.test()
async def residue_is_zero_after_a_good_frame_and_never_after_a_damaged_one(dut):
    rng = seeded("frames")
    bench = await cleared(dut)
    for damage in (False, True) * 8:
        frame = bytearray(with_crc(rng.randbytes(rng.randint(2, 30))))
        if damage:
            frame[rng.randrange(len(frame))] ^= 1 << rng.randrange(8)
        await feed(bench, frame)
        assert dut.good.value == (not damage)
        await bench.strobe(dut.clear)


@cocotb.test()
async def clear_restarts_from_any_value(dut):
    bench = await cleared(dut)
    await feed(bench, b"\x77\x12")
    await bench.strobe(dut.clear)
    assert dut.good.value == 0
    await feed(bench, b"\x01")
    assert await shifted_out(dut, bench) == crc16(b"\x01")


@pytest.mark.rule("FRAME-4")
def test_crc16_modbus(sim):
    run("crc16_modbus", "tb.rtl.test_crc16_modbus", sim=sim)
