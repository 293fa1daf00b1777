# SPDX-License-Identifier: Apache-2.0
"""The .core files: FuseSoC checks and synthesises each, from copies alone, and no file is forgotten."""

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

from rtl.sources import ROOT, core_files
from sim.harness.pins import BAUDS, FORMS
from tb.lib.runner import firmware
from tools import cores
from tools.cores import PORTS

TOPS = ("network_port", "drive_port", "holding_registers", "rtu2fc")
PICORV32 = "::picorv32:0-r1"


def test_core_files_fit_the_list_of_files():
    assert cores.check() == []


@pytest.mark.parametrize(
    ("stem", "found", "instead", "wrong"),
    [
        ("rtu2fc", "      - rtl/mailbox.v\n", "", "rtl/mailbox.v is in no core"),
        ("line", "rtl/uart.v", "rtl/uarts.v", "rtl/uarts.v is in a core, but not in rtl/rtl.f"),
        ("drive_port", "rtl/bcc.v\n", "rtl/bcc.v\n      - rtl/uart.v\n", "rtl/uart.v is in two cores"),
        ("network_port", "rtl/rtu_rx.v", "rtl/fc_rx.v", "network_port.core: rtl/rtu_rx.v is missing"),
        ("line", "rtl/uart.v", "rtl/rtu2fc.v", "drive_port.core: rtl/rtu2fc.v is of no use"),
        ("line", "line:0.", "line:9.", "line.core: the name is :rtu2fc:line:9.2.0"),
        ("rtu2fc", "drive_port:0.", "drive_port:9.", "rtu2fc.core: =:rtu2fc:drive_port:9.2.0 is no core"),
        ("rtu2fc", "config_tiny", "config_standard", "rtu2fc.core: the fileset tiny is not that"),
        ("rtu2fc", "::serv:", "::servant:", "rtu2fc.core: the fileset tiny is not that"),
    ],
)
def test_wrong_core_file_is_named(stem, found, instead, wrong, tmp_path):
    for path in cores.core_files():
        copy = tmp_path / path.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, copy)
    changed = tmp_path / f"{stem}.core"
    text = changed.read_text()
    assert found in text
    changed.write_text(text.replace(found, instead))
    assert any(line.startswith(wrong) for line in cores.check(tmp_path)), cores.check(tmp_path)


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> Path:
    """What another project has: the files that the cores name, and the soft cores. FuseSoC refuses an empty
    entry of PicoRV32's own core file."""
    folder = tmp_path_factory.mktemp("library")
    for path in cores.core_files():
        filesets = cores.read(path)["filesets"].values()
        named = [
            next(iter(file)) if isinstance(file, dict) else file for s in filesets for file in s["files"]
        ]
        for file in (path, *(path.parent / file for file in named)):
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


@pytest.mark.needs("synth")
@pytest.mark.parametrize("top", [*TOPS, "rtu2fc, tiny"])
def test_lint_target(top, library):
    name, _, flag = top.partition(", ")
    said = fusesoc(library, "--target=lint", *([f"--flag={flag}"] if flag else []), name)
    assert "Verilator" in said and "%Warning" not in said


