# SPDX-License-Identifier: Apache-2.0
"""The command line of `rtu2fc`.

Exit codes: 0 done; 1 a cross, a failed test, or a motor that does not run;
2 wrong option or file; 3 no such port, or it is busy; 4 no good answer;
5 refused by the card or the drive; 6 another dialect; 130 Ctrl-C.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import signal
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from . import VERSION, check, commands, decode, grade, scan, watch
from .card import Card
from .dialects import DIALECTS
from .drives import DRIVES
from .port import Line, Replay, SerialPort
from .problem import FAILED, MISUSE, STOPPED, NoAnswer, Problem
from .screen import Screen
from .switches import BAUDS, FORMS

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Parser(argparse.ArgumentParser):
    """One line for a wrong option, and exit code 2. A decimal comma makes no option of a negative number."""

    def __init__(self, **options: object) -> None:
        super().__init__(**options)
        self._negative_number_matcher = re.compile(r"-(\d+|\d*[.,]\d+)$")

    def error(self, message: str) -> None:
        self.exit(MISUSE, f"{self.prog}: {message}\n")


def fitting(convert: Callable, fits: Callable, what: str) -> Callable[[str], object]:
    def read(text: str) -> object:
        with contextlib.suppress(ValueError):
            if fits(value := convert(text)):
                return value
        raise argparse.ArgumentTypeError(f"{what}, not '{text}'")

    return read


def number(low: int, high: int, what: str) -> Callable[[str], int]:
    def convert(text: str) -> int:
        return int(text, 16 if text[:2].lower() == "0x" else 10)

    return fitting(convert, lambda value: low <= value <= high, f"{what} is {low} to {high}")


def decimal(fits: Callable[[float], bool], what: str) -> Callable[[str], float]:
    return fitting(lambda text: float(text.replace(",", ".")), fits, what)


def one_of(values: tuple, what: str) -> Callable[[str], object]:
    known = {str(value).lower(): value for value in values}
    named = f"{what} is {', '.join(map(str, values))}"
    return fitting(lambda text: known.get(text.lower()), lambda value: value is not None, named)


seconds = decimal(lambda value: 0 < value < 1e9, "seconds are above 0")
percent = decimal(lambda value: -199 <= value <= 199, "the reference is -199 to 199 %")


def output(text: str) -> Path:
    """A file that is written at the end, perhaps hours later: it is opened now, and left as it is."""
    path = Path(text)
    there = path.exists()
    try:
        path.open("a").close()
    except OSError as error:
        raise argparse.ArgumentTypeError(f"{path}: {error.strerror}") from None
    if not there:
        path.unlink()
    return path


def yes_no(text: str) -> bool:
    return one_of(("yes", "no"), "the answer")(text) == "yes"


baud, form = one_of(tuple(BAUDS), "the rate"), one_of(tuple(FORMS), "the format")
unit = number(1, 247, "the unit")
dialect = one_of(("auto", *DIALECTS), "the dialect")


def drive_option(parser: argparse.ArgumentParser) -> None:
    names = one_of(("auto", *sorted(DRIVES)), "the drive")
    parser.add_argument("--drive-type", dest="drive", metavar="NAME", type=names, default="auto",
                        help=f"whose parameters and words: {', '.join(sorted(DRIVES))}")  # fmt: skip


def slave_options() -> argparse.ArgumentParser:
    """Of every command that talks to a slave."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("port", help="port of the EIA-485 adapter: COM3, /dev/ttyUSB0")
    parser.add_argument("--unit", type=unit, default=1, help="Modbus address, switches 1-8; default: 1")
    parser.add_argument("--baud", type=baud, default=9600, help="baud switches 1-3; default: 9600")
    parser.add_argument("--format", type=form, default="8N2", help="baud switches 4-5; default: 8N2")
    parser.add_argument("--record", type=Path, metavar="FILE", help="all bytes and their times into a file")
    parser.add_argument("--replay", type=Path, metavar="FILE", help="a recorded line instead of the port")
    return parser


