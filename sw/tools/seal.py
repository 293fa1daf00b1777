# SPDX-License-Identifier: Apache-2.0
"""Writes the check sums into the last eight bytes of a firmware image.

sw/src/image.c computes the same sums over the image before them: the sum of its 32-bit words, and the sum of
all intermediate sums, both modulo 2^32, little-endian (docs/hardening.md, Firmware image check).
"""

from __future__ import annotations

import argparse
import struct
import sys
from itertools import accumulate
from pathlib import Path

SUMS = struct.Struct("<2I")


def seal(image: bytes) -> bytes:
    """The image with the sums in its last eight bytes."""
    words = struct.unpack(f"<{len(image) // 4 - 2}I", image[: -SUMS.size])
    running = list(accumulate(words))
    return image[: -SUMS.size] + SUMS.pack(running[-1] % 2**32, sum(running) % 2**32)


def adds_up(memory: list[int]) -> bool:
    """True if the words of a memory are a sealed image, followed by zeros only."""
    last = max((at for at, word in enumerate(memory, 1) if word), default=0)
    packed = struct.pack(f"<{len(memory)}I", *memory)
    # A sum may be zero, so it does not show where the image ends.
    ends = [end for end in range(last, last + 3) if 3 <= end <= len(memory)]
    return last > 0 and any(seal(packed[: 4 * end]) == packed[: 4 * end] for end in ends)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("unsealed", type=Path)
    parser.add_argument("sealed", type=Path)
    args = parser.parse_args()
    image = args.unsealed.read_bytes()
    if len(image) % 4 or len(image) <= SUMS.size:
        print(
            f"{args.unsealed}: {len(image)} bytes; expected whole words with room for sums", file=sys.stderr
        )
        return 1
    args.sealed.write_bytes(seal(image))
    return 0


if __name__ == "__main__":
    sys.exit(main())
