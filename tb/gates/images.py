# SPDX-License-Identifier: Apache-2.0
"""The finished image of a board as the whole card: its netlist, and the world outside its pins.

Switches close to ground and LEDs are connected to 3.3 V or to ground, as the names of the wrapper's ports say.
The benches of the whole card thus see the image through the wrapper's polarities and its pins.
"""

from __future__ import annotations

from pathlib import Path

from constraints import image
from constraints.boards import CARD, Board, ports
from constraints.synth import build
from rtl.sources import ROOT
from tb.gates import gowin, ice40
from tb.gates.gowin import first_bits, vector

BUILD = ROOT / "build/gates"
READERS = {"gowin": gowin.verilog, "ice40": ice40.verilog}


def finished(entry: Board) -> Path:
    """The bitstream with the default firmware; built unless there is one of these sources."""
    if not image.up_to_date(entry):
        build(entry)
    return image.BUILD / entry.name / f"firmware{image.result_suffix(entry)}"


def around(entry: Board) -> str:
    """A module with the card's name and ports around a board without a reset pin."""
    card, board = ports(CARD), first_bits(ports(entry.wrapper))
    declared = ", ".join(f"{way} wire {vector(port, card)}" for port, way in first_bits(card).items())
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


def sources(entry: Board, bitstream: Path, name: str = "") -> list[Path]:
    """Files of the image as the whole card, named by the board unless there is a `name`."""
    BUILD.mkdir(parents=True, exist_ok=True)
    paths = [BUILD / f"{name or entry.name}{part}.v" for part in ("", "-around")]
    for path, text in zip(paths, (READERS[entry.family](entry, bitstream), around(entry)), strict=True):
        path.write_text(text)
    return paths
