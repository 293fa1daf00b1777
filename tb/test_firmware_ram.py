# SPDX-License-Identifier: Apache-2.0
"""firmware_ram: holds the image it was given, takes byte writes, answers a clock later."""

from pathlib import Path

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import seeded

WORDS = 48  # not a power of two


def image() -> list[int]:
    return [(0x01000193 * (n + 1) ^ 0x811C9DC5) & 0xFFFFFFFF for n in range(WORDS)]


class Memory:
    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, bus_valid=0, bus_addr=0, bus_wdata=0, bus_wstrb=0)

    async def access(self, addr: int, data: int = 0, strobes: int = 0) -> int:
        dut = self.dut
        dut.bus_addr.value, dut.bus_wdata.value, dut.bus_wstrb.value = addr, data, strobes
        dut.bus_valid.value = 1
        assert not int(dut.bus_ready.value)
        await self.bench.clocks()
        assert int(dut.bus_ready.value)
        word = dut.bus_rdata.value.to_unsigned() if not strobes else 0
        dut.bus_valid.value = 0
        await self.bench.clocks()
        return word


@cocotb.test()
async def the_image_is_there_and_byte_writes_change_their_bytes_only(dut):
    memory = Memory(dut)
    await memory.bench.start()
    kept = image()
    for n, word in enumerate(kept):
        assert await memory.access(4 * n) == word
    rng = seeded("writes")
    for _ in range(400):
        n, data, strobes = rng.randrange(WORDS), rng.getrandbits(32), rng.randrange(16)
        await memory.access(4 * n, data, strobes)
        mask = sum(0xFF << 8 * lane for lane in range(4) if strobes >> lane & 1)
        kept[n] = kept[n] & ~mask | data & mask
        n = rng.randrange(WORDS)
        assert await memory.access(4 * n) == kept[n]


@pytest.mark.rule("TOP-1", "TOP-2")
def test_firmware_ram(sim, tmp_path):
    hex_file: Path = tmp_path / "image.hex"
    hex_file.write_text("".join(f"{word:08x}\n" for word in image()))
    run(
        "firmware_ram",
        "tb.test_firmware_ram",
        sim=sim,
        parameters={"BYTES": 4 * WORDS, "FIRMWARE_HEX": str(hex_file)},
    )
