# SPDX-License-Identifier: Apache-2.0
"""`rtu2fc scan`: rate, format and unit of a bus that one does not know. It only listens and reads."""

from __future__ import annotations

import argparse
import itertools
import math
import re
import time

from .card import DRIVE_TIMEOUT, NO_ANSWER_PAGE, OUTSIDE_ONLY
from .crc16 import crc_good
from .port import Line, SerialPort
from .problem import DONE, NoAnswer, Problem
from .rtu import build, parse, read_registers
from .screen import Screen

# The usual ones first: from the factory, then those of most masters.
BAUDS = (9600, 19200, 4800, 2400, 1200, 300)
FORMS = ("8N2", "8E1", "8O1")
FIRST_UNITS = 10
LISTEN_S = 1.5
ANSWER_S = 0.06  # of a request that needs no drive, beside the characters and t3.5


def units_of(text: str) -> list[int]:
    """`1-10,17`."""
    found: list[int] = []
    for part in text.split(","):
        ends = re.fullmatch(r"(\d+)(?:-(\d+))?", part.strip())
        low, high = (int(ends[1]), int(ends[2] or ends[1])) if ends else (0, 0)
        if not 1 <= low <= high <= 247:
            raise Problem(f"units are 1 to 247, such as 1-10,17; not '{text}'")
        found += range(low, high + 1)
    return found


def frames_in(heard: bytes) -> list[bytes]:
    """Good frames anywhere in the bytes: an adapter shows no silences."""
    found, at = [], 0
    while at + 4 <= len(heard):
        ends = (end for end in range(at + 5, min(len(heard), at + 256) + 1) if crc_good(heard[at:end]))
        end = next(ends, 0)
        found += [heard[at:end]] if end else []
        at = end or at + 1
    return found


class Scan:
    def __init__(self, args: argparse.Namespace, screen: Screen) -> None:
        self.args, self.screen = args, screen
        self.found: list[dict] = []

    def line(self, baud: int, form: str) -> Line | None:
        """None if the port does not take the setting, as a pty takes no parity."""
        try:
            return Line(SerialPort(self.args.port, baud, form), baud, form)
        except Problem as problem:
            if "refuses" not in str(problem):
                raise
            self.screen.say(f"{baud:6} {form}  {problem}", "dim")
            return None

    def listen(self) -> bool:
        """Whether another master is heard. Then nothing is sent."""
        heard_any = False
        for baud in BAUDS:
            line = self.line(baud, "8N2")
            if line is None:
                continue
            heard, until = b"", time.monotonic() + LISTEN_S
            while (left := until - time.monotonic()) > 0:
                heard += line.port.read(left)
            line.close()
            if not heard and not heard_any:
                return False  # at a wrong rate there would be wrong bytes
            heard_any = True
            if units := sorted({frame[0] for frame in frames_in(heard)}):
                said = ", ".join(map(str, units))
                self.screen.say(f"{baud:6}      traffic of another master with unit {said}", "green")
                self.screen.say("The parity cannot be heard: an adapter takes any. Ask with the master off.")
                self.found += [{"baud": baud, "unit": unit, "heard": True} for unit in units]
                return True
        raise NoAnswer(
            "bytes are heard, but no good frame at any rate",
            "Another protocol, noise, or A and B are swapped: swap them at the master.",
        )

    def ask(self, baud: int, form: str, units: list[int]) -> None:
        line = self.line(baud, form)
        if line is None:
            return
        wait_s = line.t35_s + 8 * line.character_s + ANSWER_S
        for unit in units:
            frame = build(unit, read_registers(DRIVE_TIMEOUT, 1))
            heard, _ = line.exchange(frame, wait_s, 0.05)
            if heard.startswith(frame):  # the echo of the adapter
                heard = heard[len(frame) :]
            if len(heard) >= 5 and crc_good(heard) and parse(heard).address == unit:
                self.screen.say(f"{baud:6} {form}  unit {unit} answers", "green")
                self.found.append({"baud": baud, "format": form, "unit": unit, "heard": False})
            elif heard:
                self.screen.say(f"{baud:6} {form}  unit {unit}: damaged answer {heard[:12].hex(' ')}")
        line.close()


def scan(args: argparse.Namespace, screen: Screen) -> int:
    scan = Scan(args, screen)
    screen.result["found"] = scan.found  # grows, and is shown after Ctrl-C too
    bauds = [args.baud] if args.baud else BAUDS
    forms = [args.format] if args.format else FORMS
    if args.units:
        groups = [units_of(args.units)]
    else:
        groups = [list(range(1, FIRST_UNITS + 1)), list(range(FIRST_UNITS + 1, 248))]
    settings = list(itertools.product(bauds, forms))
    heard = scan.listen()
    for units in groups:
        if heard or (scan.found and not args.all):
            break
        minutes = sum(len(units) * (ANSWER_S + 0.05 + 25 * 11 / baud) for baud, _ in settings) / 60
        screen.say(f"asks units {units[0]}-{units[-1]}, at most {math.ceil(minutes)} min", "dim")
        for baud, form in settings:
            if args.all or not scan.found:
                scan.ask(baud, form, units)
    if not scan.found:
        raise NoAnswer("nobody answers at any rate, format and unit", OUTSIDE_ONLY, f"Read: {NO_ANSWER_PAGE}")
    answers = [one for one in scan.found if not one["heard"]]
    if answers:
        one = answers[0]
        options = f"--baud {one['baud']} --format {one['format']} --unit {one['unit']}"
        screen.say(f"go on: rtu2fc status {args.port} {options}")
    return DONE
