# SPDX-License-Identifier: Apache-2.0
"""Other people's tools read the card: Yosys's flows for other parts, slang, the vendors' scripts.

The memories of each flow are those of constraints/portability.toml. After each flow that merges flip-flops
the guarded bits are those of the Verilog. No part is placed: the flows show that they read the Verilog, and
that memories stay memories.
"""

from __future__ import annotations

import itertools
import json
import re
import subprocess
import tomllib
from collections import Counter
from pathlib import Path

import pytest

from constraints.flow import OPEN_HALVES, sandboxed, yosys
from constraints.synth import MARGIN
from rtl.sources import ROOT, card_files, configurations, needed_files

pytestmark = pytest.mark.nightly("synth")

LISTS = tomllib.loads((ROOT / "constraints/portability.toml").read_text())
BUILD = ROOT / "build/portability"
TOP = "rtu2fc"
# The smallest memory, the core's registers, has 1024 bits; the rest of the card has some 900 flip-flops.
MOST_FLIP_FLOPS = 1000
MEMORY_CELL = re.compile(r"RAM|M10K|MLAB|^DP|^SP|^SDP|SC16K")
FLIP_FLOP_CELL = re.compile(r"FD[A-Z1]|DFF|SB_DFF|TRELLIS_FF|MISTRAL_FF|CC_DFF|EFX_FF|SLE$")


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


def memories(found: dict[str, int]) -> dict[str, int]:
    """Of a flow that keeps the hierarchy, the modules' own names are no cells."""
    kinds = {cell: count for cell, count in sorted(found.items()) if not cell.startswith("$paramod")}
    return {cell: count for cell, count in kinds.items() if MEMORY_CELL.search(cell)}


def flip_flops(found: dict[str, int]) -> int:
    return sum(count for cell, count in found.items() if FLIP_FLOP_CELL.match(cell))


@pytest.mark.parametrize("flow", LISTS["flows"])
def test_a_flow_takes_the_card_and_finds_its_memories(flow):
    entry = LISTS["flows"][flow]
    found = cells(flow, entry["command"])
    assert memories(found) == entry["memories"]
    assert flip_flops(found) < MOST_FLIP_FLOPS, "a memory is made of flip-flops"


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


@pytest.mark.rule("SAFE-4")
@pytest.mark.parametrize("flow", LISTS["merging"]["flows"])
def test_no_stock_flow_merges_a_guarded_bit(flow):
    pairs = LISTS["merging"]["pairs"]
    assert {top: flip_flops_by_kind(flow, top)[True] / 2 for top in pairs} == pairs


def test_a_merged_pair_is_found():
    """The same flow makes one flip-flop of each pair, if it may open the halves."""
    flow, (top, pairs) = LISTS["merging"]["flows"][0], next(iter(LISTS["merging"]["pairs"].items()))
    kept, opened = (flip_flops_by_kind(flow, top, opened) for opened in (False, True))
    assert kept[True] == 2 * pairs
    assert sum(kept.values()) - sum(opened.values()) >= pairs


# ---------------------------------------------------------------- slang, vendors


def slang(files: list[Path]) -> bool:
    """Whether slang elaborates the whole card."""
    from pyslang import driver  # a local import: the package is missing until `make setup-synth`

    one = driver.Driver()
    one.addStandardArgs()
    # PicoRV32 alone names a time scale, which slang takes for a mistake of the others.
    words = f"slang -Wnone --timescale 1ns/1ps --top {TOP} " + " ".join(map(str, files))
    good = one.parseCommandLine(words) and one.processOptions() and one.parseAllSources()
    return good and one.runFullCompilation(True)


def test_slang_takes_the_sources_in_any_order(capfd):
    assert slang(card_files())
    assert slang(card_files()[::-1])
    assert not slang([path for path in card_files() if path.stem != "uart"])


VENDORS = sorted(path.stem for path in (ROOT / "constraints/vendor").glob("*.tcl") if path.stem != "card")


@pytest.mark.parametrize("vendor", VENDORS)
def test_a_vendor_script_names_every_source_the_image_and_the_part(vendor, tmp_path):
    """Under tclsh, with the vendor's commands printed. It does not show that the vendor takes them."""
    script = ROOT / f"constraints/vendor/{vendor}.tcl"
    (tmp_path / "print.tcl").write_text(f"proc unknown args {{ puts $args }}\nsource {script}\n")
    command = ["tclsh", str(tmp_path / "print.tcl"), "APART"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    words = re.split(r"[\s{}\"=\\;]+", done.stdout)
    image = ROOT / configurations()["standard"]["firmware_hex"]
    wanted = [*card_files(), image, ROOT / "constraints/vendor/card.sdc"]
    assert not {str(path) for path in wanted} - set(words)
    assert "APART" in words and "Untried" in script.read_text()
    # The top, and a value after each parameter's name: a tool ignores a name that the card lacks.
    clk_hz = configurations()["standard"]["clk_hz"]
    pairs = set(itertools.pairwise(words))
    assert {("CLK_HZ", str(clk_hz)), ("FIRMWARE_HEX", str(image))} <= pairs
    assert "rtu2fc" in words
    (period_ns,) = re.findall(r"-period ([\d.]+)", (ROOT / "constraints/vendor/card.sdc").read_text())
    assert float(period_ns) == pytest.approx(1e9 / (MARGIN * clk_hz), abs=0.1)
