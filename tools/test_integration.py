# SPDX-License-Identifier: Apache-2.0
"""docs/guide/integration.md: FuseSoC takes every core from copies alone; the tables are those of the code."""

from __future__ import annotations

import itertools
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from constraints.boards import board
from regs.generated.card_tables import SILENCE_START, SILENCES
from rtl.sources import ROOT, core_files
from tb.lib.runner import firmware

TOPS = ("network_port", "drive_port", "modbus_slave", "rtu2fc")


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> Path:
    """What another project has: the files that the cores name, and the soft cores.

    FuseSoC refuses an empty entry of PicoRV32's own core file.
    """
    folder = tmp_path_factory.mktemp("library")
    for path in (*ROOT.glob("*.core"), ROOT / "docs/example/modbus_slave.core"):
        core = yaml.safe_load(path.read_text().split("\n", 1)[1])  # the line CAPI=2: is no YAML
        listed = [file for fileset in core["filesets"].values() for file in fileset["files"]]
        for file in (
            path,
            *(path.parent / next(iter([file] if isinstance(file, str) else file)) for file in listed),
        ):
            copy = folder / "parts" / file.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, copy)
    for config, core in (("standard", "picorv32"), ("tiny", "serv")):
        home = next(path for path in core_files(config)[0].parents if (path / f"{core}.core").exists())
        shutil.copytree(
            home, folder / core, ignore=shutil.ignore_patterns("picosoc", "*serving*", "servant*")
        )
    picorv32 = folder / "picorv32/picorv32.core"
    lines = picorv32.read_text().splitlines(keepends=True)
    picorv32.write_text("".join(line for line in lines if line.strip() != "depend:"))
    return folder


def fusesoc(library: Path, *words: str) -> str:
    """Runs FuseSoC in `library`; returns what it prints."""
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
        "EDALIZE_LAUNCHER": f"{sys.executable} -m tools.launcher",
    }
    command = [sys.executable, "-m", "fusesoc.main", "--cores-root", ".", "run", *words]
    done = subprocess.run(command, cwd=library, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.nightly("synth")
@pytest.mark.parametrize("top", [*TOPS, "rtu2fc --flag=tiny"])
def test_lint_target(top, library):
    name, *flag = top.split()
    said = fusesoc(library, "--target=lint", *flag, name)
    assert "Verilator" in said and "%Warning" not in said


@pytest.mark.nightly("synth")
@pytest.mark.parametrize("top", TOPS)
def test_synth_target(top, library):
    """The netlist has all pins, flip-flops, no latch and no cell that is not one of the part."""
    words = [f"--FIRMWARE_HEX={firmware()}"] if top == "rtu2fc" else []
    fusesoc(library, "--target=synth", top, *words)
    (netlist,) = library.glob(f"build/rtu2fc_{top}_*/synth/*.json")
    modules = json.loads(netlist.read_text())["modules"]
    assert {"clk", "modbus_rx" if top == "rtu2fc" else "rx"} <= set(modules[top]["ports"])
    types = {cell["type"] for cell in modules[top]["cells"].values()} - {"$scopeinfo"}
    # They keep their hierarchy, so that no tool takes one core or one half of a pair for both (SAFE-4).
    cores = {name for name in types if name.endswith("picorv32")}
    halves = {name for name in types if "guarded_half" in name}
    assert (len(cores), len(halves)) == (top == "rtu2fc", 0 if top == "drive_port" else 2)
    inside = {cell["type"] for module in cores | halves for cell in modules[module]["cells"].values()}
    used = (types | inside) - cores - halves - {"$scopeinfo"}
    assert {"SB_LUT4", "SB_CARRY", "SB_DFFESR"} <= used
    assert all(cell.startswith("SB_") for cell in used), sorted(used)
    assert ("SB_RAM40_4K" in used) == (top in ("rtu2fc", "modbus_slave"))


# ---------------------------------------------------------------- the guide's tables
GUIDE = (ROOT / "docs/guide/integration.md").read_text()


def rows_after(title: str, header: str) -> list[list[str]]:
    """The cells of the first table with this header after a title."""
    text = GUIDE.split(f"\n{title}\n", 1)[1].split(f"{header}\n", 1)[1]
    lines = itertools.takewhile(lambda line: line.startswith("|"), text.splitlines()[1:])
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]


