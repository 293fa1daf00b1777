#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes a GTKWave save file for the waveform of a test, so that it opens readable.

The whole card is grouped by line: pins, decoded bytes, receiver and sender by state name, candidate, commit
and revoke, then mailbox accesses by register name and the firmware by function name. A single module shows
its ports and its state. `make waves TEST=name` calls this for every waveform that it keeps.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tb.generated.mailbox import AREAS, BASE, FRAMES, REGISTERS, STRIDE

ROOT = Path(__file__).resolve().parents[1]
ELF = ROOT / "build/firmware.elf"

# Trace flags of GTKWave (analyzer.h).
BIT, HEX, DECIMAL, ASCII = 0x28, 0x22, 0x24, 0x820
FILE_FILTER, GROUP_BEGIN, GROUP_END = 0x2000, 0x800200, 0x1000200

CORE = "core_i.core_i.dbg_insn_addr[31:0]"
WORD = "core_addr[31:0]"
WINDOW_FRAMES = 7  # GTKWave's zoom counts in frames of 200 pixels

# Flags, name below the top, and what to call it if that is not clear from the name.
Signal = tuple[int, str] | tuple[int, str, str]


def line_signals(port: str, pins: str, frames_in: str, frames_out: str) -> list[Signal]:
    """One side of the card; both have the same shape."""
    return [
        (BIT, f"{pins}_rx"),
        (BIT, f"{pins}_tx"),
        (BIT, f"{pins}_de"),
        (BIT, f"{port}.line", "rx filtered"),
        (ASCII, f"{port}.uart_i.state_name[47:0]", "bit"),
        (HEX, f"{port}.uart_i.last_byte[7:0]", "last byte"),
        (BIT, f"{port}.rx_parity_error", "parity error"),
        (BIT, f"{port}.rx_framing_error", "framing error"),
        (DECIMAL, f"{port}.silence_i.halves[2:0]", "silence, half characters"),
        (BIT, f"{port}.short_reached", "short silence"),
        (BIT, f"{port}.long_reached", "long silence"),
        (ASCII, f"{port}.{frames_in}", "frame in"),
        (ASCII, f"{port}.{frames_out}", "frame out"),
    ]


CARD = {
    "network line": [
        *line_signals("network_i", "modbus", "rtu_rx_i.state_name[55:0]", "rtu_tx_i.state_name[63:0]"),
        (DECIMAL, "network_i.rtu_rx_i.length[8:0]", "bytes received"),
        (BIT, "network_i.crc_good", "CRC good"),
    ],
    "commit gate": [
        (BIT, "candidate"),
        (BIT, "commit"),
        (BIT, "revoke"),
        (HEX, "mailbox_i.ticket[3:0]"),
        (BIT, "mailbox_i.is_candidate", "is candidate"),
        (BIT, "mailbox_i.is_committed", "is committed"),
        (BIT, "mailbox_i.reply_queued", "reply queued"),
        (BIT, "mailbox_i.gate_i.answerable"),
        (BIT, "reply_start", "reply starts"),
        (BIT, "mailbox_i.telegram_queued", "telegram queued"),
        (BIT, "mailbox_i.gate_i.licensed"),
        (BIT, "telegram_start", "telegram starts"),
    ],
    "drive line": [
        *line_signals("drive_i", "drive", "fc_rx_i.state_name[31:0]", "fc_tx_i.state_name[39:0]"),
        (BIT, "drive_listening", "listening"),
        (BIT, "drive_candidate", "reply candidate"),
        (BIT, "drive_good", "reply good"),
        (BIT, "drive_bad", "reply bad"),
    ],
    "mailbox": [
        (BIT, "core_valid", "access"),
        (HEX, "core_wstrb[3:0]", "bytes written"),
        (HEX, WORD, "address"),
        (HEX, "core_wdata[31:0]", "written"),
        (BIT, "core_ready", "done"),
        (HEX, "core_rdata[31:0]", "read"),
        (BIT, "mailbox_i.telegram_touched", "telegram touched"),
    ],
    "firmware": [
        (HEX, CORE, "function"),
        (BIT, "core_rst", "reset"),
        (BIT, "fault"),
        (DECIMAL, "ticks[7:0]", "1/1200 s"),
        (BIT, "led_modbus_red"),
        (BIT, "led_modbus_green"),
        (BIT, "led_drive_red"),
        (BIT, "led_drive_green"),
    ],
}


