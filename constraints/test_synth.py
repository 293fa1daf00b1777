# SPDX-License-Identifier: Apache-2.0
"""Clock and reset in the synthesised design: one clock, no latch, no loop, inputs to one flip-flop first.

Also the cases that `make synth` refuses.
"""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from constraints import flow, parts, synth
from constraints.boards import board, boards
from constraints.flow import SynthError, mapping, sandboxed, tool, unsafe, without_loose_inputs, yosys
from constraints.netlist import MAPPED, crossings
from constraints.parts import COUNTED_ON, TARGETS
from constraints.synth import measured_from, route
from rtl.sources import card_files, needed_files, rtl_files
from tb.gates import netlists as gates
from tb.lib.runner import ROOT

pytestmark = pytest.mark.nightly("synth")

FLIP_FLOP = re.compile(r"\$[as]*dffs?r?(?:c?e)?")
# Yosys's name of a part of each family whose netlists are examined here.
DEVICES = {family: device for family, (device, _) in COUNTED_ON.items()} | {"gowin": "gw1n"}


def elaborated(name: str, sources: list[Path], top: str) -> dict:
    """A design in Yosys before mapping, as one module."""
    folder = ROOT / "build/tests" / f"synth-{name}"
    folder.mkdir(parents=True, exist_ok=True)
    firmware = folder / "zeros.hex"
    firmware.write_text("00000000\n" * 2048)
    chparam = f'chparam -set FIRMWARE_HEX "{sandboxed(firmware)}" {top}\n' if top == "rtu2fc" else ""
    script = f"""read_verilog -defer {" ".join(map(sandboxed, sources))}
{chparam}hierarchy -check -top {top}
{flow.OPEN_HALVES}
proc
flatten
opt
memory -nomap
opt_clean
check -assert
scc -expect 0
select -assert-none t:$dlatch t:$adlatch t:$dlatchsr
write_json {folder.relative_to(ROOT)}/design.json
"""
    yosys(folder, "design", script)
    return json.loads((folder / "design.json").read_text())["modules"][top]


@pytest.mark.rule("SAFE-4")
@pytest.mark.parametrize("family", DEVICES)
@pytest.mark.parametrize(
    "module", ["guarded_bit", "commit_gate", "network_port", "drive_port", "switch_sampler"]
)
def test_no_flip_flops_are_merged(family, module):
    """Some flip-flops are equal or opposite on purpose; a synthesiser that merges them keeps only one."""
    sources = needed_files(module)
    registers = [
        cell["parameters"]["WIDTH"]
        for cell in elaborated(f"registers-{module}", sources, module)["cells"].values()
        if FLIP_FLOP.fullmatch(cell["type"])
    ]
    folder = ROOT / "build/tests" / f"synth-registers-{module}-{family}"
    folder.mkdir(parents=True, exist_ok=True)
    gates.synthesise(folder, module, mapping(family, DEVICES[family], module), sources, {})
    cells = json.loads((folder / "raw.json").read_text())["modules"][module]["cells"].values()
    there = sum(cell["type"] in MAPPED[family] for cell in cells)
    assert there == sum(int(width, 2) for width in registers)


@pytest.mark.rule("TOP-1")
def test_reset_pin_clears_the_drivers_and_the_synchroniser_alone(config):
    """Everything else has a reset that moves at clock edges: no other flip-flop has an asynchronous input."""
    module = elaborated(config, card_files(config), "rtu2fc")
    (pin,) = module["ports"]["rst_n"]["bits"]
    users = {
        (name, cell["type"])
        for name, cell in module["cells"].items()
        for port, bits in cell["connections"].items()
        if pin in bits and cell["port_directions"][port] == "input"
    }
    assert {kind for _, kind in users} == {"$adff"}
    assert {name for name, _ in users} == {
        name for name, cell in module["cells"].items() if {"ARST", "ALOAD", "SET"} & {*cell["connections"]}
    }
    driven = {bit for name, _ in users for bit in module["cells"][name]["connections"]["Q"]}
    de = {bit for line in ("modbus", "drive") for bit in module["ports"][f"{line}_de"]["bits"]}
    (asked,) = driven - de
    assert de < driven
    assert asked in module["netnames"]["reset_i.released"]["bits"]


# ---------------------------------------------------------------- the checks can fail


@pytest.mark.parametrize(
    ("ports", "body", "said"),
    [
        ("input clk, a, b, output reg q", "always @* if (a) q = b;", "latch"),
        ("input clk, a, output q", "assign q = a ^ (q & clk);", "loop|problems|scc"),
        ("input clk, a, output q", "wire u; assign q = a & u;", "problems"),
    ],
)
def test_a_latch_a_loop_and_an_undriven_net_are_refused(tmp_path, ports, body, said):
    source = tmp_path / "bad.v"
    source.write_text(f"module bad ({ports}); {body} endmodule\n")
    with pytest.raises(SynthError, match=f"(?i){said}"):
        elaborated("bad", [source], "bad")


