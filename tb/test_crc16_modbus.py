# SPDX-License-Identifier: Apache-2.0
"""crc16_modbus: against the model, byte by byte; residue 0 after an undamaged frame."""

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import seeded
from tb.model.crc16 import CHECK_INPUT, CHECK_VALUE, crc16, crc16_step, with_crc


async def cleared(dut) -> Bench:
    bench = await Bench(dut, clear=1, byte_valid=0, byte_data=0).start()
    await bench.clocks()
    dut.clear.value = 0
    return bench


async def feed(dut, bench: Bench, data: bytes) -> int:
    """One byte a clock; the value after the last one."""
    dut.byte_valid.value = 1
    for byte in data:
        dut.byte_data.value = byte
        await bench.clocks()
    dut.byte_valid.value = 0
    return dut.crc.value.to_unsigned()


@cocotb.test()
async def published_check_value(dut):
    bench = await cleared(dut)
    assert await feed(dut, bench, CHECK_INPUT) == CHECK_VALUE


@cocotb.test()
async def random_bytes_agree_with_the_model_at_every_step(dut):
    rng = seeded("frames")
    bench = await cleared(dut)
    for _ in range(20):
        value = 0xFFFF
        for byte in rng.randbytes(rng.randint(1, 40)):
            value = crc16_step(value, byte)
            assert await feed(dut, bench, bytes([byte])) == value
        dut.clear.value = 1
        await bench.clocks()
        dut.clear.value = 0
        assert dut.crc.value == 0xFFFF


@cocotb.test()
async def residue_is_zero_after_a_good_frame_and_never_after_a_spoilt_one(dut):
    rng = seeded("frames")
    bench = await cleared(dut)
    for spoil in (False, True) * 8:
        frame = bytearray(with_crc(rng.randbytes(rng.randint(2, 30))))
        if spoil:
            frame[rng.randrange(len(frame))] ^= 1 << rng.randrange(8)
        await feed(dut, bench, frame)
        assert dut.good.value == (not spoil)
        dut.clear.value = 1
        await bench.clocks()
        dut.clear.value = 0


@cocotb.test()
async def byte_in_the_clock_of_a_clear_is_the_first_of_the_frame(dut):
    """The receiver holds clear while no frame is under way."""
    bench = await cleared(dut)
    dut.clear.value = 1
    await bench.clocks(3)
    assert await feed(dut, bench, b"\x01") == crc16(b"\x01")


@pytest.mark.rule("FRAME-4")
def test_crc16_modbus(sim):
    run("crc16_modbus", "tb.test_crc16_modbus", sim=sim)
