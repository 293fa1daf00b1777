# SPDX-License-Identifier: Apache-2.0
"""Prints the log of a recording (.jsonl) as a table: frames of both lines and states of the LEDs.

    python -m sim.view.frames FILE [--frames] [--bad] [--bytes]

Columns: time in s of the frame's first start bit, silence in ms on its line before it, line, sender,
description. Damaged frames are marked BAD. --frames omits the LEDs, --bad prints only damaged frames,
--bytes adds each frame's bytes.
Exit code: 2 for a file that is not such a log.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from rtl.command import run_main, stop_printing


def table(
    entries: list[dict], frames_only: bool = False, bad_only: bool = False, with_bytes: bool = False
) -> Iterator[str]:
    yield f"{'time s':>9}  {'silence':>9}  {'line':<6}  {'from':<6}  says"
    ends: dict[str, float] = {}
    for entry in entries:
        if "led" in entry:
            if not (frames_only or bad_only):
                yield f"{entry['t']:9.4f}  {'':>9}  {entry['led']:<6}  {'LED':<6}  {entry['shows']}"
            continue
        line = entry["line"]
        silence = f"{1000 * (entry['t'] - ends[line]):.2f} ms" if line in ends else ""
        ends[line] = entry["end"]
        if bad_only and entry["ok"]:
            continue
        said = entry["what"] if entry["ok"] else f"BAD {entry['what']}"
        yield f"{entry['t']:9.4f}  {silence:>9}  {line:<6}  {entry['from']:<6}  {said}"
        if with_bytes:
            yield f"{'':37}{entry['bytes']}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path, metavar="FILE", help="the log of a recording, .jsonl")
    parser.add_argument("--frames", action="store_true", help="no LEDs")
    parser.add_argument("--bad", action="store_true", help="damaged frames only")
    parser.add_argument("--bytes", action="store_true", help="the bytes of each frame, too")
    args = parser.parse_args()
    try:
        entries = [json.loads(line) for line in args.file.read_text().splitlines()]
        rows = list(table(entries, args.frames, args.bad, args.bytes))
    except OSError as error:
        print(f"frames: {args.file}: {error.strerror}", file=sys.stderr)
        return 2
    except (ValueError, KeyError, TypeError):
        print(f"frames: {args.file} is no log of a recording (.jsonl)", file=sys.stderr)
        return 2
    try:
        print("\n".join(rows), flush=True)
    except BrokenPipeError:  # the reader of the output has stopped
        stop_printing()
    return 0


if __name__ == "__main__":
    run_main("frames", main)