def port_signals(top: str) -> dict[str, list[Signal]]:
    """Ports and state of a single module, from its source."""
    path = next((p for p in (ROOT / f"rtl/{top}.v", ROOT / f"tb/hdl/{top}.v") if p.exists()), None)
    if path is None:
        return {}
    source = path.read_text()
    ports = re.findall(r"(?:input|output)\s+(?:wire|reg)\s*(\[\s*(\d+)\s*:\s*(\d+)\s*\])?\s*(\w+)", source)
    signals = [(HEX, f"{name}[{high}:{low}]") if bits else (BIT, name) for bits, high, low, name in ports]
    state = re.search(r"reg \[8\*(\d+)-1:0\] state_name", source)
    if state:
        signals.append((ASCII, f"state_name[{8 * int(state[1]) - 1}:0]"))
    return {top: signals}


def register_names() -> dict[str, str]:
    """Word address, as GTKWave prints it, to what registers, or bytes of which frames, lie there."""
    names: dict[int, list[str]] = {}
    for name, register in REGISTERS.items():
        names.setdefault(BASE + register.offset // STRIDE * STRIDE, []).append(name)
    for name, area in AREAS.items():
        for i in range(area.length):
            index = f"[{i}]" if area.length > 1 else ""
            names.setdefault(FRAMES + area.at(i) // STRIDE * STRIDE, []).append(name + index)
    return {f"{address:08X}": " ".join(known) for address, known in names.items()}


def function_names() -> dict[str, str]:
    """Address of each instruction to the function it belongs to in the source, inlined or not."""
    if not ELF.exists():
        return {}
    tool = "riscv64-unknown-elf-"
    end = next(
        int(line.split()[0], 16)
        for line in subprocess.check_output([f"{tool}nm", ELF], text=True).splitlines()
        if line.endswith(" _image_end")
    )
    addresses = [f"{address:08X}" for address in range(0, end, 4)]
    lines = subprocess.check_output([f"{tool}addr2line", "-f", "-e", ELF, *addresses], text=True).splitlines()
    return {address: lines[2 * n].split(".")[0] for n, address in enumerate(addresses)}


def write_filter(path: Path, names: dict[str, str]) -> Path:
    path.write_text("".join(f"{value} {name}\n" for value, name in names.items()))
    return path


def whole_run(dump: Path) -> float:
    """GTKWave's zoom that shows all of a dump: minus the binary logarithm of time units a frame."""
    header = dump.read_bytes()[:25]  # FST: block type, length, start and end time
    start, end = struct.unpack(">QQ", header[9:25])
    return -math.log2(max(1, (end - start) / WINDOW_FRAMES))


def save_file(dump: Path, top: str) -> Path:
    """Writes the save file beside the dump."""
    groups = CARD if top == "rtu2fc" else port_signals(top)
    filters = {}
    if top == "rtu2fc":
        filters[WORD] = write_filter(dump.parent / "registers.txt", register_names())
        filters[CORE] = write_filter(dump.parent / "functions.txt", function_names())
    lines = [
        "[*] GTKWave save file",
        f'[dumpfile] "{dump}"',
        "[timestart] 0",
        "[size] 1800 1000",
        "[sst_expanded] 0",
        "[signals_width] 200",
        f"*{whole_run(dump):.6f} -1" + " -1" * 26,
    ]
    for group, signals in groups.items():
        lines += [f"@{GROUP_BEGIN:x}", f"-{group}"]
        for flags, signal, *alias in signals:
            if signal in filters:
                lines += [
                    f"@{flags | FILE_FILTER:x}",
                    f"^{list(filters).index(signal) + 1} {filters[signal]}",
                ]
            else:
                lines += [f"@{flags:x}"]
            lines += [f"+{{{alias[0]}}} {top}.{signal}" if alias else f"{top}.{signal}"]
        lines += [f"@{GROUP_END:x}", f"-{group}"]
    path = dump.with_suffix(".gtkw")
    path.write_text("\n".join(lines) + "\n")
    return path


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dump", type=Path, help="waveform of a test, FST")
    parser.add_argument("top", nargs="?", default="rtu2fc", help="its top module")
    args = parser.parse_args()
    if not args.dump.exists():
        print(f"waves: {args.dump} is not there", file=sys.stderr)
        return 2
    view = save_file(args.dump.resolve(), args.top)
    command = ["gtkwave", str(args.dump), str(view)]
    if shutil.which("gtkwave") and os.environ.get("DISPLAY"):
        return subprocess.call(command)
    print(" ".join(command))
    return 0


if __name__ == "__main__":
    sys.exit(main())
