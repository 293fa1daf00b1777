# SPDX-License-Identifier: Apache-2.0
"""The routed netlist of a MachXO2 board as Verilog, with all content out of the decoded flash file.

No tool turns the switches of a MachXO2 back into nets. The nets are therefore those that nextpnr writes
beside its text configuration. The `.jed` is decoded into such a configuration. The content of the block RAMs
is from there, and each look-up table and each flip-flop of the netlist is compared with its slice there.
"""

from __future__ import annotations

import itertools
import json
import re
import shutil
from functools import cache
from pathlib import Path

from constraints import flow, image
from constraints.boards import Board, ports, vector, whole_ports
from constraints.flow import place_and_route
from rtl.sources import ROOT
from tb.gates.netlists import block_ram

BEL = re.compile(r"X(\d+)/Y(\d+)/SLICE([A-D])\.(K|FF)([01])")
FUSES = re.compile(r"^L000000\n([01\n]+)\*", re.MULTILINE)
TILE = re.compile(r"^\.tile (R\d+C\d+):PLC\n((?:.+\n)*)", re.MULTILINE)
CONTENT = re.compile(r"^\.bram_init (\d+)\n((?:[0-9a-f]{3}[ \n])+)", re.MULTILINE)
# Before the preamble stands a comment, which may be empty.
HEADER = b"\xff\x00\x00\xff"
# Words of nine bits of a block RAM; INITVAL_00 to INITVAL_1F have two of them in 20 bits.
BRAM_WORDS, ROWS, ROW_BITS, PAIR_BITS = 1024, 32, 320, 20
# Settings without bits, which the decoder does not name. A clock enable without a wire is 1.
CLEAR = {"REGSET": ("SET",), "SD": ("1",), "CEMUX": ("CE", "1")}
ORDERS = tuple(itertools.permutations(range(4)))


def decoded(entry: Board, flash: Path) -> str:
    """The text configuration out of a .jed."""
    fuses = FUSES.search(flash.read_text())[1].replace("\n", "")
    stream = bytes(int(fuses[at : at + 8], 2) for at in range(0, len(fuses), 8))
    again, config = flash.with_suffix(".again.bit"), flash.with_suffix(".again.config")
    again.write_bytes(HEADER + stream)
    image.tool("yowasp-xo2unpack", again, config)
    return config.read_text()


def routed(entry: Board) -> dict:
    """The netlist of the finished design; nextpnr runs again, because `make synth` keeps no netlist."""
    folder = flow.BUILD / entry.name
    design = (folder / f"{entry.top}.config").read_bytes()
    shutil.copyfile(folder / f"{entry.top}.json", folder / "netlist.json")
    output = (folder / "netlist.routed").relative_to(ROOT)
    for seed in entry.seeds:
        place_and_route(entry, folder, "netlist", seed, ["--write", str(output)])
        if (folder / "netlist.config").read_bytes() == design:
            (module,) = json.loads((ROOT / output).read_text())["modules"].values()
            return module
    raise image.ImageError(f"no seed gives the finished design of {entry.name} again")


@cache
def orders_of(init: int) -> frozenset[int]:
    """This look-up table with its inputs in every order: the router may exchange them."""
    return frozenset(
        sum(
            (init >> sum((row >> at & 1) << to for at, to in enumerate(order)) & 1) << row
            for row in range(16)
        )
        for order in ORDERS
    )


