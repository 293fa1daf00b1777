# SPDX-License-Identifier: Apache-2.0
"""Writes the view of a waveform for GTKWave, a .gtkw file.

    python -m sim.view.waves WAVE.fst [TOP]     default for TOP: rtu2fc

The whole card is grouped by line: pins, decoded bytes, states by name, candidate, commit and revoke, then
the mailbox and the firmware by function and register name. A single module shows its ports and its states.
A short list of patterns here selects the signals; names come from the waveform's own hierarchy, so that they
exist. `make waves TEST=name` runs this for every waveform that it keeps.
"""

from __future__ import annotations

import argparse
import fnmatch
import math
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

from vcd.gtkw import GTKWColor, GTKWSave

from regs.areas import STRIDE
from regs.generated.mailbox import AREAS, BASE, FRAMES, REGISTERS
from rtl.command import run_main
from sim.view.wave_file import Signal, WaveFile

ROOT = Path(__file__).resolve().parents[2]
ELF = ROOT / "build/firmware.elf"

# Data formats by pyvcd's names.
HEX, DECIMAL, BIT, ASCII = "hex", "dec", "bin", "ascii"

# Colour of a row by its meaning, the first that fits its signal.
COLOURS = (
    (re.compile(r"(revoke|_flaw|_bad|fault|_red)$"), "red"),
    (re.compile(r"(_rx|_tx|_de|line|_green)$"), "green"),
    (re.compile(r"(candidate|commit|committed|licensed|_good|_queued|_start|answerable)$"), "blue"),
    (re.compile(r"state_name$"), "orange"),
)
VALUE, OTHER = "yellow", "violet"  # rows of bytes and numbers; all others

WINDOW_FRAMES = 7  # GTKWave's zoom counts in frames of 200 pixels


@dataclass(frozen=True)
class Entry:
    """Selects signals: the first pattern that matches, and its shortest match.

    A `*` matches any text, including levels of hierarchy. `every`: all matches, not only the shortest.
    `names`: shows addresses as function or register.
    """

    patterns: tuple[str, ...]
    form: str = BIT
    alias: str = ""
    every: bool = False
    names: bool = False

    def find(self, signals: dict[str, Signal]) -> list[Signal]:
        for pattern in self.patterns:
            fitting = sorted(fnmatch.filter(signals, pattern), key=lambda name: (len(name), name))
            if fitting:
                return [signals[name] for name in (fitting if self.every else fitting[:1])]
        return []


@dataclass(frozen=True)
class Row:
    """One line of a view."""

    signal: Signal
    form: str
    alias: str
    names: bool

    @property
    def colour(self) -> str:
        fitting = (colour for pattern, colour in COLOURS if pattern.search(self.signal.leaf))
        return next(fitting, OTHER if self.form == BIT else VALUE)


def bit(*patterns: str, alias: str = "") -> Entry:
    return Entry(patterns, BIT, alias)


def number(*patterns: str, alias: str = "") -> Entry:
    return Entry(patterns, DECIMAL, alias)


def states(pattern: str) -> Entry:
    return Entry((pattern,), ASCII, every=True)


def line(port: str, pins: str) -> list[Entry]:
    """One side of the card; both sides have the same signals."""
    return [
        *(bit(f"{pins}_{pin}") for pin in ("rx", "tx", "de")),
        bit(f"{port}.line", alias="rx filtered"),
        Entry((f"{port}.*frame_text",), ASCII, "frame"),
        Entry((f"{port}.*last_byte",), HEX, every=True),
        states(f"{port}.*state_name"),
        bit(f"{port}*parity_flaw", alias="parity error"),
        bit(f"{port}*framing_flaw", alias="framing error"),
        number(f"{port}*silence_i.halves", alias="silence, half characters"),
        bit(f"{port}*short_reached", alias="short silence"),
        bit(f"{port}*long_reached", alias="long silence"),
    ]


CARD: dict[str, list[Entry]] = {
    "network line": [
        *line("network_i", "modbus"),
        number("network_i*rtu_rx_i.length", alias="bytes received"),
        bit("network_i*crc_good", alias="CRC good"),
    ],
    "commit gate": [
        *(bit(name) for name in ("candidate", "commit", "revoke")),
        Entry(("mailbox_i*.ticket",), HEX, "ticket"),
        *(
            bit(f"mailbox_i*.{name}")
            for name in ("is_candidate", "is_committed", "reply_queued", "answerable")
        ),
        bit("reply_start", alias="reply starts"),
        *(bit(f"mailbox_i*.{name}") for name in ("telegram_queued", "licensed")),
        bit("telegram_start", alias="telegram starts"),
    ],
    "drive line": [
        *line("drive_i", "drive"),
        bit("drive_listening", "drive_i*listening", alias="listening"),
        bit("drive_candidate", alias="reply candidate"),
        bit("drive_good", alias="reply good"),
        bit("drive_bad", alias="reply bad"),
    ],
    "mailbox and firmware": [
        # For every core: the address on its bus is a function during a fetch, and a register during an access
        # to the mailbox. A core that shows its program counter has a row of its own.
        Entry(("core_i*.dbg_insn_addr", "core_i*.fetch_addr", "core_addr"), HEX, "function", names=True),
        Entry(("core_addr",), HEX, "bus", names=True),
        bit("core_valid", alias="access"),
        bit("core_ready", alias="done"),
        Entry(("core_wstrb",), HEX, "bytes written"),
        Entry(("core_wdata",), HEX, "written"),
        Entry(("core_rdata",), HEX, "read"),
        states("mailbox_i*state_name"),
        bit("mailbox_i*.telegram_touched"),
        bit("core_rst", alias="core reset"),
        bit("fault"),
    ],
    "LEDs": [bit(f"led_{line}_{colour}") for line in ("modbus", "drive") for colour in ("red", "green")],
}


