# SPDX-License-Identifier: Apache-2.0
"""The finished image of a board as the whole card: its netlist, and the world outside its pins.

Switches close to ground, and LEDs are lit by a high or a low pin, as the names of the wrapper's ports say.
The benches of the whole card thus see the image through its pins and its polarities.
"""

from __future__ import annotations

import fcntl
import re
from functools import cache
from pathlib import Path

from constraints import flow, image
from constraints.boards import CARD, Board, ports, vector, whole_ports
from constraints.synth import build
from rtl.sources import ROOT
from tb.gates import gowin, ice40, machxo2

BUILD = ROOT / "build/gates"
READERS = {"gowin": gowin.verilog, "ice40": ice40.verilog, "machxo2": machxo2.verilog}
# A net that is a look-up table, and a row of a block RAM that is not empty, in the Verilog of the readers.
WRONG_TABLES = 8
TABLE = re.compile(r"(assign \w+ += )((?:/\* LUT [ \d]*\*/ (?=[^;]*\bn\d)[^;]*)|T\d+\[\{[^}]*\}\]);")
ROW = re.compile(r"(9'h|\.INIT\w+\(\d+'h)(\w*[1-9a-f]\w*)")


def finished(entry: Board) -> Path:
    """The bitstream with the present default firmware; the design is built unless it is of these sources."""
    output = flow.BUILD / entry.name / f"firmware{image.result_suffix(entry)}"
    if not flow.up_to_date(entry):
        build(entry)
    return image.make(entry, entry.firmware, output)


def around(entry: Board) -> str:
    """A module with the card's name and ports around a board without a reset pin."""
    card, board = ports(CARD), whole_ports(ports(entry.wrapper))
    declared = ", ".join(f"{way} wire {vector(port, card)}" for port, way in whole_ports(card).items())
    joined, inverted = [], ""
    for port, way in board.items():
        name = port.removesuffix("_n")
        if port == name:
            joined.append(f".{port}({port})")
        elif way == "input":
            joined.append(f".{port}(~{name})")
        else:
            joined.append(f".{port}({port})")
            inverted += f"  wire {port};\n  assign {name} = ~{port};\n"
    return (
        f"module rtu2fc #(parameter CLK_HZ = 0, parameter FIRMWARE_HEX = 0) ({declared});\n"
        f"{inverted}  {entry.top} board_i ({', '.join(joined)});\nendmodule\n"
    )


@cache
def netlist(entry: Board) -> Path:
    """The finished image as Verilog, with the name and the ports of the board's wrapper."""
    BUILD.mkdir(parents=True, exist_ok=True)
    path = BUILD / f"{entry.name}.v"
    with open(path.with_suffix(".lock"), "w") as lock:
        # Excludes the other pytest workers; the system releases the lock if this worker dies.
        fcntl.flock(lock, fcntl.LOCK_EX)
        text = READERS[entry.family](entry, finished(entry))
        # Another worker may be reading the file, which has the same content then.
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
    return path


def world(entry: Board) -> Path:
    """The file of `around`."""
    path, text = BUILD / f"{entry.name}-around.v", around(entry)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)
    return path


def with_wrong_tables(text: str) -> str:
    """With some look-up tables inverted, spread over the netlist. The examples do not see every one."""
    tables = list(TABLE.finditer(text))
    for match in reversed(tables[:: max(1, len(tables) // WRONG_TABLES)]):
        text = f"{text[: match.start()]}{match[1]}!({match[2]});{text[match.end() :]}"
    return text


def with_wrong_word(text: str) -> str:
    """With one bit of a block RAM changed, in a row that is not empty."""
    rows = list(ROW.finditer(text))
    match = rows[len(rows) // 2]
    wrong = f"{int(match[2], 16) ^ 1:0{len(match[2])}x}"
    return text[: match.start()] + match[1] + wrong + text[match.end() :]
