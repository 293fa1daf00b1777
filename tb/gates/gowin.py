# SPDX-License-Identifier: Apache-2.0
"""A finished bitstream of a Gowin board, back as Verilog: the image is simulated, not its source.

Project Apicula's database and its gowin_unpack name the cells and the switches that each bit sets. From them
comes a netlist of what reaches the output pins, with the ports' names of the pin file. Carry chains are taken
from the bits of their look-up tables, because gowin_unpack does not know every mode that the packer
writes. Three things are not read from the bits: block RAMs are 2048 words of nine bits that read the old word
while they write, an input without a switch is 0, and a flip-flop without a switched enable is enabled.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from apycula import chipdb, gowin_unpack
from apycula.bslib import read_bitstream

from constraints.boards import Board, package_folder, ports, vector, whole_ports
from constraints.image import ImageError

BYTE_BITS = 9
BRAM_BYTES = 2048
# A quarter of a block RAM's rows, by two bits of the address.
QUARTERS = {0x00: 0x00, 0x10: 0x80, 0x20: 0x40, 0x30: 0xC0}
BRAM_ROWS = 256
# The output of a look-up table of ones alone: none of its bits is set.
FULL_TABLE = re.compile(r"R\d+C\d+_F[0-7]")
# The carry into the first cell of a row, if no cell before it drives it; that cell does not use it.
CHAIN_START = re.compile(r"R\d+C\d+_CIN\d")
PAD = re.compile(r"IO([TBLR])(\d+)([AB])")


@dataclass
class Image:
    """Cells of a bitstream by the net that they drive, and the switches between nets."""

    driven_by: dict[str, str] = field(default_factory=dict)
    alias: dict[str, str] = field(default_factory=dict)
    cells: dict[str, tuple] = field(default_factory=dict)
    memories: dict[str, list[int]] = field(default_factory=dict)

    def root(self, net: str) -> str:
        """The net at the other end of the switches."""
        net, seen = self.alias.get(net, net), set()
        while net in self.driven_by:
            if net in seen:
                raise ImageError(f"the switches of {net} form a ring")
            seen.add(net)
            net = self.alias.get(self.driven_by[net], self.driven_by[net])
        return net

    def drive(self, net: str, *cell) -> None:
        self.cells[self.alias.get(net, net)] = cell


@cache
def database(die: str) -> chipdb.Device:
    return chipdb.load_chipdb(str(package_folder("apycula") / f"{die}.msgpack.xz"))


def memory(db: chipdb.Device, rows: list[list[int]], row: int, col: int) -> list[int]:
    """Content of a block RAM with nine-bit bytes; `rows` follow the grid in the bitstream."""
    top = sorted(db.simplio_rows).index(row) * BRAM_ROWS
    left = sum(db[0, number].width for number in range(col))
    lines = db.rev_logicinfo("BSRAM_INIT")
    content = []
    for byte in range(BRAM_BYTES):
        value = 0
        for bit in range(BYTE_BITS):
            # The parity bit has the address of the byte's last bit.
            address = byte * 8 + min(bit, 7)
            place = lines[(bit + BYTE_BITS * (byte % 2)) * 4 + (address >> 12)][0] - 1
            line = QUARTERS[address & 0x30] + (address >> 6 & 0x3F)
            value |= rows[top + BRAM_ROWS - 1 - line][left + place] << bit
        content.append(value)
    return content


def read(entry: Board, bitstream: Path) -> Image:
    """The cells and switches of a bitstream."""
    db, image = database(entry.gowin_die), Image()
    gowin_unpack._device = entry.gowin_die
    bits, *_ = read_bitstream(str(bitstream))
    if len(bits) != db.height + BRAM_ROWS * len(db.simplio_rows):
        raise ImageError(f"{bitstream}: {len(bits)} rows")
    for number, (_, wires) in enumerate(db.nodes.values()):
        for row, col, wire in wires:
            image.alias[f"R{row + 1}C{col + 1}_{wire}"] = f"node{number}"
    for row in range(1, db.rows + 1):
        for col in range(1, db.cols + 1):
            for n in "12":
                for wire, at in (("N", (-1, 0)), ("S", (1, 0)), ("W", (0, -1)), ("E", (0, 1))):
                    shared = f"R{row}C{col}_{'SN' if wire in 'NS' else 'EW'}{n}0"
                    name = chipdb.wire2global(row + at[0], col + at[1], db, f"{wire}1{n}1")
                    image.alias[name] = image.alias.get(shared, shared)
            # Each column is served by one of four spines, and the same bit selects it in each.
            for spine in range(32):
                image.alias[f"R{row}C{col}_SPINE{spine}"] = f"spines{spine // 4}"
    add_segments(image, db)
    tiles = chipdb.tile_bitmap(db, bits[: db.height])
    for (row, col), tile in tiles.items():
        bels, switches, clock_switches = gowin_unpack.parse_tile_(db, row, col, tile, tiles)
        for wire, source in (switches | clock_switches).items():
            target = chipdb.wire2global(row + 1, col + 1, db, wire)
            target = image.alias.get(target, target)
            if target in image.driven_by:
                raise ImageError(f"{target} is driven twice")
            image.driven_by[target] = chipdb.wire2global(row + 1, col + 1, db, source)
        add_cells(image, db, row, col, bels, bits[db.height :])
    return image


def add_segments(image: Image, db: chipdb.Device) -> None:
    """The long wires for signals with many users: columns, each tapped in every row of four tiles' width."""
    for (_, col, number), segment in db.segments.items():
        top, bottom = (segment[f"{end}_row"] for end in ("top", "bottom"))
        name, half = f"segment{top}.{col}.{number}", number // 4
        for row, wire in ((top, segment["top_wire"]), (bottom, segment["bottom_wire"])):
            image.alias[f"R{row + 1}C{col + 1}_{wire}"] = name
        for row in range(segment["min_y"], segment["max_y"] + 1):
            image.alias[f"R{row + 1}C{col + 1}_{'LT04' if half else 'LT01'}"] = name
            for tapped in range(segment["min_x"], segment["max_x"] + 1):
                tap = f"R{row + 1}C{tapped + 1}_LB{number}1"
                image.alias[tap] = f"R{row + 1}C{col + 1}_LBO{half}"