@pytest.mark.parametrize("family", MAPPED)
@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("always @(posedge clk) r <= a; always @(posedge clk) s <= r;", []),
        ("always @(posedge clk) r <= a & b; always @(posedge clk) s <= r;", ["input a", "input b"]),
        ("always @(posedge clk) r <= a; always @(posedge clk) s <= r ^ a;", ["input a"]),
        (
            "always @(posedge clk) r <= a; always @(posedge t) s <= r; always @(posedge clk) t <= !t;",
            ["a clock"],
        ),
    ],
)
def test_a_board_s_netlist_is_checked(family, body, said):
    """The check of `make synth`, on cells of the family."""
    folder = ROOT / "build/tests" / f"synth-crossing-{family}-{len(body)}"
    folder.mkdir(parents=True, exist_ok=True)
    source = folder / "bad.v"
    ports = "input clk, a, b, output q" if "b" in re.findall(r"\w+", body) else "input clk, a, output q"
    source.write_text(f"module bad ({ports}); reg r = 0, s = 0, t = 0; {body} assign q = s; endmodule\n")
    gates.synthesise(folder, "bad", mapping(family, DEVICES.get(family, family), "bad"), [source], {})
    without_loose_inputs(folder / "raw.json")
    module = json.loads((folder / "raw.json").read_text())["modules"]["bad"]
    found = crossings(module, family)
    assert len(found) == len(said)
    assert all(line.startswith(start) for line, start in zip(found, said, strict=True)), found


def test_a_board_with_a_loose_input_is_refused(monkeypatch):
    folder = ROOT / "build/tests/synth-loose"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "x.json").write_text(json.dumps({"modules": {ENTRY.top: {}}}))
    monkeypatch.setattr(flow, "yosys", lambda *script: None)
    monkeypatch.setattr(flow, "crossings", lambda module, family: ["input a[0]"])
    with pytest.raises(SynthError, match=r"^ulx3s-25: input a\[0\]"):
        flow.synthesise(ENTRY, folder, flow.pattern_file(ENTRY), "x")


# ---------------------------------------------------------------- clock enables from abc9


def test_flip_flop_without_clock_enable_gets_none(tmp_path: Path):
    """nextpnr turns a constant clock enable into a flip-flop that never moves."""
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


# ---------------------------------------------------------------- what nextpnr only warns of

CLOCKED = "Info: Max frequency for clock 'card_i.clk': 59.34 MHz (PASS at 12.00 MHz)\n"
OFF = "Warning: Failed to route net '{}' from X27Y28/F6 to X9Y21/CLK1 using dedicated routing.\n"
HOLD = "ERROR: Hold/min time violation for clock 'posedge card_i.clk':\n"


@pytest.mark.parametrize(
    ("log", "said"),
    [
        (CLOCKED, None),
        # A switch on a clock pin goes to a look-up table: any route will do.
        (CLOCKED + OFF.format("card_i.switches_i.next"), None),
        (CLOCKED + OFF.format("card_i.clk") * 2, "the clock does not reach 2 cells by a clock network"),
        (CLOCKED + HOLD * 3, "3 paths are too fast (hold time)"),
    ],
)
def test_a_clock_off_its_network_and_hold_errors_are_found(log, said):
    assert unsafe(log) == said


# ---------------------------------------------------------------- designs that make synth refuses

# 12 MHz, so 18 MHz are required; seeds in an unsorted order.
ENTRY = replace(boards()["ulx3s-25"], clk_hz=12_000_000, seeds=(4, 2, 7))
FROZEN = "enum: SLICED.CEMUX 0\n"
MOVING = "enum: SLICEA.CEMUX 1\nenum: SLICEB.CEMUX CE\nenum: SLICEC.CEMUX INV\n"


@pytest.fixture
def seeds(monkeypatch):
    """Plants nextpnr's result of each seed: Fmax, a design, None (no placement); gives the seeds tried."""

    def plant(planted: dict[int, float | str | None]) -> list[int]:
        tried: list[int] = []

        def place_and_route(entry, folder: Path, name: str, seed: int) -> dict:
            tried.append(seed)
            result = planted[seed]
            if result is None:
                raise SynthError("Unable to find a placement location")
            text, fmax = (result, 100.0) if isinstance(result, str) else (f"{MOVING}{seed}\n", result)
            (folder / f"{name}{flow.suffix(entry)}").write_text(text)
            return {"fmax": {"clk": {"achieved": fmax}}}

        monkeypatch.setattr(flow, "place_and_route", place_and_route)
        return tried

    return plant


@pytest.mark.parametrize(
    ("planted", "tried"), [({4: None, 2: 18.0, 7: 90.0}, [4, 2]), ({4: None, 2: 17.99, 7: 18.01}, [4, 2, 7])]
)
def test_first_seed_in_time_is_used(seeds, tmp_path, planted, tried):
    """Seeds are tried in the order of the table, none after the first success; its design is kept."""
    done = seeds(planted)
    seed, report = route(ENTRY, tmp_path)
    assert (done, seed) == (tried, tried[-1])
    assert flow.fmax_mhz(report) == planted[seed]
    assert (tmp_path / f"{ENTRY.top}.config").read_text() == f"{MOVING}{seed}\n"


