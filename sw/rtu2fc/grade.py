# SPDX-License-Identifier: Apache-2.0
"""`rtu2fc grade`: the numbered tests of a Modbus RTU slave, by its bytes alone; each test prints one line.

The tests write --values to --register and change --coil. docs/guide/testing.md explains them.
"""

from __future__ import annotations

import argparse
import html
import json
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict

from . import VERSION
from .cases import BYTES, CASES, FUNCTIONS, REASONS, Heard, Profile, Send, own_codes
from .engine import FAIL, HIDDEN, OWN_CODE, PASS, NoAnswer, Silence, Verdict, grade
from .line import Format
from .port import Line, written
from .problem import DONE, FAILED, Problem
from .screen import CROSS, NOT_ASKED, TICK, Screen

QUIET_S = 0.1  # silence that ends a reply: adapters and busy machines deliver a frame in pieces
LONGEST_WAIT_S = 60.0
# Kinds of data: registers and coils are written, inputs are read.
KINDS = ("register", "coil", "input")
MARKS = {PASS: TICK, OWN_CODE: TICK, FAIL: CROSS}
STYLE = """:root{color-scheme:light dark}
body{font:15px/1.4 sans-serif;margin:2em auto;max-width:70em;padding:0 1em}
table{border-collapse:collapse}td,th{border:1px solid #8888;padding:.2em .6em;text-align:left}
.fail{font-weight:bold;color:#d33}"""


class ByteDriver:
    """Whole frames on a line.

    timeout_s: longest wait for a reply. quiet_s: silence that ends a reply.
    """

    sees = frozenset({BYTES})

    def __init__(self, line: Line, timeout_s: float = 0.5, quiet_s: float = QUIET_S) -> None:
        self.line, self.timeout_s, self.quiet_s = line, timeout_s, quiet_s

    def exchange(self, send: Send) -> Heard:
        assert not send.needs_edges, "a port shows bytes only"
        return Heard(self.line.exchange(send.data, self.timeout_s, self.quiet_s, whole=False)[0])


# ---------------------------------------------------------------- options


def list_of(one: Callable) -> Callable[[str], tuple]:
    """Numbers with commas between them."""
    return lambda text: tuple(one(part) for part in text.split(","))


def own_code(number: Callable) -> Callable[[str], tuple[str, int]]:
    """`reason=code`."""

    def read(text: str) -> tuple[str, int]:
        reason, _, code = text.partition("=")
        if reason not in REASONS:
            raise argparse.ArgumentTypeError(f"no reason {reason!r}; there are {', '.join(REASONS)}")
        return reason, number(1, 255, "the code")(code)

    return read


def add_options(
    parser: argparse.ArgumentParser, number: Callable, seconds: Callable, output: Callable
) -> None:
    address, usual = number(0, 0xFFFF, "the number"), Profile()
    add = parser.add_argument
    add("--timeout", type=seconds, default=0.5, help="longest wait for a reply in s (0.5)")
    add("--gap", type=seconds, default=QUIET_S, help=f"silence in s that ends a reply ({QUIET_S})")
    functions, values = list_of(number(1, 127, "the function")), list_of(address)
    had = "functions of the slave (1,3,5,6,15,16); 2 and 4 have tests, too"
    add("--functions", type=functions, default=sorted(usual.functions), help=had)
    kept = "two values that the registers keep (0x{:04X},0x{:04X})".format(*usual.values)
    add("--values", type=values, default=usual.values, help=kept)
    for kind in KINDS:
        use, default = "read" if kind == "input" else "write", getattr(usual, f"{kind}s")
        add(f"--{kind}", type=address, default=0, help=f"first {kind} to {use}, on-wire (0)")
        count = f"number of {kind}s to {use} ({default})"
        add(f"--{kind}s", type=number(1, 0x10000, "the count"), default=default, help=count)
        add(f"--no-{kind}", type=address, default=0xFFF0, help=f"address without {kind} (0xFFF0)")
    unknown = "a function that the slave does not have (45)"
    add("--unknown", type=number(1, 127, "the function"), default=45, help=unknown)
    codes = f"exception codes of the slave's own document, for {', '.join(REASONS)}"
    add("--own-codes", type=list_of(own_code(number)), default=(), metavar="REASON=CODE,...", help=codes)
    add("--yes", action="store_true", help="no question")
    add("--report", type=output, metavar="FILE", help="a page (.html) or data (.json) with every test")


