#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Turns a firmware image into a file for $readmemh, one little-endian 32-bit word a line.

The file fills the whole memory of the configuration, whose size in bytes stands in configs.toml.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from pathlib import Path

CONFIGS = Path(__file__).resolve().parents[1] / "configs.toml"


def words(image: bytes, size: int) -> list[str]:
    """The image as hex words, zeros behind it; `size` in bytes is a multiple of 4."""
    padded = image.ljust(size, b"\0")
    return [f"{int.from_bytes(padded[i : i + 4], 'little'):08x}" for i in range(0, size, 4)]


def main() -> int:
    configs = tomllib.loads(CONFIGS.read_text())
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--config", choices=sorted(configs), required=True)
    parser.add_argument("binary", type=Path)
    parser.add_argument("hex", type=Path)
    args = parser.parse_args()
    image, size = args.binary.read_bytes(), configs[args.config]["memory_bytes"]
    if len(image) > size:
        print(f"{args.binary}: {len(image)} bytes, but {args.config} has {size}", file=sys.stderr)
        return 1
    args.hex.parent.mkdir(parents=True, exist_ok=True)
    args.hex.write_text("\n".join(words(image, size)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