def test_a_board_that_no_seed_routes_in_time_is_refused(seeds, tmp_path, capsys):
    tried = seeds({4: 12.0, 2: 17.99, 7: None})
    with pytest.raises(SynthError, match=r"^ulx3s-25: no seed of 4, 2, 7 gave a design in time$"):
        route(ENTRY, tmp_path)
    assert tried == [4, 2, 7] and not list(tmp_path.iterdir())
    assert "seed 2: 18.0 MHz are less than 18" in capsys.readouterr().out


def test_a_frozen_design_is_refused_at_once(seeds, tmp_path):
    tried = seeds({4: MOVING + FROZEN * 3, 2: 90.0, 7: 90.0})
    with pytest.raises(SynthError, match="the flip-flops of 3 slices are never clocked"):
        route(ENTRY, tmp_path)
    assert tried == [4] and not list(tmp_path.iterdir())


def test_a_refused_build_leaves_no_design_and_no_bitstream(seeds, monkeypatch):
    """Results of an earlier build are removed too, because they could be mistaken for this build's."""
    folder = ROOT / "build/tests/synth-refused" / ENTRY.name
    folder.mkdir(parents=True, exist_ok=True)
    for old in (f"{ENTRY.top}.config", "firmware.config", "image.config"):
        (folder / old).write_text("old\n")
    monkeypatch.setattr(flow, "BUILD", folder.parent)
    monkeypatch.setattr(flow, "synthesise", lambda *what: {"LUT4": 1})
    seeds(dict.fromkeys(ENTRY.seeds, FROZEN))
    with pytest.raises(SynthError):
        synth.build(ENTRY)
    assert not list(folder.glob("*.config"))


ROW = {"cells": 10, "cells_of": 10, "brams": 3, "brams_of": 3, "lut4": 1, "ff": 1, "fmax_mhz": 2.0}
ROW |= {"clk_mhz": 1.0, "seed": 1, "seconds": 1, "part": "x", "config": "tiny", "files": ["x.bit"]}


@pytest.mark.parametrize(("what", "status"), [({}, 0), ({"cells": 11}, 1), ({"brams": 4}, 1)])
def test_make_synth_fails_with_a_design_too_big_for_its_part(monkeypatch, capsys, what, status):
    monkeypatch.setattr(flow, "try_pins", lambda entry, folder: None)
    monkeypatch.setattr(synth, "build", lambda entry: ROW | what)
    monkeypatch.setattr(sys, "argv", ["synth", "card-xo2-1200"])
    assert synth.main() == status
    for kind, number in what.items():
        said = f"synth: card-xo2-1200: {number} {kind}, but a x has {ROW[f'{kind}_of']}\n"
        assert capsys.readouterr().err == said


def test_a_tool_that_never_ends_is_given_up():
    with pytest.raises(SynthError, match=r"^python: no result in 1 s of processor time$"):
        tool(["python", "-c", "while True: pass"], flow.BUILD / "none.log", limit_s=1)


def test_a_board_of_either_kind_is_a_design_of_its_own():
    old, extended = board("icebreaker"), board("icebreaker-extended")
    assert (old.extended_switches, extended.extended_switches) == (0, 1)
    assert flow.pattern_file(old) != flow.pattern_file(extended) and old.wrapper == extended.wrapper
    assert flow.made_from(old) != flow.made_from(extended)


def test_the_whole_card_has_every_module():
    """A module that is missing in WHOLE would be cut out, and its cells with it."""
    assert {path.stem for path in rtl_files()} - parts.WHOLE == {"rtu2fc", "break_filter"}, (
        "no board has breaks"
    )


def test_make_synth_fails_with_a_front_end_too_big(monkeypatch, capsys, written, tmp_path):
    """The table stays unchanged."""
    monkeypatch.setattr(flow, "try_pins", lambda entry, folder: None)
    monkeypatch.setattr(synth, "build", lambda entry: ROW)
    limit = TARGETS["machxo2"]
    monkeypatch.setattr(
        parts, "count_part", lambda *part: {"cells": limit + (part[1] == "machxo2"), "brams": 0}
    )
    monkeypatch.setitem(TARGETS, "ice40", limit)
    monkeypatch.setattr(synth, "RESULTS", tmp_path / "results.json")
    monkeypatch.setattr(sys, "argv", ["synth"])
    assert synth.main() == 1
    assert f"synth: front end: {limit + 1} cells on machxo2" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
    monkeypatch.setattr(parts, "count_part", lambda *part: {"cells": limit, "brams": 0})
    assert synth.main() == 0
    written = (tmp_path / "synthesis.md").read_text()
    assert measured_from() in written and f"| **whole card**, `standard` |{f' {limit} |' * 4}" in written
    assert "each fits and reaches 2.00 times its clock" in (tmp_path / "evidence.json").read_text()