class Slices:
    """Look-up tables and flip-flops of a text configuration by their place."""

    def __init__(self, config: str):
        self.tiles = {
            tile: dict(re.findall(r"^(?:word|enum): (\S+) (\S+)$", body, re.MULTILINE))
            for tile, body in TILE.findall(config)
        }

    def differs(self, name: str, cell: dict) -> str | None:
        """How a look-up table or a flip-flop of the netlist differs from its place in the configuration."""
        x, y, letter, kind, number = BEL.fullmatch(cell["attributes"]["NEXTPNR_BEL"]).groups()
        found = self.tiles.get(f"R{y}C{int(x) + 1}", {})
        has = cell["parameters"]
        if kind == "K":
            init = found.get(f"SLICE{letter}.K{number}.INIT", "1" * 16)
            return None if int(init, 2) in orders_of(int(has["INITVAL"], 2)) else f"{name}: table {init}"
        wanted = {f"REG{number}.REGSET": has["REGSET"], f"REG{number}.SD": has["SD"], "CEMUX": has["CEMUX"]}
        for setting, value in wanted.items():
            default = CLEAR[setting.split(".")[-1]]
            there = found.get(f"SLICE{letter}.{setting}", default[0])
            if there != value.strip() and not (there in default and value.strip() in default):
                return f"{name}: {setting} is {there}"
        return None


def block_rams(config: str) -> list[list[int]]:
    """Content of the block RAMs in the order of their numbers."""
    found = {int(number): text.split() for number, text in CONTENT.findall(config)}
    return [[int(word, 16) for word in found[number]] for number in sorted(found)]


