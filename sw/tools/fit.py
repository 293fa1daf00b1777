# SPDX-License-Identifier: Apache-2.0
"""Bytes that each dialect and each option needs on the small card: the table of docs/guide/dialects.md.

    python -m sw.tools.fit

Each is linked for a larger memory: code, constants and variables, then the stack and the frames.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib

from regs.dialects import DEFAULT, DIALECTS, OPTIONS
from rtl.command import run_main
from rtl.sources import ROOT
from sw.tools.stack import reserved

CONFIG = "tiny"
SHOWN = {name: f"dialect `{name}`" for name in DIALECTS} | {
    name: f"`{DEFAULT}` with {name}" for name, option in OPTIONS.items() if not option.small
}


def number(path: str, pattern: str) -> int:
    return int(re.search(pattern, (ROOT / path).read_text(), re.MULTILINE)[1])


def needed(name: str) -> int:
    """Bytes of memory, stack and frames included."""
    elf = f"build/fit/{name}/firmware.elf"
    make = ["make", "-s", "-f", "sw/firmware.mk", f"FIRMWARE_PYTHON={sys.executable}", elf]
    subprocess.run(make, cwd=ROOT, check=True)
    symbols = subprocess.run(
        ["riscv64-unknown-elf-nm", elf], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    end = int(re.search(r"^(\w+) \w _bss_end$", symbols, re.MULTILINE)[1], 16)
    frames = number("regs/generated/frames.ld", r"FRAMES_BYTES = (\d+)")
    return end + reserved() + frames


def table() -> list[str]:
    """Rows of Markdown: what, its bytes, and the bytes that are left or missing."""
    memory = tomllib.loads((ROOT / "configs.toml").read_text())[CONFIG]["memory_bytes"]
    rows = [f"| on `{CONFIG}` | bytes of {memory} | |", "|---|---:|---|"]
    for name, shown in SHOWN.items():
        size = needed(name)
        fits = f"fits, {memory - size} left" if size <= memory else f"{size - memory} too many"
        rows.append(f"| {shown} | {size} | {fits} |")
    return rows


def main() -> int:
    print("\n".join(table()))
    return 0


if __name__ == "__main__":
    run_main("fit", main)
