# SPDX-License-Identifier: Apache-2.0
"""Both lines of a waveform as a small VCD file, for sigrok-cli and logic analysers' programs.

    python -m sim.view.lines_vcd WAVE.fst LINES.vcd

Channels: modbus and drive, the wires as everybody on them sees them, both directions; then each direction by
itself: master and card_modbus, drive_unit and card_drive. One sample is a microsecond: sigrok is quick then,
the wires of 115200 bit/s still have 8 samples a bit, and samples are numbered as the log counts time.
"""

from __future__ import annotations

import argparse
import heapq
import sys
from collections.abc import Iterator
from pathlib import Path

from sim.view.wave_file import WaveFile

LINES = {"modbus": "master", "drive": "drive_unit"}  # and who is at the other end
PINS = ("rx", "tx", "de")
CHANNELS = [*LINES, *(name for line, far in LINES.items() for name in (far, f"card_{line}"))]
SAMPLE_S = 1e-6
END_SAMPLES = 10_000  # of silence, so that the last frame ends


def _channels(pins: dict[str, str]) -> dict[str, str]:
    """Whoever pulls the pair low wins; while the card's driver is on, its pin hears itself."""
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
    """Sample number and level of every channel, whenever one changes."""
    names = [f"{line}_{pin}" for line in LINES for pin in PINS]
    missing = [name for name in names if name not in wave.signals]
    if missing:
        raise KeyError(f"no signal {missing[0]}: this is no waveform of a whole card")
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
    codes = {name: chr(ord("!") + number) for number, name in enumerate(CHANNELS)}
    before: dict[str, str] = {}
    with vcd.open("w") as file:
        file.write("$timescale 1 us $end\n$scope module card $end\n")
        file.writelines(f"$var wire 1 {codes[name]} {name} $end\n" for name in CHANNELS)
        file.write("$upscope $end\n$enddefinitions $end\n")
        for at, levels in samples(WaveFile(wave)):
            changed = [name for name in CHANNELS if levels[name] != before.get(name)]
            if changed:
                file.write(f"#{at}\n" + "".join(f"{levels[name]}{codes[name]}\n" for name in changed))
            before = levels
        file.write(f"#{at + END_SAMPLES}\n")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wave", type=Path, help="waveform of a whole card, FST or VCD")
    parser.add_argument("vcd", type=Path, help="file to write")
    args = parser.parse_args()
    if not args.wave.is_file():
        print(f"lines_vcd: {args.wave} is not there", file=sys.stderr)
        return 2
    try:
        write_vcd(args.wave, args.vcd)
    except (KeyError, OSError) as error:
        print(f"lines_vcd: {error.args[0] if isinstance(error, KeyError) else error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