def profile_of(given: argparse.Namespace) -> Profile:
    """What the tests may use; Problem for options that do not go together."""
    if len(given.values) != 2 or given.values[0] == given.values[1]:
        raise Problem("--values takes two values that differ")
    if given.unknown in given.functions:
        raise Problem(f"--unknown {given.unknown} is one of --functions")
    if others := sorted(set(given.functions) - set(FUNCTIONS)):
        have = ", ".join(map(str, FUNCTIONS))
        raise Problem(f"--functions: no tests of {', '.join(map(str, others))}; there are tests of {have}")
    if not frozenset(given.functions) & {1, 3}:
        raise Problem("--functions names neither 1 nor 3, so nothing can be read")
    if max(given.timeout, given.gap) > LONGEST_WAIT_S:
        raise Problem(f"--timeout and --gap are at most {LONGEST_WAIT_S:g} s")
    if given.report and given.report.suffix not in (".html", ".json"):
        raise Problem(f"--report {given.report}: its name ends in .html or .json")
    for kind in KINDS:
        first, count, none = (getattr(given, name) for name in (kind, f"{kind}s", f"no_{kind}"))
        if first + count > 0x10000:
            raise Problem(f"--{kind} {first} and --{kind}s {count} go beyond address 65535")
        if first <= none < first + count:
            use = "read" if kind == "input" else "write"
            raise Problem(f"--no-{kind} {none} is one of those to {use}")
    kinds = [name for kind in KINDS for name in (kind, f"{kind}s", f"no_{kind}")]
    return Profile(
        fmt=Format.named(given.baud, given.format),
        functions=frozenset(given.functions),
        own_codes=own_codes(dict(given.own_codes)),
        **{name: getattr(given, name) for name in ("unit", "values", "unknown", *kinds)},
    )


# ---------------------------------------------------------------- report


def entries(verdicts: list[Verdict]) -> list[dict]:
    """Each test with its verdict."""
    cases = {case.number: case for case in CASES}
    words = ("page", "sent", "must", "must_not")
    return [
        asdict(verdict) | {word: getattr(cases[verdict.number], word) for word in words}
        for verdict in verdicts
    ]


def page(title: str, summary: str, found: list[dict]) -> str:
    head = ("number", "outcome", "text", "sent", "must", "must_not", "page")
    rows = [
        f"<tr class={one['outcome'].split()[0]}>"
        + "".join(f"<td>{html.escape(str(one[key]))}</td>" for key in head)
        for one in found
    ]
    names = "".join(f"<th>{name.replace('must_not', 'must not').replace('text', 'why')}" for name in head)
    return (
        f'<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f"<style>{STYLE}</style><h1>{html.escape(title)}</h1><p>{html.escape(summary)} rtu2fc {VERSION}. "
        'SL: "MODBUS over Serial Line" V1.02, AP: "MODBUS Application Protocol" V1.1b3, with their pages.</p>'
        f"<table><tr>{names}{''.join(rows)}</table></html>\n"
    )


def run(args: argparse.Namespace, screen: Screen, line: Line) -> int:
    profile, verdicts, ended = profile_of(args), [], None

    def show(verdict: Verdict) -> None:
        verdicts.append(verdict)
        if verdict.outcome != HIDDEN:
            mark = MARKS.get(verdict.outcome, NOT_ASKED)
            screen.row(mark, f"{verdict.outcome:8} {verdict.number:6} {verdict.text}".rstrip(), indent=18)

    try:
        grade(ByteDriver(line, args.timeout, args.gap), profile, each=show)
    except Silence as silence:
        raise NoAnswer(
            str(silence),
            "Check --unit, --baud, --format, and A and B at the master.",
            f"Rate, format or unit not known: rtu2fc scan {line.name}",
        ) from None
    except (KeyboardInterrupt, Problem) as reason:
        if not verdicts:
            raise
        ended = reason
    counts = Counter(one.outcome for one in verdicts)
    own = f"{counts[OWN_CODE]} with the slave's own code; " if counts[OWN_CODE] else ""
    summary = f"{counts[FAIL]} failed; {own}{counts[HIDDEN]} tests need the pins (docs/guide/testing.md)."
    if ended:
        summary = f"Ended after {len(verdicts)} of {len(CASES)} tests: {summary}"
    screen.say(summary)
    found = entries(verdicts)
    screen.result |= {"slave": f"unit {profile.unit}, {profile.fmt}", "failed": counts[FAIL], "tests": found}
    if args.report and not isinstance(ended, Problem):
        title = f"Modbus RTU slave, unit {profile.unit}, {profile.fmt}"
        is_page = args.report.suffix == ".html"
        data = page(title, summary, found) if is_page else json.dumps(screen.result, indent=1)
        with written(args.report):
            args.report.write_text(data, encoding="utf-8")
    if ended:
        raise ended
    return FAILED if counts[FAIL] else DONE