def initial_words(cell: dict) -> list[int]:
    """Content of a block RAM of the netlist."""
    rows = (cell["parameters"].get(f"INITVAL_{row:02X}", "0").replace("x", "0") for row in range(ROWS))
    bits = sum(int(row, 2) << at * ROW_BITS for at, row in enumerate(rows))
    return [bits >> at // 2 * PAIR_BITS + at % 2 * 9 & 0x1FF for at in range(BRAM_WORDS)]


def initvals(words: list[int]) -> str:
    """Parameters of the model with this content."""
    bits = sum(word << at // 2 * PAIR_BITS + at % 2 * 9 for at, word in enumerate(words))
    rows = [bits >> row * ROW_BITS & (1 << ROW_BITS) - 1 for row in range(ROWS)]
    return ", ".join(f".INITVAL_{row:02X}(320'h{value:080x})" for row, value in enumerate(rows))


class Writer:
    """Each cell as Verilog of simple assignments."""

    def __init__(self, contents: dict[str, list[int]]):
        self.contents = contents
        self.registers: set[int] = set()
        self.lines: list[str] = []

    def net(self, cell: dict, port: str, absent: str = "") -> str:
        bits = cell["connections"].get(port) or [absent]
        if bits == [""]:
            raise image.ImageError(f"{port} of a {cell['type']} is open")
        return f"n{bits[0]}" if isinstance(bits[0], int) else bits[0]

    def write_trellis_comb(self, name: str, cell: dict) -> None:
        init, has = int(cell["parameters"]["INITVAL"], 2), cell["parameters"].get("MODE", "LOGIC")
        if has != "LOGIC":
            raise image.ImageError(f"{name}: a look-up table as {has}")
        bits = []
        for at, port in enumerate("ABCD"):
            needed = any((init >> row ^ init >> (row ^ 1 << at)) & 1 for row in range(16))
            bits.append(self.net(cell, port, "" if needed else "1'b1"))
        if cell["connections"]["F"]:
            table = f"T{len(self.lines)}"
            self.lines.append(
                f"  localparam [15:0] {table} = 16'h{init:04x};\n"
                f"  assign {self.net(cell, 'F')} = {table}[{{{', '.join(reversed(bits))}}}];\n"
            )

    def write_trellis_ff(self, name: str, cell: dict) -> None:
        has = {key: value.strip() for key, value in cell["parameters"].items()}
        known = {"CLKMUX": "CLK", "LSRMUX": "LSR", "SRMODE": "LSR_OVER_CE"}
        if any(has.get(key, value) != value for key, value in known.items()):
            raise image.ImageError(f"{name}: a flip-flop with {has}")
        enable = {
            "1": lambda: "1'b1",
            "CE": lambda: self.net(cell, "CE"),
            "INV": lambda: f"!{self.net(cell, 'CE')}",
        }
        value = f"1'b{int(has['REGSET'] == 'SET')}"
        (register,) = cell["connections"]["Q"]
        self.registers.add(register)
        clear = self.net(cell, "LSR", "1'b0")
        q, data = f"n{register}", self.net(cell, "DI" if has["SD"] == "1" else "M")
        self.lines.append(
            f"  initial {q} = {value};\n  always @(posedge {self.net(cell, 'CLK')})"
            f" if ({clear}) {q} <= {value};"
            f" else if ({enable[has['CEMUX']]()}) {q} <= {data};\n"
        )

    def write_dcca(self, name: str, cell: dict) -> None:
        self.lines.append(f"  assign {self.net(cell, 'CLKO')} = {self.net(cell, 'CLKI')};\n")

    def write_trellis_io(self, name: str, cell: dict) -> None:
        way = cell["parameters"]["DIR"]
        pin = self.net(cell, "B")
        if way == "INPUT":
            self.lines.append(f"  assign {self.net(cell, 'O')} = {pin};\n")
        elif way == "OUTPUT" and not cell["connections"].get("T"):
            self.lines.append(f"  assign {pin} = {self.net(cell, 'I')};\n")
        else:
            raise image.ImageError(f"{name}: a pad as {way}")

    def write_dp8kc(self, name: str, cell: dict) -> None:
        has = [
            f".{key}({int(value, 2)})" if key.startswith("DATA_WIDTH") else f'.{key}("{value}")'
            for key, value in cell["parameters"].items()
            if not key.startswith("INITVAL")
        ]
        pins = [f".{port}({self.net(cell, port)})" for port, bits in cell["connections"].items() if bits]
        content = initvals(self.contents[name])
        number = len(self.lines)
        self.lines.append(
            f"  DP8KC #({', '.join([*has, content])}) block_ram_{number} ({', '.join(pins)});\n"
        )


def contents_of(entry: Board, module: dict, config: str) -> dict[str, list[int]]:
    """Content in the image of each block RAM of the netlist, which the words of the design locate."""
    design = (flow.BUILD / entry.name / f"{entry.top}.config").read_text()
    pairs = list(zip(block_rams(design), block_rams(config), strict=True))
    found = {}
    for name, cell in module["cells"].items():
        if cell["type"] == "DP8KC":
            places = [new for old, new in pairs if old == initial_words(cell)]
            if len(places) != 1:
                raise image.ImageError(f"{name}: {len(places)} block RAMs of the image have its words")
            (found[name],) = places
    return found


def verilog(entry: Board, bitstream: Path) -> str:
    """The routed netlist as a module with the name and the ports of the board's wrapper."""
    module, config = routed(entry), decoded(entry, bitstream.with_suffix(".jed"))
    slices = Slices(config)
    writer = Writer(contents_of(entry, module, config))
    wrong = []
    for name, cell in module["cells"].items():
        if BEL.fullmatch(cell["attributes"]["NEXTPNR_BEL"]):
            wrong.append(slices.differs(name, cell))
        getattr(writer, f"write_{cell['type'].lower()}")(name, cell)
    if wrong := [line for line in wrong if line]:
        raise image.ImageError(f"the image differs from its netlist: {'; '.join(wrong[:5])}")
    ways = ports(entry.wrapper)
    nets = {bit for cell in module["cells"].values() for bits in cell["connections"].values() for bit in bits}
    declared = "".join(f"  {'reg' if net in writer.registers else 'wire'} n{net};\n" for net in sorted(nets))
    joined = ""
    for port, way in whole_ports(ways).items():
        numbers = [int(bit[len(port) + 1 : -1]) for bit in ways if bit.startswith(f"{port}[")]
        for number, bit in enumerate(module["ports"][port]["bits"], min(numbers, default=0)):
            pin = f"{port}[{number}]" if numbers else port
            joined += f"  assign n{bit} = {pin};\n" if way == "input" else f"  assign {pin} = n{bit};\n"
    header = ", ".join(f"{way} wire {vector(port, ways)}" for port, way in whole_ports(ways).items())
    text = f"module {entry.top} ({header});\n{declared}{''.join(writer.lines)}{joined}endmodule\n"
    return text + block_ram()
