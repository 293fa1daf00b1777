# SPDX-License-Identifier: Apache-2.0
"""Turns a firmware image into a file for $readmemh, one little-endian word on each line.

A word has 36 bits, written as nine digits: above each byte is its even parity bit, as in rtl/firmware_ram.v.
The file fills the whole memory, whose size in bytes is an argument.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

LANE_BITS = 9  # a byte and its parity
WORD_BITS = 4 * LANE_BITS


def with_parity(word: int) -> int:
    """A 32-bit word with its parity bits, as stored in the memory."""
    lanes = ((byte.bit_count() & 1) << 8 | byte for byte in word.to_bytes(4, "little"))
    return sum(lane << LANE_BITS * n for n, lane in enumerate(lanes))


def without_parity(word: int) -> int:
    """The 32 bits of a word of the memory, without its parity bits."""
    return sum((word >> LANE_BITS * n & 0xFF) << 8 * n for n in range(4))


def hex_line(word: int) -> str:
    """The line of the file for a word of the memory."""
    return f"{word:0{WORD_BITS // 4}x}\n"


def words(image: bytes, size: int) -> list[int]:
    """The content of the memory: the image, then zeros. `size` is in bytes, a multiple of 4."""
    padded = image.ljust(size, b"\0")
    return [with_parity(int.from_bytes(padded[i : i + 4], "little")) for i in range(0, size, 4)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bytes", type=int, required=True, help="of the memory, a multiple of 4")
    parser.add_argument("binary", type=Path)
    parser.add_argument("hex", type=Path)
    args = parser.parse_args()
    image, size = args.binary.read_bytes(), args.bytes
    if len(image) > size:
        print(f"{args.binary}: {len(image)} bytes, but the memory has {size}", file=sys.stderr)
        return 1
    args.hex.parent.mkdir(parents=True, exist_ok=True)
    args.hex.write_text("".join(map(hex_line, words(image, size))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
