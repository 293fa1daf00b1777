# SPDX-License-Identifier: Apache-2.0
"""Converts both lines of a waveform to a small VCD file, for sigrok-cli and programs of logic analysers.

    python -m sim.view.lines_vcd WAVE.fst LINES.vcd

Channels: modbus and drive are the wires with both directions. Each direction alone is master and card_modbus,
drive_unit and card_drive. One sample is a microsecond: sigrok is fast then, 115200 bit/s still has 8 samples
a bit, and sample numbers are the log's times.
"""

from __future__ import annotations

import argparse
import heapq
from collections.abc import Iterator
from pathlib import Path

from vcd import VCDWriter

from rtl.command import run_main
from sim.view.wave_file import WaveFile

LINES = {"modbus": "master", "drive": "drive_unit"}  # line and its other end
PINS = ("rx", "tx", "de")
CHANNELS = [*LINES, *(name for line, far in LINES.items() for name in (far, f"card_{line}"))]
SAMPLE_S = 1e-6
END_SAMPLES = 10_000  # silence that ends the last frame


def _channels(pins: dict[str, str]) -> dict[str, str]:
    """A 0 from either end wins; while the card's driver is on, its receive pin has its own output."""
    shown = {}
    for line, far in LINES.items():
        driving = pins[f"{line}_de"] == "1"
        own = "0" if driving and pins[f"{line}_tx"] == "0" else "1"
        heard = pins[f"{line}_rx"]
        shown[line] = "0" if "0" in (own, heard) else "1"
        shown[far] = "1" if driving else heard
        shown[f"card_{line}"] = own
    return shown


def samples(wave: WaveFile) -> Iterator[tuple[int, dict[str, str]]]:
    """Sample number and levels of all channels, at each change."""
    names = [f"{line}_{pin}" for line in LINES for pin in PINS]
    missing = [name for name in names if name not in wave.signals]
    if missing:
        raise RuntimeError(f"no signal {missing[0]}: this is no waveform of a whole card")
    pins = {name: "0" if name.endswith("_de") else "1" for name in names}
    at = 0
    for time, name, level in heapq.merge(*([(t, name, v) for t, v in wave.changes(name)] for name in names)):
        now = round(time / SAMPLE_S)
        if now != at:
            yield at, _channels(pins)
            at = now
        pins[name] = level if level in ("0", "1") else pins[name]
    yield at, _channels(pins)


def write_vcd(wave: Path, vcd: Path) -> None:
    at, file_of_wave = 0, WaveFile(wave)
    with vcd.open("w") as file:
        writer = VCDWriter(file, timescale="1 us", date="")
        channels = {name: writer.register_var("card", name, "wire", size=1, init="1") for name in CHANNELS}
        for at, levels in samples(file_of_wave):
            for name, level in levels.items():
                writer.change(channels[name], at, level)
        writer.close(at + END_SAMPLES)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wave", type=Path, help="waveform of a whole card, FST or VCD")
    parser.add_argument("vcd", type=Path, help="file to write")
    args = parser.parse_args()
    if not args.wave.is_file():
        raise RuntimeError(f"{args.wave} does not exist")
    write_vcd(args.wave, args.vcd)


if __name__ == "__main__":
    run_main("lines_vcd", main, OSError, RuntimeError)
