# SPDX-License-Identifier: Apache-2.0
"""Reads the card with other people's tools: Yosys's flows for other parts, and slang.

    python -m constraints.portability

Compares the memories of each flow with constraints/portability.toml, and the guarded bits after each flow
that merges flip-flops with those of the Verilog. Prints one line for each tool; exit 1 if one disagrees.
No part is placed: the flows show that they read the Verilog, and that memories stay memories.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from collections import Counter
from pathlib import Path

from constraints.flow import OPEN_HALVES, SynthError, sandboxed, yosys
from rtl.command import run_main
from rtl.sources import ROOT, card_files, configurations, needed_files

LISTS = ROOT / "constraints/portability.toml"
BUILD = ROOT / "build/portability"
TOP = "rtu2fc"
# The smallest memory, the core's registers, has 1024 bits; the rest of the card has some 900 flip-flops.
MOST_FLIP_FLOPS = 1000
MEMORY_CELL = re.compile(r"RAM|M10K|MLAB|^DP|^SP|^SDP|SC16K")
FLIP_FLOP_CELL = re.compile(r"FD[A-Z1]|DFF|SB_DFF|TRELLIS_FF|MISTRAL_FF|CC_DFF|EFX_FF|SLE$")


def lists() -> dict:
    return tomllib.loads(LISTS.read_text())


# ---------------------------------------------------------------- memories


def cells(flow: str, command: str) -> dict[str, int]:
    """Number of cells of a flow by type, of the whole card; one core, for the second is the same module."""
    where = f"{BUILD.relative_to(ROOT)}/{flow}.stat"
    image = sandboxed(ROOT / configurations()["standard"]["firmware_hex"])
    script = f"""read_verilog -defer {" ".join(map(sandboxed, card_files()))}
chparam -set LOCKSTEP 0 -set FIRMWARE_HEX "{image}" {TOP}
{command} -top {TOP}
tee -q -o {where} stat -json
"""
    yosys(BUILD, flow, script)
    return json.loads((ROOT / where).read_text())["design"]["num_cells_by_type"]


def compare_cells(flow: str, found: dict[str, int], wanted: dict[str, int]) -> list[str]:
    """One line if the memories are others than `wanted`, and one if a memory is made of flip-flops."""
    there = memories(found)
    wrong = [] if there == wanted else [f"{flow}: {there}, but constraints/portability.toml has {wanted}"]
    if (count := flip_flops(found)) >= MOST_FLIP_FLOPS:
        wrong.append(f"{flow}: {count} flip-flops, so a memory is made of them")
    return wrong


def memories(found: dict[str, int]) -> dict[str, int]:
    return {cell: count for cell, count in sorted(found.items()) if MEMORY_CELL.search(cell)}


def flip_flops(found: dict[str, int]) -> int:
    return sum(count for cell, count in found.items() if FLIP_FLOP_CELL.match(cell))


# ---------------------------------------------------------------- flip-flops


def flip_flops_by_kind(flow: str, top: str, opened: bool = False) -> dict[bool, int]:
    """Flip-flops of a module after a stock flow: those of guarded bits, and all others.

    `top`: module, and a parameter with its value. `opened`: the flow may look into guarded bits.
    """
    module, *setting = top.split()
    name = re.sub(r"\W+", "_", f"{flow}_{module}")
    script = f"""read_verilog -defer {" ".join(sandboxed(path) for path in needed_files(module))}
{f"chparam -set {' '.join(setting)} {module}" if setting else ""}
hierarchy -check -top {module}
{OPEN_HALVES if opened else ""}
{flow} -top {module}
write_json {BUILD.relative_to(ROOT)}/{name}.json
"""
    yosys(BUILD, name, script)
    modules = json.loads((BUILD / f"{name}.json").read_text())["modules"]
    cells = {kind: [cell["type"] for cell in entry["cells"].values()] for kind, entry in modules.items()}
    times = Counter(kind for kinds in cells.values() for kind in kinds)
    found = {True: 0, False: 0}
    for kind, inside in cells.items():
        count = sum(bool(FLIP_FLOP_CELL.match(cell)) for cell in inside)
        found["guarded_half" in kind] += count * (times[kind] or kind == module)
    return found


def merged_pairs(flow: str) -> list[str]:
    """One line for each module in which the flow has lost a half of a guarded bit."""
    pairs = lists()["merging"]["pairs"]
    left = {top: (flip_flops_by_kind(flow, top)[True], 2 * pairs[top]) for top in pairs}
    return [
        f"{flow}: {found} flip-flops in the guarded bits of {top.split()[0]}, but {wanted} are in the Verilog"
        for top, (found, wanted) in left.items()
        if found != wanted
    ]


# ---------------------------------------------------------------- slang


def slang(files: list[Path]) -> list[str]:
    """Errors of slang for the whole card."""
    from pyslang import driver  # a local import: the package is missing until `make setup-synth`

    one = driver.Driver()
    one.addStandardArgs()
    # PicoRV32 alone names a time scale, which slang takes for a mistake of the others.
    words = f"slang -Wnone --timescale 1ns/1ps --top {TOP} " + " ".join(map(str, files))
    good = one.parseCommandLine(words) and one.processOptions() and one.parseAllSources()
    return [] if good and one.runFullCompilation(True) else ["slang: the card does not elaborate"]


def main() -> int:
    wrong = []
    for flow, entry in lists()["flows"].items():
        try:
            found = cells(flow, entry["command"])
        except SynthError as error:
            wrong.append(str(error))
            continue
        shown = ", ".join(f"{count} {cell}" for cell, count in memories(found).items())
        print(f"{flow:9} {shown}; {flip_flops(found)} flip-flops", flush=True)
        wrong += compare_cells(flow, found, entry["memories"])
    for flow in lists()["merging"]["flows"]:
        wrong += (lost := merged_pairs(flow))
        print(f"{flow}: {'pairs lost' if lost else 'all guarded bits are pairs'}", flush=True)
    wrong += slang(card_files())
    print("\n".join(wrong), file=sys.stderr, end="\n" if wrong else "")
    return 1 if wrong else 0


if __name__ == "__main__":
    run_main("portability", main)
