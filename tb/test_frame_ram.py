# SPDX-License-Identifier: Apache-2.0
"""frame_ram: 256 bytes, zero at power-up, read a clock later, both ports at once."""

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import seeded


@cocotb.test()
async def power_up_finds_zeros_then_every_byte_keeps_its_own(dut):
    bench = await Bench(dut, write_enable=0, write_addr=0, write_data=0, read_addr=0).start()
    rng = seeded("memory")
    kept = [0] * 256
    for addr in range(256):
        dut.read_addr.value = addr
        await bench.clocks()
        assert int(dut.read_data.value) == 0
    for _ in range(3000):
        write, read = rng.randrange(256), rng.randrange(256)
        value, enable = rng.getrandbits(8), rng.randint(0, 1)
        if write == read:
            continue  # nobody reads what is being written
        dut.write_enable.value, dut.write_addr.value, dut.write_data.value = enable, write, value
        dut.read_addr.value = read
        await bench.clocks()
        assert int(dut.read_data.value) == kept[read]
        if enable:
            kept[write] = value


@pytest.mark.rule("FRAME-5")
def test_frame_ram(sim):
    run("frame_ram", "tb.test_frame_ram", sim=sim)