def add_cells(image: Image, db: chipdb.Device, row: int, col: int, bels: dict, brams: list) -> None:
    here = f"R{row + 1}C{col + 1}_"
    east = f"R{row + 1}C{col + 2}_"
    small_memory = "RAM16" in bels
    for bel, flags in bels.items():
        kind, number = re.fullmatch(r"([A-Z_]+?)(\d*)", bel).groups()
        if kind == "LUT" and not (small_memory and int(number) < 6):
            init = 0xFFFF - sum(1 << flag for flag in flags)
            inputs = [f"{here}{name}{number}" for name in "ABCD"]
            if f"ALU{number}" in bels:
                carry_in = f"{here}CIN{number}"
                image.drive(f"{here}F{number}", "SUM", init, *inputs, carry_in)
                carry = f"{east}CIN0" if number == "5" else f"{here}CIN{int(number) + 1}"
                image.drive(carry, "CARRY", init, *inputs, carry_in)
            else:
                image.drive(f"{here}F{number}", "LUT", init, *inputs)
        elif kind == "DFF" and not (small_memory and int(number) >= 4):
            pair = int(number) // 2
            control = [f"{here}{name}{pair}" for name in ("CLK", "CE", "LSR")]
            (mode,) = flags - {"SD"}
            data = f"{here}F{number}" if "SD" not in flags else f"{here}XD{number}"
            image.drive(f"{here}Q{number}", "DFF", mode, data, *control)
        elif kind == "BSRAM":
            wires = db[row, col].bels["BSRAM"].portmap
            named = {port: here + wire for port, wire in wires.items()}
            content = memory(db, brams, row, col)
            if any(content):
                image.memories[here] = content
            for bit in range(BYTE_BITS):
                image.drive(named[f"DO{bit}"], "BSRAM", here, bit, named)
        elif kind == "IOBA" or kind == "IOBB":
            wires = db[row, col].bels[bel].portmap
            if flags == {"IBUF"}:
                image.drive(here + wires["O"], "IBUF", (row, col, kind[-1]))
            elif flags == {"OBUF"}:
                image.drive(f"pad{row}.{col}{kind[-1]}", "OBUF", here + wires["I"])
    if small_memory:
        flags = bels["RAM16"]
        for bit in range(4):
            init = sum(1 << at for at in range(16) if at + 16 * bit not in flags)
            read = [f"{here}{name}0" for name in "ABCD"]
            write = [f"{here}{name}4" for name in "ABCD"]
            data, clock, enable = f"{here}{'ABCD'[bit]}5", f"{here}CLK2", f"{here}LSR2"
            image.drive(f"{here}F{bit}", "RAM", init, (read, write, data, clock, enable))
    if any(bel.startswith("LUT") for bel in bels):
        for pair in range(4):
            image.drive(
                f"{here}OF{2 * pair}",
                "MUX",
                f"{here}F{2 * pair}",
                f"{here}F{2 * pair + 1}",
                f"{here}SEL{2 * pair}",
            )
        for half in (0, 4):
            image.drive(
                f"{here}OF{half + 1}", "MUX", f"{here}OF{half + 2}", f"{here}OF{half}", f"{here}SEL{half + 1}"
            )
        image.drive(f"{here}OF3", "MUX", f"{here}OF5", f"{here}OF1", f"{here}SEL3")
        image.drive(f"{here}OF7", "MUX", f"{east}OF3", f"{here}OF3", f"{here}SEL7")


