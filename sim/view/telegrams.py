# SPDX-License-Identifier: Apache-2.0
"""Prints the FC telegrams of a waveform or a logic analyser's file, one a line, by sigrok-cli.

    python -m sim.view.telegrams FILE [--channel NAME] [--invert yes] [--baud N] [--drive NAME] [--fields]

FILE is a waveform of the whole card (.fst) or any file that sigrok-cli reads (.sr, .vcd). The channel carries
both directions. Times are in seconds from the start of the file. `!` marks warnings. Bad input, or a rate at
which no telegram is complete, gives one line and exit code 2. If all telegrams have a wrong BCC it is 1.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from rtl.command import Parser, run_main, stop_printing
from sim.view.lines_vcd import write_vcd

ROOT = Path(__file__).resolve().parents[2]
DECODERS = ROOT / "sim/view/sigrok"
# Rows of the decoder: how a line of each begins.
MARKS = {"Telegrams": "", "Warnings": "! ", "Fields": "    "}
MICROSECONDS = 1e6
# How a telegram begins that is complete, though not good.
BAD, COMPLETE = "Bad: ", "Bad: BCC "


class InputError(Exception):
    """Bad input; the text is one line."""


def sigrok_cli(*options: object) -> str:
    done = subprocess.run(
        ["sigrok-cli", *map(str, options)],
        env=os.environ | {"SIGROKDECODE_DIR": str(DECODERS), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        said = done.stderr.strip().splitlines() or ["no reason given"]
        raise InputError(f"sigrok-cli says: {said[0].removeprefix('Error: ')}")
    return done.stdout


def shown(file: Path, channel: str, invert: bool, baud: int, drive: str) -> list[tuple[float, str, str]]:
    """Time in seconds, row and text of every annotation, in order of time."""
    channels = re.findall(r"^- (.+): logic$", sigrok_cli("-i", file, "--show"), re.MULTILINE)
    if channel not in channels:
        raise InputError(f"no channel {channel}; there are {', '.join(channels) or 'none'}")
    uart = f"uart:rx={channel}:baudrate={baud}:parity=even" + (":invert_rx=yes" if invert else "")
    stack = ("-P", f"{uart},vltfc:drive={drive}", "-A", "vltfc", "--protocol-decoder-jsontrace")
    said = sigrok_cli("-i", file, *stack)
    events = json.loads(said)["traceEvents"] if said else []  # nothing at all from an idle line
    begun = [(e["ts"] / MICROSECONDS, e["tid"], e["name"]) for e in events if e["ph"] == "B"]
    order = list(MARKS)
    return sorted(begun, key=lambda entry: (entry[0], order.index(entry[1])))


def annotations(args: argparse.Namespace) -> list[tuple[float, str, str]]:
    drives = sorted(path.stem for path in (ROOT / "sim/drive").glob("*.csv"))
    if args.drive not in drives:
        raise InputError(f"no drive {args.drive}; choose one of {', '.join(drives)}")
    if not 300 <= args.baud <= 115200:
        raise InputError(f"{args.baud} bit/s is not within 300 and 115200")
    if args.file.is_dir():
        raise InputError("is a folder, not a file")
    if not args.file.is_file():
        raise InputError("no such file")
    if shutil.which("sigrok-cli") is None:
        raise InputError("sigrok-cli is not here; run `make setup`")
    if args.file.suffix != ".fst":
        return shown(args.file, args.channel, args.invert == "yes", args.baud, args.drive)
    with tempfile.TemporaryDirectory() as folder:
        lines = Path(folder) / "lines.vcd"
        try:
            write_vcd(args.file, lines)
        except (KeyError, RuntimeError) as error:  # no signals of a card, no waveform
            raise InputError(error.args[0]) from error
        return shown(lines, args.channel, args.invert == "yes", args.baud, args.drive)


def main() -> int:
    parser = Parser(prog="telegrams", description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path, metavar="FILE", help=".fst, .sr, .vcd")
    parser.add_argument("--channel", default="drive", help="of both directions; default: drive")
    invert = {"nargs": "?", "const": "yes", "default": "no", "choices": ("yes", "no")}
    parser.add_argument("--invert", **invert, help="the line is low when idle")
    parser.add_argument("--baud", type=int, default=9600, help="bit/s of the line; default: 9600")
    parser.add_argument("--drive", default="vlt6000", help="whose names and bits; default: vlt6000")
    parser.add_argument("--fields", action="store_true", help="the fields of each telegram, too")
    args = parser.parse_args()
    try:
        entries = annotations(args)
    except (InputError, OSError) as error:
        print(f"telegrams: {args.file}: {error}", file=sys.stderr)
        return 2
    rows = [f"{t:10.4f}  {MARKS[row]}{text}" for t, row, text in entries if row != "Fields" or args.fields]
    telegrams = [text for _, row, text in entries if row == "Telegrams"]
    good = any(not text.startswith(BAD) for text in telegrams)
    where = f"on {args.channel} at {args.baud} bit/s 8E1"
    if not good and not any(text.startswith(COMPLETE) for text in telegrams):
        print(f"telegrams: {args.file}: no whole telegram {where}; try --baud or --invert", file=sys.stderr)
        return 2
    try:
        print("\n".join(rows), flush=True)
    except BrokenPipeError:  # the reader of the output has stopped
        stop_printing()
    if not good:
        print(f"telegrams: {args.file}: no good telegram {where}; each BCC is wrong", file=sys.stderr)
    return 0 if good else 1


if __name__ == "__main__":
    run_main("telegrams", main)