def card_options(slave: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """Of every command that talks to a card."""
    parser = argparse.ArgumentParser(add_help=False, parents=[slave])
    names = f"{', '.join(DIALECTS)}; default: auto"
    parser.add_argument("--dialect", type=dialect, default="auto", help=names)
    drive_option(parser)
    return parser


def build() -> argparse.ArgumentParser:
    parser = Parser(
        prog="rtu2fc",
        allow_abbrev=False,
        description="Asks, checks and watches a Modbus RTU card of a VLT drive.",
        epilog=__doc__.split("\n", 2)[2],
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"rtu2fc {VERSION}")
    shared = argparse.ArgumentParser(add_help=False)
    shared.add_argument("--json", action="store_true", help="one JSON object instead of text")
    every, slave = parser.add_subparsers(dest="command", metavar="COMMAND", required=True), slave_options()
    line = card_options(slave)

    def add(name: str, run: Callable, text: str, *of: argparse.ArgumentParser) -> argparse.ArgumentParser:
        one = every.add_parser(name, help=text, description=text, parents=[*of, shared], allow_abbrev=False)
        one.set_defaults(run=partial(on_line, run) if line in of else run)
        return one

    add("ports", commands.ports, "the serial ports of this computer")
    said = "control and status word in words, reference, output frequency, alarms"
    add("status", commands.status, said, line)

    said = "another reference; a running motor follows, after a question"
    start = add("start", commands.start, "starts the motor, after a question", line)
    for one in (start, add("reference", commands.reference, said, line)):
        one.add_argument("percent", type=percent, metavar="PERCENT", help="of the maximum reference")
        one.add_argument("--yes", action="store_true", help="no question")
    add("stop", commands.stop, "stops the motor by its ramp, and waits until it has stopped", line)
    add("coast", commands.coast, "lets the motor coast to a stop", line)
    add("reset", commands.reset, "resets a trip; stops a motor that runs", line)

    one = add("read", commands.read, "parameters of the drive, with unit and conversion", line)
    one.add_argument("parameters", nargs="+", metavar="PARAMETER", help="number, part of the name, or 615[2]")
    one = add("write", commands.write, "a parameter of the drive", line)
    one.add_argument("parameter", metavar="PARAMETER", help="number, part of the name, or 615[2]")
    one.add_argument("value", metavar="VALUE", help="in its unit, with decimals; or a text")
    one.add_argument("--store", action="store_true", help="into the drive's EEPROM too (coil 65)")
    one = add("watch", watch.watch, "parameters again and again: table, CSV, plot", line)
    one.add_argument("parameters", nargs="+", metavar="PARAMETER", help="number, part of the name, or 615[2]")
    one.add_argument("--every", type=seconds, default=1.0, metavar="S", help="seconds; default: 1")
    ever = float("inf")
    one.add_argument("--for", dest="seconds", type=seconds, default=ever, metavar="S", help="ends after S s")
    one.add_argument("--csv", type=Path, metavar="FILE", help="log of all values")
    one.add_argument("--plot", type=output, metavar="FILE.svg", help="picture of all values, at the end")
    one = add("parameters", commands.table, "the table of a drive's parameters, without a port")
    one.add_argument("word", nargs="?", default="", help="only those with this in number or name")
    drive_option(one)

    one = add("check", check.check, "a tick or a cross for each promise of the card; starts no motor", line)
    check.add_options(one, number, yes_no)
    one = add("decode", decode.decode, "a recording of a bus or of both lines in words, without a port")
    decode.add_options(one)
    one.add_argument("--baud", type=baud, help="of the network line; default: found")
    one.add_argument("--format", type=form, help="of the network line; default: found")
    one.add_argument("--dialect", type=dialect, default="auto", help="whose exceptions; default: card")
    drive_option(one)
    one = add("grade", graded, "the numbered tests of any Modbus RTU slave; they write", slave)
    grade.add_options(one, number, seconds, output)
    one = add("switches", commands.switch_positions, "the positions of the card's switches, as a picture")
    one.add_argument("baud", type=baud, help="bit/s")
    one.add_argument("format", type=form, help="data bits, parity, stop bits: 8N2")
    one.add_argument("unit", type=unit, help="Modbus address, 1 to 247")
    one = add("scan", scan.scan, "rate, format and unit of a bus that one does not know; it only reads")
    one.add_argument("port", help="port of the EIA-485 adapter")
    one.add_argument("--baud", type=baud, help="at this rate alone")
    one.add_argument("--format", type=form, help="in this format alone")
    one.add_argument("--units", metavar="1-10,17", help="these units alone; default: 1-10, then 11-247")
    one.add_argument("--all", action="store_true", help="go on after the settings of the first answer")
    one = add("simulate", commands.simulate, "the virtual card's program, where it is built")
    one.add_argument("--program", metavar="FILE", help="default: build/card")
    one.add_argument("options", nargs=argparse.REMAINDER, metavar="OPTION", help="of that program")
    return parser


def stop_command(args: argparse.Namespace) -> str:
    return f"rtu2fc stop {args.port} --unit {args.unit} --baud {args.baud} --format {args.format}"


def motor(card: Card, args: argparse.Namespace) -> str:
    return f"THE MOTOR MAY TURN. To stop it: {stop_command(args)}" if card.motor_may_turn else ""


def opened(args: argparse.Namespace) -> Line:
    if args.replay:
        return Replay(args.replay)
    return Line(SerialPort(args.port, args.baud, args.format), args.baud, args.format, args.record)


def graded(args: argparse.Namespace, screen: Screen) -> int:
    """Any slave, so without the dialects of the card."""
    grade.profile_of(args)  # a wrong option comes before a wrong port
    what = f"the tests write coils and registers of unit {args.unit}: a motor behind it may start"
    commands.agreed(args, what)
    behind = f"A motor behind unit {args.unit} may turn. To stop it: {stop_command(args)}"
    with contextlib.closing(opened(args)) as line:
        screen.motor = behind
        try:
            return grade.run(args, screen, line)
        except NoAnswer:  # before the first test: nothing was written
            screen.motor = ""
            raise


def on_line(run: Callable, args: argparse.Namespace, screen: Screen) -> int:
    """Opens the port, finds the dialect, and runs a command with the card."""
    line = opened(args)
    card = Card(line, args.unit, args.dialect, args.drive)
    card.motor_may_turn = run in (commands.stop, commands.coast, commands.reset)  # until it has stopped
    try:
        if run is not check.check:
            card.hello()
        code = run(args, screen, card)
        if said := motor(card, args):
            screen.say(said)
            screen.result["motor"] = said
        return code
    except BaseException:
        screen.motor = motor(card, args)
        raise
    finally:
        line.close()


def stop_by_signal(signum: int, frame: object) -> None:
    """The first signal ends the command; what must happen after it is not interrupted."""
    for one in SIGNALS:
        signal.signal(one, signal.SIG_IGN)
    raise KeyboardInterrupt("stopped by Ctrl-C" if signum == signal.SIGINT else "stopped by a signal")


def failed_output(args: argparse.Namespace, screen: Screen, error: OSError) -> int:
    """The exit code. Later lines go nowhere, so that they cannot fail again."""
    if not error.filename:
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        screen.as_json = False  # its only object is lost: the error goes to people
    if isinstance(error, BrokenPipeError):  # the reader has stopped, as `head` does
        return FAILED
    screen.problem(args.command, Problem(f"{error.filename or 'the output'}: {error.strerror}"))
    return MISUSE


def main(arguments: list[str] | None = None) -> int:
    parser, words = build(), sys.argv[1:] if arguments is None else arguments
    if not words:
        parser.print_help(sys.stderr)
        return MISUSE
    args = parser.parse_args(words)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the caller: `>&-`
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
    screen = Screen(args.json)
    before = {one: signal.signal(one, stop_by_signal) for one in SIGNALS}
    try:
        code = args.run(args, screen)
    except Problem as problem:
        code = problem.code
        screen.problem(args.command, problem)
    except KeyboardInterrupt as stopped:
        code = STOPPED
        screen.problem(args.command, Problem(str(stopped) or "stopped by Ctrl-C"))
    except OSError as error:  # a file that an option names, or the output
        code = failed_output(args, screen, error)
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
    if screen.motor:
        print(screen.motor, file=sys.stderr)
        screen.result["motor"] = screen.motor
    try:
        screen.finish(code)
    except OSError as error:
        code = failed_output(args, screen, error)
        if not screen.motor and "motor" in screen.result:
            print(screen.result["motor"], file=sys.stderr)
    return code
