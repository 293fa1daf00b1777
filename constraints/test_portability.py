# SPDX-License-Identifier: Apache-2.0
"""Other people's tools read the card, and the lists of constraints/portability.toml are those of the card."""

from __future__ import annotations

import itertools
import re
import subprocess

import pytest

from constraints import portability
from constraints.synth import MARGIN
from rtl.sources import ROOT, card_files, configurations

LISTS = portability.lists()
# Two take a minute each. CI runs the others.
FLOWS = [
    pytest.param(flow, marks=[pytest.mark.nightly] * (flow in ("xilinx", "nexus"))) for flow in LISTS["flows"]
]


@pytest.mark.nightly("synth")
@pytest.mark.parametrize("flow", FLOWS)
def test_a_flow_takes_the_card_and_finds_its_memories(flow):
    entry = LISTS["flows"][flow]
    found = portability.cells(flow, entry["command"])
    assert portability.compare_cells(flow, found, entry["memories"]) == []


def test_other_memories_and_memories_of_flip_flops_are_named():
    wanted = {"RAMB36E1": 4}
    assert portability.compare_cells("x", {"RAMB36E1": 4, "FDRE": 900, "LUT4": 9}, wanted) == []
    assert "'RAMB36E1': 5" in portability.compare_cells("x", {"RAMB36E1": 5}, wanted)[0]
    (line,) = portability.compare_cells("x", {"RAMB36E1": 4, "FDRE": 1900}, wanted)
    assert line == "x: 1900 flip-flops, so a memory is made of them"


@pytest.mark.nightly("synth")
def test_slang_takes_the_sources_in_any_order(capfd):
    assert portability.slang(card_files()) == []
    assert portability.slang(card_files()[::-1]) == []
    assert portability.slang([path for path in card_files() if path.stem != "uart"]) != []


@pytest.mark.nightly("synth")
@pytest.mark.rule("SAFE-4")
@pytest.mark.parametrize("flow", LISTS["merging"]["flows"])
def test_no_stock_flow_merges_a_guarded_bit(flow):
    assert portability.merged_pairs(flow) == []


@pytest.mark.nightly("synth")
def test_a_merged_pair_is_found():
    """The same flow makes one flip-flop of each pair, if it may open the halves."""
    flow, (top, pairs) = LISTS["merging"]["flows"][0], next(iter(LISTS["merging"]["pairs"].items()))
    kept, opened = (portability.flip_flops_by_kind(flow, top, opened) for opened in (False, True))
    assert kept[True] == 2 * pairs
    assert sum(kept.values()) - sum(opened.values()) >= pairs


VENDORS = sorted(path.stem for path in (ROOT / "constraints/vendor").glob("*.tcl") if path.stem != "card")


@pytest.mark.nightly("synth")
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