# ---------------------------------------------------------------- Verilog


def pad_place(db: chipdb.Device, pad: str) -> tuple[int, int, str]:
    """Row, column and side of a pad such as IOR17A."""
    edge, number, side = PAD.fullmatch(pad).groups()
    at = int(number) - 1
    row, col = {"T": (0, at), "B": (db.rows - 1, at), "L": (at, 0), "R": (at, db.cols - 1)}[edge]
    return row, col, side


def places(entry: Board) -> dict[str, tuple[int, int, str]]:
    """Where each port's pad is, by the board's pin file."""
    db = database(entry.gowin_die)
    package, variant, _ = db.packages[entry.part]
    pinout = db.pinout[variant][package]
    return {pin.port: pad_place(db, pinout[pin.site][0]) for pin in entry.pins()}


class Writer:
    """The part of an image that the output ports depend on, in the Verilog of simple assignments."""

    def __init__(self, image: Image, inputs: dict[tuple[int, int, str], str]):
        self.image, self.inputs = image, inputs
        self.names: dict[str, str] = {}
        self.waiting: list[str] = []
        self.declared: list[str] = []
        self.lines: list[str] = []
        self.memories: set[str] = set()
        self.tables = 0

    def net(self, wire: str) -> str:
        root = self.image.root(wire)
        if root in ("VCC", "VSS"):
            return "1'b1" if root == "VCC" else "1'b0"
        if root not in self.names:
            if FULL_TABLE.fullmatch(root) and root not in self.image.cells:
                return "1'b1"
            if CHAIN_START.fullmatch(root) and root not in self.image.cells:
                return "1'b0"
            if root not in self.image.cells:
                raise ImageError(f"nothing drives {root}")
            self.names[root] = f"n{len(self.names)}"
            self.waiting.append(root)
        return self.names[root]

    def write_all(self) -> None:
        while self.waiting:
            root = self.waiting.pop()
            kind, *rest = self.image.cells[root]
            self.declared.append(f"  {'reg' if kind == 'DFF' else 'wire'} {self.names[root]};\n")
            self.lines.append(getattr(self, f"write_{kind.lower()}")(self.names[root], *rest))

    def table(self, init: int, wires: list[str]) -> str:
        """A look-up table. An input that it does not depend on may be open, or on any wire."""
        levels = {"VCC": 1, "VSS": 0}
        fixed = {
            at: levels[root] for at, wire in enumerate(wires) if (root := self.image.root(wire)) in levels
        }
        rows = [row for row in range(16) if all(row >> at & 1 == level for at, level in fixed.items())]
        needed = [
            at
            for at in range(4)
            if at not in fixed and any((init >> row ^ init >> (row ^ 1 << at)) & 1 for row in rows)
        ]
        bits = ", ".join(
            self.net(wires[at]) if at in needed else f"1'b{fixed.get(at, 0)}" for at in reversed(range(4))
        )
        self.tables += 1
        self.declared.append(f"  localparam [15:0] T{self.tables} = 16'h{init:04x};\n")
        return f"T{self.tables}[{{{bits}}}]"

    def write_lut(self, name: str, init: int, *wires: str) -> str:
        return f"  assign {name} = {self.table(init, list(wires))};\n"

    def write_sum(self, name: str, init: int, *wires: str) -> str:
        return f"  assign {name} = {self.table(init, list(wires[:4]))} ^ {self.net(wires[4])};\n"

    def write_carry(self, name: str, init: int, *wires: str) -> str:
        # Without a carry to pass on, the four lowest bits choose by the first two inputs.
        chosen = self.table((init & 0xF) * 0x1111, list(wires[:4]))
        passed = self.table(init, list(wires[:4]))
        return f"  assign {name} = {passed} ? {self.net(wires[4])} : {chosen};\n"

    def write_mux(self, name: str, low: str, high: str, select: str) -> str:
        return f"  assign {name} = {self.net(select)} ? {self.net(high)} : {self.net(low)};\n"

    def write_ibuf(self, name: str, place: tuple[int, int, str]) -> str:
        if place not in self.inputs:
            raise ImageError(f"the image reads the pad at {place}, which is no port")
        return f"  assign {name} = {self.inputs[place]};\n"

    def write_dff(self, name: str, mode: str, data: str, clock: str, enable: str, clear: str) -> str:
        if mode not in ("DFF", "DFFR", "DFFS"):
            raise ImageError(f"a flip-flop of the kind {mode}")
        value = int(mode == "DFFS")
        load = f"if ({self.net(enable)}) {name} <= {self.net(data)};"
        if mode != "DFF":
            load = f"if ({self.net(clear)}) {name} <= 1'b{value}; else {load}"
        return f"  initial {name} = 1'b{value};\n  always @(posedge {self.net(clock)}) {load}\n"

    def write_ram(self, name: str, init: int, wires: tuple) -> str:
        read, write, data, clock, enable = wires
        read_at, write_at = (", ".join(self.net(wire) for wire in reversed(at)) for at in (read, write))
        return (
            f"  reg [15:0] M_{name} = 16'h{init:04x};\n  assign {name} = M_{name}[{{{read_at}}}];\n"
            f"  always @(posedge {self.net(clock)})"
            f" if ({self.net(enable)}) M_{name}[{{{write_at}}}] <= {self.net(data)};\n"
        )

    def write_bsram(self, name: str, here: str, bit: int, wires: dict[str, str]) -> str:
        block = f"B_{here.rstrip('_')}"
        text = f"  assign {name} = {block}_read[{bit}];\n"
        if here in self.memories:
            return text
        self.memories.add(here)
        if any(self.net(wires[f"BLKSEL{n}"])[0] != "1" for n in range(3)):
            raise ImageError(f"the block RAM at {here} is selected by a signal")
        at = ", ".join(self.net(wires[f"AD{n}"]) for n in range(13, 2, -1))
        data = ", ".join(self.net(wires[f"DI{n}"]) for n in range(8, -1, -1))
        clock, enable, write, clear = (self.net(wires[port]) for port in ("CLK", "CE", "WRE", "RESET"))
        content = self.image.memories.get(here, [0] * BRAM_BYTES)
        start = "".join(f"    {block}[{n}] = 9'h{value:03x};\n" for n, value in enumerate(content))
        return (
            f"  reg [8:0] {block}[0:{BRAM_BYTES - 1}];\n  reg [8:0] {block}_read = 9'd0;\n{text}"
            f"  wire [10:0] {block}_at = {{{at}}};\n  initial begin\n{start}  end\n"
            f"  always @(posedge {clock}) begin\n"
            f"    if ({clear}) {block}_read <= 9'd0;\n"
            f"    else if ({enable}) {block}_read <= {block}[{block}_at];\n"
            f"    if ({enable} && {write}) {block}[{block}_at] <= {{{data}}};\n  end\n"
        )


def verilog(entry: Board, bitstream: Path) -> str:
    """The image as a module with the name and the ports of the board's wrapper."""
    image, place, ways = read(entry, bitstream), places(entry), ports(entry.wrapper)
    writer = Writer(image, {place[port]: port for port, way in ways.items() if way == "input"})
    driven = ""
    for port, way in ways.items():
        if way == "output":
            row, col, side = place[port]
            cell = image.cells.get(f"pad{row}.{col}{side}")
            if cell is None:
                raise ImageError(f"the image does not drive the pad of {port}")
            driven += f"  assign {port} = {writer.net(cell[1])};\n"
    writer.write_all()
    declared = ", ".join(f"{way} wire {vector(port, ways)}" for port, way in whole_ports(ways).items())
    body = "".join(writer.declared + writer.lines)
    return f"module {entry.top} ({declared});\n{body}{driven}endmodule\n"
