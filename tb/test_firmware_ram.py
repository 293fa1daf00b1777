# SPDX-License-Identifier: Apache-2.0
"""firmware_ram: holds the image it was given, takes byte writes, answers a clock later and only then."""

import os
from pathlib import Path

import cocotb
import pytest

from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import seeded

WORDS = int(os.environ.get("WORDS", 48))  # not a power of two


def image(words: int = WORDS) -> list[int]:
    return [(0x01000193 * (n + 1) ^ 0x811C9DC5) & 0xFFFFFFFF for n in range(words)]


def write_image(path: Path, words: int = WORDS) -> None:
    path.write_text("".join(f"{word:08x}\n" for word in image(words)))


class Memory:
    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, enable=0, word=0, wdata=0, wstrb=0)

    async def access(self, word: int, data: int = 0, strobes: int = 0) -> int:
        dut = self.dut
        dut.word.value, dut.wdata.value, dut.wstrb.value = word, data, strobes
        dut.enable.value = 1
        await self.bench.clocks()
        read = dut.rdata.value.to_unsigned() if not strobes else 0
        dut.enable.value = dut.wstrb.value = 0
        await self.bench.clocks()
        assert dut.rdata.value.to_unsigned() == 0, "what nobody asked for"
        return read


@cocotb.test()
async def the_image_is_there_and_byte_writes_change_their_bytes_only(dut):
    memory = Memory(dut)
    await memory.bench.start()
    kept = image()
    for n, word in enumerate(kept):
        assert await memory.access(n) == word
    rng = seeded("writes")
    for _ in range(400):
        n, data, strobes = rng.randrange(WORDS), rng.getrandbits(32), rng.randrange(16)
        await memory.access(n, data, strobes)
        mask = sum(0xFF << 8 * lane for lane in range(4) if strobes >> lane & 1)
        kept[n] = kept[n] & ~mask | data & mask
        n = rng.randrange(WORDS)
        assert await memory.access(n) == kept[n]


@pytest.mark.rule("TOP-1", "TOP-2")
def test_firmware_ram(sim, tmp_path):
    hex_file: Path = tmp_path / "image.hex"
    write_image(hex_file)
    run(
        "firmware_ram",
        "tb.test_firmware_ram",
        sim=sim,
        parameters={"BYTES": 4 * WORDS, "FIRMWARE_HEX": str(hex_file)},
    )
