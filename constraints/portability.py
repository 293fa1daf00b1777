# SPDX-License-Identifier: Apache-2.0
"""Reads the card with other people's tools: Yosys's flows for other parts, and slang.

    python -m constraints.portability

Compares the memories of each flow with constraints/portability.toml, the flip-flops that start with a value
but have no reset with the list there, and the guarded bits after each flow that merges flip-flops with those
of the Verilog. Prints one line for each tool; exit 1 if one disagrees.
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
from rtl.sources import ROOT, card_files, configurations, needed_files, rtl_files

LISTS = ROOT / "constraints/portability.toml"
BUILD = ROOT / "build/portability"
TOP = "rtu2fc"
YOSYS_CELL = re.compile(r"\$\w+")  # no module, whose outputs may be registers
FLIP_FLOP = re.compile(r"\$[as]*dffs?r?(?:c?e)?")
# The smallest memory, the core's registers, has 1024 bits; the rest of the card has some 900 flip-flops.
MOST_FLIP_FLOPS = 1000
MEMORY_CELL = re.compile(r"RAM|M10K|MLAB|^DP|^SP|^SDP|SC16K")
FLIP_FLOP_CELL = re.compile(r"FD[A-Z1]|DFF|SB_DFF|TRELLIS_FF|MISTRAL_FF|CC_DFF|EFX_FF|SLE$")
RESETS = {"rst", "core_rst", "rst_n"}


def lists() -> dict:
    return tomllib.loads(LISTS.read_text())


def read_card(config: str) -> str:
    """Commands that read the whole card with its firmware; one core, for the second is the same module."""
    image = sandboxed(ROOT / configurations()[config]["firmware_hex"])
    sources = " ".join(sandboxed(path) for path in card_files(config))
    return f'read_verilog -defer {sources}\nchparam -set LOCKSTEP 0 -set FIRMWARE_HEX "{image}" {TOP}\n'


# ---------------------------------------------------------------- memories


def cells(flow: str, command: str) -> dict[str, int]:
    """Number of cells of a flow by type."""
    where = f"{BUILD.relative_to(ROOT)}/{flow}.stat"
    yosys(BUILD, flow, f"{read_card('standard')}{command} -top {TOP}\ntee -q -o {where} stat -json\n")
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


def without_reset() -> set[str]:
    """Registers of our modules, in either card, that start with a value and no reset sets: MODULE.NAME."""
    own, found = {path.stem for path in rtl_files()}, set()
    for config in configurations():
        where = f"{BUILD.relative_to(ROOT)}/flip_flops_{config}"
        script = f"{read_card(config)}hierarchy -top {TOP}\nproc\nopt\nwrite_json {where}.json\n"
        yosys(BUILD, f"flip_flops_{config}", script)
        for name, module in json.loads((ROOT / f"{where}.json").read_text())["modules"].items():
            plain = re.sub(r"^\$paramod(?:\$\w+)?\\", "", name).split("\\")[0]
            if plain in own:
                found |= {f"{plain}.{register}" for register in unreset_registers(module)}
    return found


def unreset_registers(module: dict) -> set[str]:
    cells = module["cells"].values()
    resets = {bit for port, entry in module["ports"].items() if port in RESETS for bit in entry["bits"]}
    driver = {
        bit: cell
        for cell in cells
        if YOSYS_CELL.fullmatch(cell["type"]) and not FLIP_FLOP.fullmatch(cell["type"])
        for port, bits in cell["connections"].items()
        if cell.get("port_directions", {}).get(port) == "output"
        for bit in bits
    }

    def reaches_reset(bits: list) -> bool:
        """Whether the reset is among what these bits depend on in this clock."""
        queue, seen = list(bits), set()
        while queue:
            bit = queue.pop()
            if bit in resets:
                return True
            if bit in seen or bit not in driver:
                continue
            seen.add(bit)
            cell = driver[bit]
            for port, inputs in cell["connections"].items():
                queue += inputs if cell["port_directions"][port] == "input" else []
        return False

    loose = set()
    for cell in cells:
        if FLIP_FLOP.fullmatch(cell["type"]):
            wires = cell["connections"]
            if not any(reaches_reset(wires[port]) for port in ("SRST", "ARST", "ALOAD") if port in wires):
                loose |= {bit for bit in wires["Q"] if isinstance(bit, int)}
    return {
        name
        for name, net in module["netnames"].items()
        if not net["hide_name"] and "init" in net["attributes"] and not loose.isdisjoint(net["bits"])
    }


def compare_registers(found: set[str], reasons: dict[str, list[str]]) -> list[str]:
    """One line for each register that the list lacks, or that needs no place in it."""
    listed = {name for names in reasons.values() for name in names}
    wrong = [f"{name} starts with a value, has no reset and no reason" for name in found - listed]
    return sorted(wrong + [f"{name} is listed, but no such flip-flop is there" for name in listed - found])


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
    registers = without_reset()
    print(f"registers with a start value and no reset: {len(registers)}", flush=True)
    wrong += compare_registers(registers, lists()["without_reset"])
    wrong += slang(card_files())
    print("\n".join(wrong), file=sys.stderr, end="\n" if wrong else "")
    return 1 if wrong else 0


if __name__ == "__main__":
    run_main("portability", main)