def module_entries(top: str) -> dict[str, list[Entry]]:
    """Ports of a single module, in the order of its source, and every state, byte and frame below it."""
    folders = (ROOT / name for name in ("rtl", "regs/generated", "sim/harness", "tb/rtl"))
    path = next((path for folder in folders for path in folder.rglob(f"{top}.v")), None)
    if path is None:
        return {}
    ports = re.findall(r"^\s*(?:input|output)\s+(?:wire|reg)\s*(\[[^\]]*\])?\s*(\w+)", path.read_text(), re.M)
    return {
        "ports": [Entry((name,), HEX if bits else BIT) for bits, name in ports],
        "states": [
            states("*state_name"),
            Entry(("*last_byte",), HEX, every=True),
            Entry(("*frame_text",), ASCII, every=True),
        ],
    }


def rows(entries: Iterable[Entry], signals: dict[str, Signal]) -> list[Row]:
    found: list[Row] = []
    for entry in entries:
        for signal in entry.find(signals):
            if any(row.signal == signal for row in found):
                continue
            alias = entry.alias
            if entry.every and "." in signal.name:
                what = signal.leaf.removesuffix("_name").removesuffix("_text").removeprefix("last_")
                alias = signal.name.split(".")[-2].removesuffix("_i") + " " + what
            found.append(Row(signal, entry.form, alias, entry.names))
    return found


def missing(top: str, signals: dict[str, Signal]) -> list[str]:
    """Entries of the whole card's list without a signal: the list is out of date."""
    if top != "rtu2fc":
        return []
    entries = [entry for group in CARD.values() for entry in group]
    return [entry.patterns[0] for entry in entries if not entry.find(signals)]


# ---------------------------------------------------------------- addresses by name
def register_names() -> dict[int, str]:
    """Maps each word address on the core's bus to its registers or frame bytes."""
    names: dict[int, list[str]] = {}
    for name, register in REGISTERS.items():
        names.setdefault(BASE + register.offset // STRIDE * STRIDE, []).append(name)
    for name, area in AREAS.items():
        for i in range(area.length):
            index = f"[{i}]" if area.length > 1 else ""
            names.setdefault(FRAMES + area.at(i) // STRIDE * STRIDE, []).append(name + index)
    return {address: " ".join(known) for address, known in names.items()}


def function_names(elf: Path = ELF) -> dict[int, str]:
    """Maps the address of each instruction to its function in the source, inlined or not."""
    if not elf.exists():
        return {}
    tool = "riscv64-unknown-elf-"
    end = next(
        int(text.split()[0], 16)
        for text in subprocess.check_output([f"{tool}nm", elf], text=True).splitlines()
        if text.endswith(" _image_end")
    )
    addresses = [f"{address:08X}" for address in range(0, end, 4)]
    lines = subprocess.check_output([f"{tool}addr2line", "-f", "-e", elf, *addresses], text=True).splitlines()
    found = {int(address, 16): lines[2 * n].split(".")[0] for n, address in enumerate(addresses)}
    return {address: name for address, name in found.items() if name != "??"}


def write_names(folder: Path, names: dict[int, str]) -> Path:
    """Writes GTKWave's filter file, which shows an address as a name."""
    filter_file = folder / "firmware.txt"
    filter_file.write_text("".join(f"{value:08X} {name}\n" for value, name in names.items()))
    return filter_file


# ---------------------------------------------------------------- the view
def gtkwave_view(dump: Path, groups: dict[str, list[Row]], span: float, names: Path | None) -> str:
    text = StringIO()
    view = GTKWSave(text)
    view.comment("GTKWave save file")
    view.dumpfile(str(dump))
    view.timestart(0)
    view.size(1800, 1000)
    view.sst_expanded(False)
    view.signals_width(200)
    # The whole run: minus the binary logarithm of time units a frame.
    view.zoom_markers(-math.log2(max(1.0, span / WINDOW_FRAMES)))
    for group, found in groups.items():
        with view.group(group):
            for row in found:
                view.trace(
                    row.signal.path + row.signal.bits,
                    alias=row.alias,
                    color=GTKWColor[row.colour],
                    datafmt=row.form,
                    translate_filter_file=str(names) if row.names and names else None,
                )
    return text.getvalue()


def save_file(dump: Path, top: str, elf: Path = ELF) -> Path:
    """Writes the view beside the dump."""
    wave = WaveFile(dump)
    entries = CARD if top == "rtu2fc" else module_entries(top)
    groups = {name: rows(group, wave.signals) for name, group in entries.items()}
    groups = {name: found for name, found in groups.items() if found}
    for pattern in missing(top, wave.signals):
        print(f"waves: {dump.name} has no signal {pattern}", file=sys.stderr)
    names = None
    if top == "rtu2fc":
        names = write_names(dump.parent, function_names(elf) | register_names())
    view = dump.with_suffix(".gtkw")
    view.write_text(gtkwave_view(dump, groups, wave.span, names))
    return view


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dump", type=Path, help="waveform: FST, or VCD")
    parser.add_argument("top", nargs="?", default="rtu2fc", help="its top module")
    args = parser.parse_args()
    if not args.dump.is_file():
        raise RuntimeError(f"{args.dump} does not exist")
    view = save_file(args.dump.resolve(), args.top)
    command = ["gtkwave", str(args.dump), str(view)]
    if shutil.which("gtkwave") and os.environ.get("DISPLAY"):
        return subprocess.call(command)
    print(" ".join(command))
    return 0


if __name__ == "__main__":
    run_main("waves", main, RuntimeError)
