# SPDX-License-Identifier: Apache-2.0
"""A finished bitstream of an iCE40 board, back as Verilog: the image is simulated, not its source.

Project IceStorm's icebox_vlog writes look-up tables, flip-flops and pads as plain Verilog, block RAMs as
cells. The package of Yosys has the model of these cells. Pins are by the pin file.
"""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

from constraints import image
from constraints.boards import Board, ports, vector, whole_ports
from tb.gates.netlists import cells


def verilog(entry: Board, bitstream: Path) -> str:
    """The image as a module with the name and the ports of the board's wrapper."""
    text_form = bitstream.with_suffix(".unpacked")
    image.tool("yowasp-iceunpack", bitstream, text_form)
    # icebox_vlog knows no options of a pin.
    pins = bitstream.with_suffix(".pins")
    pins.write_text("".join(f"set_io {pin.port} {pin.site}\n" for pin in entry.pins()))
    package = entry.device[entry.device.index("--package") + 1]
    command = ["icebox_vlog", "-s", "-c", "-n", entry.top, "-p", pins, "-d", package, text_form]
    # It writes Python's sets in their order; with a fixed seed equal images give equal text.
    fixed = os.environ | {"PYTHONHASHSEED": "0"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=fixed)
    if done.returncode:
        raise image.ImageError(f"icebox_vlog: {done.stderr.strip().splitlines()[-1]}")
    return with_header(entry, done.stdout) + cells("ice40")


def with_header(entry: Board, text: str) -> str:
    """With the ports declared after the header: icebox_vlog declares them there and again as wires."""
    header = re.search(rf"^module {entry.top} \((.*)\);$", text, re.MULTILINE)
    wanted, found = ports(entry.wrapper), {}
    for port in header[1].split(","):
        direction, high, low, name = re.fullmatch(
            r"(\w+) (?:\[(\d+):(\d+)\] )?\\?(\w+)", port.strip()
        ).groups()
        bits = [f"{name}[{bit}]" for bit in range(int(low), int(high) + 1)] if high else [name]
        found |= dict.fromkeys(bits, direction)
    if found != wanted:
        raise image.ImageError(f"the image has other ports than {entry.wrapper.name}")
    names = whole_ports(wanted)
    declared = "".join(f"{way} {vector(name, wanted)};\n" for name, way in names.items())
    return text.replace(header[0], f"module {entry.top} ({', '.join(names)});\n{declared}")