@pytest.mark.parametrize("port", ["network_port", "drive_port"])
def test_the_guide_has_the_bits_of_every_port(port):
    text = (ROOT / f"rtl/{port}.v").read_text()
    pins = re.findall(r"^    (?:in|out)put +\w+ *(?:\[ *(\d+):0\])? *(\w+)", text, re.MULTILINE)
    declared = {name: int(high or 0) + 1 for high, name in pins}
    shown = {}
    for row in rows_after(f"## {port}", "| port | bits | direction | meaning |"):
        names, bits = re.findall(r"`(\w+)`", row[0]), row[1].split(", ")
        shown |= dict(zip(names, map(int, bits), strict=True))
    assert shown == declared and len(declared) > 20


def test_the_guide_has_the_silences_of_each_rate():
    header = "| bit/s | `half_end` with 8N1 | with any other format | `half_uneven` |"
    shown = {row[0].split()[-1]: list(map(int, row[1:])) for row in rows_after("### Silences", header)}
    for (baud, bits), silences in SILENCES.items():
        shorter, longer, uneven = shown[str(max(baud, 19_200))]
        assert (shorter if bits == 10 else longer) == SILENCE_START - 1 + silences.half_ticks, (baud, bits)
        assert uneven == silences.half_uneven


def test_the_attributes_of_the_guide_stand_in_their_modules():
    shown = {
        (module, attribute)
        for row in rows_after("## Flip-flops that must stay", "| attribute | module | manual |")
        for attribute in re.findall("`(.+?)`", row[0])
        for module in re.findall("`(.+?)`", row[1])
    }
    written = {
        (path.stem, attribute)
        for path in (ROOT / "rtl/prim").glob("*.v")
        for attributes in re.findall(r"\(\* (.+?) \*\)", path.read_text())
        for attribute in attributes.split(", ")
    }
    assert shown == written and len(shown) == 7


# ---------------------------------------------------------------- the example
def test_the_guides_slave_elaborates_with_the_files_of_its_command(tmp_path):
    module = GUIDE.split("```verilog\n", 1)[1].split("```", 1)[0]
    command = re.search(r"^ls .*?(?=  )", GUIDE, re.MULTILINE)[0]
    printed = subprocess.run(["sh", "-c", command], cwd=ROOT, capture_output=True, text=True, check=True)
    (tmp_path / "top.v").write_text(module)
    words = ["iverilog", "-g2005", "-Wall", "-t", "null", *printed.stdout.split(), tmp_path / "top.v"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "modbus_slave #(" in module, done.stderr


# ---------------------------------------------------------------- the example on two boards
NETWORK_PINS = {
    "clk": "clk",
    "rx": "modbus_rx",
    "tx": "modbus_tx",
    "de": "modbus_de",
    "led_n": "led_modbus_red_n",
}


@pytest.mark.parametrize("name", ["icebreaker", "tang-nano-9k"])
def test_the_example_has_the_pins_of_the_cards_network_line(name):
    entry = board(name)
    wanted = {pin.port: pin.site for pin in entry.pins()}
    file = ROOT / f"docs/example/{entry.top}{entry.pin_file.suffix}"
    line = r"^set_io(?: -\S+ \S+)* (\w+) (\w+)$" if file.suffix == ".pcf" else r'^IO_LOC "(\w+)" (\w+);'
    sites = dict(re.findall(line, file.read_text(), re.MULTILINE))
    assert sites == {port: wanted[card] for port, card in NETWORK_PINS.items()}


@pytest.mark.nightly("synth")
@pytest.mark.parametrize(("name", "file"), [("icebreaker", "slave.bin"), ("tang-nano-9k", "slave.fs")])
def test_the_example_becomes_a_bitstream(name, file):
    made = ROOT / "build/example" / name / file
    made.unlink(missing_ok=True)
    done = subprocess.run(
        ["docs/example/bitstream.sh", name], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert made.stat().st_size > 50_000 and done.stdout.split()[-1].endswith(file)
