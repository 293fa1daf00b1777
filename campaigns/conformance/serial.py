# SPDX-License-Identifier: Apache-2.0
"""Grades a Modbus RTU slave on a serial port or a pty, by its bytes alone. Each test prints one line.

    python -m campaigns.conformance.serial --port /dev/ttyUSB0 --unit 1 --baud 19200 --format 8E1

The tests write --values to --register and change --coil. Exit 1 when a test fails, 2 when the slave does not
answer or an option is wrong. docs/guide/conformance.md explains the options and the tests.
"""

from __future__ import annotations

import argparse

from campaigns.conformance.cases import Profile
from campaigns.conformance.engine import FAIL, HIDDEN, NoAnswer, Verdict, grade
from campaigns.conformance.ports import QUIET_S, ByteDriver, PortError, SerialPort
from rtl.command import Parser, run_main
from tb.agents.uart import Format

FORMATS = ("8E1", "8O1", "8N1", "8N2")
FUNCTIONS = (1, 3, 5, 6, 15, 16)
LONGEST_WAIT_S = 60.0


def number(low: int, high: int):
    """A number from low to high, in any notation of Python."""

    def parse(text: str) -> int:
        try:
            value = int(text, 0)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r} is no number") from None
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{value} is not from {low} to {high}")
        return value

    return parse


def list_of(one):
    """Numbers with commas between them."""
    return lambda text: tuple(one(part) for part in text.split(","))


def options() -> argparse.ArgumentParser:
    address, value = number(0, 0xFFFF), number(0, 0xFFFF)
    parser = Parser(prog="conformance", description=__doc__.splitlines()[0])
    parser.add_argument("--port", required=True, help="serial port or pty")
    parser.add_argument("--unit", type=number(1, 247), default=1, help="address of the slave (1)")
    parser.add_argument("--baud", type=number(300, 1_000_000), default=19200, help="bit/s (19200)")
    parser.add_argument("--format", choices=FORMATS, default="8E1", help="8E1; a pty takes 8N1 or 8N2 only")
    parser.add_argument("--timeout", type=float, default=0.5, help="longest wait for a reply in s (0.5)")
    parser.add_argument(
        "--gap", type=float, default=QUIET_S, help=f"silence in s that ends a reply ({QUIET_S})"
    )
    parser.add_argument(
        "--functions",
        type=list_of(number(1, 127)),
        default=FUNCTIONS,
        help="functions of the slave (1,3,5,6,15,16)",
    )
    parser.add_argument("--register", type=address, default=0, help="first register to write, on-wire (0)")
    parser.add_argument(
        "--registers", type=number(1, 123), default=2, help="number of registers to write (2)"
    )
    parser.add_argument(
        "--values",
        type=list_of(value),
        default=(0x12, 0x15),
        help="two values that these registers keep (18,21)",
    )
    parser.add_argument("--coil", type=address, default=0, help="first coil to write, on-wire (0)")
    parser.add_argument("--coils", type=number(1, 2000), default=8, help="number of coils to write (8)")
    parser.add_argument(
        "--no-register", type=address, default=0xFFF0, help="address without a register (0xFFF0)"
    )
    parser.add_argument("--no-coil", type=address, default=0xFFF0, help="address without a coil (0xFFF0)")
    parser.add_argument(
        "--unknown", type=number(1, 127), default=45, help="a function that the slave does not have (45)"
    )
    return parser


def profile_of(given: argparse.Namespace) -> Profile:
    names = ("unit", "register", "registers", "values", "coil", "coils", "no_register", "no_coil", "unknown")
    return Profile(
        fmt=Format.named(given.baud, given.format),
        functions=frozenset(given.functions) & frozenset(FUNCTIONS),
        **{name: getattr(given, name) for name in names},
    )


def main(arguments: list[str] | None = None) -> int:
    parser = options()
    given = parser.parse_args(arguments)
    if len(given.values) != 2 or given.values[0] == given.values[1]:
        parser.error("--values takes two values that differ")
    if given.unknown in given.functions:
        parser.error(f"--unknown {given.unknown} is one of --functions")
    if not frozenset(given.functions) & {1, 3}:
        parser.error("--functions names neither 1 nor 3, so nothing can be read")
    if not (0 < given.timeout <= LONGEST_WAIT_S and 0 < given.gap <= LONGEST_WAIT_S):
        parser.error(f"--timeout and --gap must be more than 0 and at most {LONGEST_WAIT_S:g} s")
    for kind in ("register", "coil"):
        first, count = getattr(given, kind), getattr(given, f"{kind}s")
        if first + count > 0x10000:
            parser.error(f"--{kind} {first} and --{kind}s {count} go beyond address 65535")
        if first <= getattr(given, f"no_{kind}") < first + count:
            parser.error(f"--no-{kind} {getattr(given, f'no_{kind}')} is one of those to write")

    def show(verdict: Verdict) -> None:
        if verdict.outcome != HIDDEN:
            print(f"{verdict.outcome:10} {verdict.number:6} {verdict.text}".rstrip(), flush=True)

    with SerialPort(given.port, given.baud, given.format) as port:
        verdicts = grade(ByteDriver(port, given.baud, given.timeout, given.gap), profile_of(given), each=show)
    failed = [verdict for verdict in verdicts if verdict.outcome == FAIL]
    hidden = sum(verdict.outcome == HIDDEN for verdict in verdicts)
    print(f"{len(failed)} failed; {hidden} tests need the pins (docs/guide/conformance.md)")
    return 1 if failed else 0


if __name__ == "__main__":
    run_main("conformance", main, PortError, NoAnswer)
