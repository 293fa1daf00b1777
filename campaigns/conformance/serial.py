# SPDX-License-Identifier: Apache-2.0
"""Grades a Modbus RTU slave on a serial port or a pty, by its bytes alone. Each test prints one line.

    python -m campaigns.conformance.serial --port /dev/ttyUSB0 --unit 1 --baud 19200 --format 8E1

The tests write --values to --register and change --coil. Exit 1 when a test fails, 2 when the slave does not
answer or an option is wrong. docs/guide/conformance.md explains the options and the tests.
"""

from __future__ import annotations

import argparse

from campaigns.conformance.cases import FUNCTIONS, REASONS, Profile, own_codes
from campaigns.conformance.engine import FAIL, HIDDEN, OWN_CODE, NoAnswer, Silence, Verdict, grade
from campaigns.conformance.ports import QUIET_S, ByteDriver, PortError, SerialPort
from rtl.command import Parser, run_main
from tb.agents.uart import Format

FORMATS = ("8E1", "8O1", "8N1", "8N2")
LONGEST_WAIT_S = 60.0
# Kinds of data: registers and coils are written, inputs are read.
KINDS = ("register", "coil", "input")
LIKELY = "check --unit, --baud, --format and the wires A and B; another program may have the port open"


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


def own_code(text: str) -> tuple[str, int]:
    """`reason=code`."""
    reason, _, code = text.partition("=")
    if reason not in REASONS:
        raise argparse.ArgumentTypeError(f"no reason {reason!r}; there are {', '.join(REASONS)}")
    return reason, number(1, 255)(code)


def options() -> argparse.ArgumentParser:
    address, value, count = number(0, 0xFFFF), number(0, 0xFFFF), number(1, 0x10000)
    usual, hexadecimal = Profile(), "0x{:04X},0x{:04X}".format
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
        default=sorted(usual.functions),
        help="functions of the slave (1,3,5,6,15,16); 2 and 4 have tests, too",
    )
    parser.add_argument(
        "--values",
        type=list_of(value),
        default=usual.values,
        help=f"two values that the registers keep ({hexadecimal(*usual.values)})",
    )
    for kind in KINDS:
        use, default = "read" if kind == "input" else "write", getattr(usual, f"{kind}s")
        parser.add_argument(f"--{kind}", type=address, default=0, help=f"first {kind} to {use}, on-wire (0)")
        parser.add_argument(
            f"--{kind}s", type=count, default=default, help=f"number of {kind}s to {use} ({default})"
        )
        parser.add_argument(
            f"--no-{kind}", type=address, default=0xFFF0, help=f"address without {kind} (0xFFF0)"
        )
    parser.add_argument(
        "--unknown", type=number(1, 127), default=45, help="a function that the slave does not have (45)"
    )
    parser.add_argument(
        "--own-codes",
        type=list_of(own_code),
        default=(),
        metavar="REASON=CODE,...",
        help=f"exception codes of the slave's own document, for {', '.join(REASONS)}",
    )
    return parser


def profile_of(given: argparse.Namespace) -> Profile:
    kinds = [name for kind in KINDS for name in (kind, f"{kind}s", f"no_{kind}")]
    return Profile(
        fmt=Format.named(given.baud, given.format),
        functions=frozenset(given.functions),
        own_codes=own_codes(dict(given.own_codes)),
        **{name: getattr(given, name) for name in ("unit", "values", "unknown", *kinds)},
    )


def main(arguments: list[str] | None = None) -> int:
    parser = options()
    given = parser.parse_args(arguments)
    if len(given.values) != 2 or given.values[0] == given.values[1]:
        parser.error("--values takes two values that differ")
    if given.unknown in given.functions:
        parser.error(f"--unknown {given.unknown} is one of --functions")
    if others := sorted(set(given.functions) - set(FUNCTIONS)):
        have = ", ".join(map(str, FUNCTIONS))
        parser.error(f"--functions: no tests of {', '.join(map(str, others))}; there are tests of {have}")
    if not frozenset(given.functions) & {1, 3}:
        parser.error("--functions names neither 1 nor 3, so nothing can be read")
    if not (0 < given.timeout <= LONGEST_WAIT_S and 0 < given.gap <= LONGEST_WAIT_S):
        parser.error(f"--timeout and --gap must be more than 0 and at most {LONGEST_WAIT_S:g} s")
    for kind in KINDS:
        first, count = getattr(given, kind), getattr(given, f"{kind}s")
        use = "read" if kind == "input" else "write"
        if first + count > 0x10000:
            parser.error(f"--{kind} {first} and --{kind}s {count} go beyond address 65535")
        if first <= getattr(given, f"no_{kind}") < first + count:
            parser.error(f"--no-{kind} {getattr(given, f'no_{kind}')} is one of those to {use}")

    def show(verdict: Verdict) -> None:
        if verdict.outcome != HIDDEN:
            print(f"{verdict.outcome:10} {verdict.number:6} {verdict.text}".rstrip(), flush=True)

    with SerialPort(given.port, given.baud, given.format) as port:
        driver = ByteDriver(port, given.baud, given.timeout, given.gap)
        try:
            verdicts = grade(driver, profile_of(given), each=show)
        except Silence as silence:
            raise NoAnswer(f"{silence}; {LIKELY}") from None
    failed = [verdict for verdict in verdicts if verdict.outcome == FAIL]
    hidden = sum(verdict.outcome == HIDDEN for verdict in verdicts)
    own = sum(verdict.outcome == OWN_CODE for verdict in verdicts)
    with_own = f"{own} with the slave's own code; " if own else ""
    print(f"{len(failed)} failed; {with_own}{hidden} tests need the pins (docs/guide/conformance.md)")
    return 1 if failed else 0


if __name__ == "__main__":
    run_main("conformance", main, PortError, NoAnswer)