@pytest.mark.needs("synth")
def test_the_guide_s_commands_run_without_a_warning():
    """In the project's own folder, as a reader types them; that of `synth` is left out."""
    guide = (ROOT / "docs/guide/integration.md").read_text()
    block = next(part for part in guide.split("```\n") if part.startswith("make setup-synth\n"))
    lines = [line for line in block.splitlines() if "--target=synth" not in line]
    assert sum("--target=lint" in line for line in lines) == 2
    script = "\n".join(["set -e", *lines])
    done = subprocess.run(["bash", "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "WARNING" not in done.stdout + done.stderr and done.stdout.count("Verilator: Walltime") == 2


@pytest.mark.needs("synth")
def test_lint_target_finds_a_mistake(library, tmp_path):
    copy = tmp_path / "library"
    shutil.copytree(library, copy, ignore=shutil.ignore_patterns("build"))
    changed = copy / "parts/rtl/bcc.v"
    changed.write_text(changed.read_text().replace("endmodule", "wire nothing;\nendmodule"))
    with pytest.raises(AssertionError, match="Signal is not driven, nor used: 'nothing'"):
        fusesoc(copy, "--target=lint", "drive_port")


@pytest.mark.needs("synth")
@pytest.mark.parametrize("top", TOPS)
def test_synth_target(top, library):
    """The netlist has all pins, flip-flops, no latch and no cell that is not one of the part."""
    words = [f"--FIRMWARE_HEX={firmware()}"] if top == "rtu2fc" else []
    fusesoc(library, "--target=synth", top, *words)
    (netlist,) = library.glob(f"build/rtu2fc_{top}_*/synth/*.json")
    module = json.loads(netlist.read_text())["modules"][top]
    assert {"clk", "modbus_rx" if top == "rtu2fc" else "rx"} <= set(module["ports"])
    used = {cell["type"] for cell in module["cells"].values()} - {"$scopeinfo"}
    assert {"SB_LUT4", "SB_CARRY", "SB_DFFESR"} <= used
    assert all(cell.startswith("SB_") for cell in used), sorted(used)
    assert ("SB_RAM40_4K" in used) == (top == "rtu2fc")


def launcher(folder: Path, *words: str, **environment: str):
    return subprocess.run(
        [sys.executable, "-m", "tools.launcher", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.needs("synth")
@pytest.mark.parametrize(
    ("script", "wrong"), [("set x [lindex]\n", "wrong # args"), (None, "couldn't read file")]
)
def test_wrong_script_of_yosys_is_one_line(script, wrong, tmp_path):
    if script:
        (tmp_path / "wrong.tcl").write_text(script)
    done = launcher(tmp_path, "yosys", "-p", "tcl wrong.tcl")
    assert done.returncode == 2
    assert done.stderr.startswith(f"launcher: wrong.tcl: {wrong}") and done.stderr.count("\n") == 1


@pytest.mark.needs("synth")
def test_launcher_passes_the_tools_exit_code_on(tmp_path):
    assert launcher(tmp_path, "sh", "-c", "exit 7").returncode == 7
    (tmp_path / "wrong.tcl").write_text("yosys -import\nset file nothing.v\nread_verilog $file\n")
    done = launcher(tmp_path, "yosys", "-p", "tcl wrong.tcl")
    assert done.returncode == 1 and "nothing.v" in done.stderr
    assert (tmp_path / "wrong.ys").read_text() == "read_verilog nothing.v\n"


def test_missing_command_is_one_line(tmp_path):
    done = launcher(tmp_path, "verilator", "-f", "x.vc", PATH=str(tmp_path))
    assert (done.returncode, done.stderr) == (2, "launcher: verilator is missing; run `make setup-synth`\n")
    done = launcher(tmp_path, "yosys", "-p", "tcl x.tcl", PATH=str(tmp_path))
    assert (done.returncode, done.stderr) == (2, "launcher: tclsh is missing; run `make setup-synth`\n")
    done = launcher(tmp_path)
    assert (done.returncode, done.stderr) == (2, "launcher: name a command\n")


# ---------------------------------------------------------------- the guide's tables
GUIDE = (ROOT / "docs/guide/integration.md").read_text()


def rows_after(title: str, header: str) -> list[list[str]]:
    """The cells of the first table with this header after a title."""
    text = GUIDE.split(f"\n{title}\n", 1)[1].split(f"{header}\n", 1)[1]
    lines = itertools.takewhile(lambda line: line.startswith("|"), text.splitlines()[1:])
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]


def test_the_guide_has_the_places_of_every_field():
    """The tables of format, request, telegram and exchange, and the start of the silence timer."""
    verilog = "\n".join(path.read_text() for path in sorted((ROOT / "rtl").glob("*.v")))
    defined = dict(re.findall(r"`define (CARD_\w+_BITS) ([\d:]+)", verilog))
    stated = dict(re.findall(r"^\| `(CARD_\w+_BITS)` \| ([\d-]+) \|", GUIDE, re.MULTILINE))
    assert len(stated) > 20
    assert stated == {name: defined[name].replace(":", "-") for name in stated}
    (start,) = set(re.findall(r"`define CARD_SILENCE_START 9'd(\d+)", verilog))
    assert f"`CARD_SILENCE_START` is {start}," in GUIDE


@pytest.mark.parametrize("port", PORTS)
def test_the_guide_has_the_bits_of_every_port(port):
    text = (ROOT / f"rtl/{port}.v").read_text()
    spans = dict(re.findall(r"`define (\w+_BITS) (\d+):0", text))
    declared = {}
    for span, name in re.findall(r"^    (?:in|out)put +\w+ *(?:\[([^]]+)\])? *(\w+)", text, re.MULTILINE):
        span = span.strip().removesuffix(":0")
        declared[name] = int(spans.get(span.lstrip("`"), span or 0)) + 1
    shown = {}
    for row in rows_after(f"## {port}", "| port | bits | direction | meaning |"):
        names, bits = re.findall(r"`(\w+)`", row[0]), row[1].split(", ")
        shown |= dict(zip(names, map(int, bits), strict=True))
    assert shown == declared and len(declared) > 15


def test_the_guide_has_the_bits_of_the_events():
    macros = re.findall(r"`define (MBX_EVENTS_\w+) (\d+)$", (ROOT / "rtl/network_port.v").read_text(), re.M)
    shown = [
        (row[0].strip("`"), row[1])
        for row in rows_after("### events", "| field | bit | the frame is dropped because |")
    ]
    assert shown == macros and len(macros) == 7


def test_the_guide_has_the_format_of_each_rate(tmp_path):
    """As card_tables makes it from the switches."""
    bench = tmp_path / "bench.v"
    bench.write_text(
        "module bench; reg [5:1] switches; wire [12:0] line; integer i;\n"
        "card_tables tables (.sw_baud(switches), .baud_undivided(), .baud_mask(), .line(line));\n"
        "initial for (i = 0; i < 32; i = i + 1) begin\n"
        '  switches = i[4:0]; #1 $display("%0d %h", i, line);\nend\nendmodule\n'
    )
    files = [bench, ROOT / "regs/generated/card_tables.v"]
    subprocess.run(["iverilog", "-g2005", "-o", tmp_path / "sim", *files], check=True, capture_output=True)
    done = subprocess.run([tmp_path / "sim"], capture_output=True, text=True, check=True)
    made = {int(number): int(value, 16) for number, value in map(str.split, done.stdout.splitlines())}
    rows = rows_after("### format", "| bit/s | 8N1 | 8N2 | 8E1 | 8O1 |")
    assert sorted(int(row[0]) for row in rows) == sorted(BAUDS) and len(rows) == 8
    for baud, *values in rows:
        for form, value in zip(("8N1", "8N2", "8E1", "8O1"), values, strict=True):
            switches = sum(int(on) << i for i, on in enumerate(BAUDS[int(baud)] + FORMS[form]))
            assert int(value.strip("`"), 16) == made[switches], (baud, form)
