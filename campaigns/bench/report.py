# SPDX-License-Identifier: Apache-2.0
"""The tables of the bench, from the results of campaigns/bench/run.py."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from campaigns.bench.card import Build
from campaigns.bench.cases import CASES
from campaigns.bench.conformance import ROWS
from campaigns.bench.judge import (
    DE_LIMIT_BITS,
    LIMIT_BITS,
    LIMIT_RATIO,
    TELEGRAM_EARLY_BITS,
    WAIT_LIMIT_MS,
    Outcome,
    Sample,
    de_grain,
)
from campaigns.bench.wave import BAUDS
from campaigns.bench.work import FORM, Piece
from rtl.report_page import markdown
from tb.lib import bound
from tb.model.wire import LineFormat, drive_line

# Tables that go into docs/evidence.json.
REPORT_TABLES = (
    "The targets",
    "Turnaround, rate by rate",
    "Conformance",
    "Targets of the small card",
)
LOCAL = tuple(name for name, case in CASES.items() if case.local)
EXCHANGES = tuple(name for name, case in CASES.items() if not (case.local or case.to_all))
SHOWN_BAUD = 19200
OF_CASES = ("turnaround", "sizes", "phases")
JUDGED = (*OF_CASES, "random", "drive_faults", "gate", "overtaken", "conformance")


@dataclass
class Image:
    """Sizes of a card's firmware in bytes."""

    code: int
    data: int
    stack: int  # by the call graph
    stack_path: list[str]


@dataclass
class CardResults:
    """Data of one card."""

    config: str
    outcomes: dict[str, tuple[Piece, Outcome]]
    image: Image

    @property
    def clk_hz(self) -> int:
        return Build(self.config).clk_hz

    @property
    def stack_seen(self) -> int:
        return max((outcome.stack_bytes for _, outcome in self.outcomes.values()), default=0)

    def faults(self) -> list[str]:
        return [fault for _, outcome in self.outcomes.values() for fault in outcome.faults]


# ---------------------------------------------------------------- statistics


def samples(results: CardResults, kind: str | tuple[str, ...], **fits: object) -> list[Sample]:
    """Samples of one or several kinds of work; `fits` are required attributes, one or several values each."""
    kinds = kind if isinstance(kind, tuple) else (kind,)
    found = [
        sample
        for piece, outcome in results.outcomes.values()
        if piece.kind in kinds
        for sample in outcome.samples
    ]
    for attribute, wanted in fits.items():
        allowed = wanted if isinstance(wanted, tuple) else (wanted,)
        found = [sample for sample in found if getattr(sample, attribute) in allowed]
    return found


def values(found: Iterable[Sample], attribute: str) -> list[float]:
    return [value for sample in found if (value := getattr(sample, attribute)) is not None]


def span(numbers: list[float], digits: int = 2) -> str:
    """Minimum to maximum."""
    return f"{min(numbers):.{digits}f} … {max(numbers):.{digits}f}" if numbers else "-"


def middle_and_worst(numbers: list[float]) -> str:
    return f"{statistics.median(numbers):.0f} | {max(numbers):.0f}" if numbers else "- | -"


def rows_of(header: str, rows: Iterable[Iterable[object]]) -> str:
    """A Markdown table; the columns of `header` are separated by |."""
    return markdown([header.split(" | "), *(list(map(str, row)) for row in rows)])


def verdict(met: bool) -> str:
    return "met" if met else "**missed**"


def summary(results: CardResults) -> str:
    """The table of targets."""
    cases, chance, everything = (samples(results, kind) for kind in (OF_CASES, "random", JUDGED))
    rows: list[list[object]] = []

    def row(name: str, target: str, numbers: list[float], met: Callable[[float], bool], text: str) -> None:
        if numbers:
            rows.append([name, target, text, verdict(all(map(met, numbers))), len(numbers)])

    for name, attribute, target, found in (
        ("local request: reply's first bit after t3.5", "local", "≤ 1 bit of the line", cases),
        ("telegram's first bit after t3.5", "telegram", "≤ 1 drive bit (104 µs)", cases),
        ("reply's first bit after the drive's last stop bit", "answer", "≤ 1 bit of the line", cases),
        (f"random, {len(chance)} requests: local", "local", "≤ 1 bit of the line", chance),
        ("random: telegram", "telegram", "≤ 1 drive bit", chance),
        ("random: after the drive's reply", "answer", "≤ 1 bit of the line", chance),
    ):
        numbers = values(found, attribute)
        row(name, target, numbers, lambda value: value <= LIMIT_BITS, f"{max(numbers, default=0):.2f}")
    for name, numbers in (
        ("full transactions over their floor", values([s for s in cases if s.telegram is not None], "ratio")),
        ("every answered request over its floor", values(cases + chance, "ratio")),
    ):
        worst = f"{max(numbers, default=0):.4f}"
        row(name, f"≤ {LIMIT_RATIO}", numbers, lambda value: value <= LIMIT_RATIO, worst)
    numbers = [s.telegram_before_t35 for s in cases + chance if s.telegram is not None]
    row(
        "no telegram before t3.5 of its request",
        "≤ 1/16 bit of the line before it, and the grain of the rate",
        numbers,
        lambda value: value <= TELEGRAM_EARLY_BITS + de_grain(min(BAUDS)),
        f"{max(numbers, default=0):.2f} before",
    )
    numbers = [after for sample in everything for after in sample.after_t35]
    earliest = f"{min(numbers, default=0):.2f}"
    row("no reply before t3.5 of its request, every reply", "≥ 0 bits", numbers, lambda v: v >= 0, earliest)
    for name, numbers in (
        ("no good reply: repeat, after the wait", [ms for s in everything for ms in s.repeats]),
        ("no good reply again: exception 255, after the wait", values(everything, "gave_up")),
    ):
        limits = f"0 … {WAIT_LIMIT_MS:g} ms"
        row(name, limits, numbers, lambda value: 0 <= value <= WAIT_LIMIT_MS, span(numbers))
    for name, attribute, least in (
        ("DE before the first bit, both lines, every frame", "de_lead", 0.0),
        ("DE after the last bit, both lines, every frame", "de_lag", -de_grain(max(BAUDS))),
    ):
        numbers = [bits for s in everything for line in getattr(s, attribute).values() for bits in line]
        inside = [max(bits, 0.0) if bits >= least else bits for bits in numbers]
        row(name, "0 … 1 bit", numbers, lambda v, least=least: least <= v <= DE_LIMIT_BITS, span(inside))
    for kinds, name in (
        (OF_CASES, "cases: right bytes and bits on both lines"),
        (("random",), "random: right bytes and bits on both lines, silence where due"),
        (("drive_faults",), "a drive that answers wrong, late or not at all: one repeat, then 255"),
        (("gate",), "a character between t1.5 and t3.5: nothing sent, nothing changed"),
        (("overtaken",), "another frame while the drive answers: newest served, exchange finished"),
        (("conformance",), "conformance rows"),
    ):
        outcomes = [outcome for piece, outcome in results.outcomes.values() if piece.kind in kinds]
        if not outcomes:
            continue
        checks, faults = sum(o.checks for o in outcomes), sum(len(o.faults) for o in outcomes)
        # A zero bounds a rate only if the requests are random.
        at_most = f", at most {bound.words(faults, checks)} at {bound.SURE}" if kinds == ("random",) else ""
        rows.append([name, "no fault", f"{faults} faults", verdict(faults == 0), f"{checks} checks{at_most}"])
    return rows_of("case | target | worst measured | verdict | of", rows)


def by_rate(results: CardResults) -> str:
    rows = []
    for baud in BAUDS:
        found = samples(results, OF_CASES, baud=baud)
        if not found:
            continue
        spans = [span(values(found, attribute)) for attribute in ("local", "telegram", "answer")]
        ratios = values(found, "ratio")
        rows.append([baud, *spans, f"{max(ratios):.4f}", len(found)])
    return rows_of(
        "bit/s | local, bits after t3.5 | telegram, drive bits after t3.5 | "
        "reply, bits after the drive's | worst total / floor | transactions",
        rows,
    )


def transactions(results: CardResults) -> str:
    rows = []
    for name in (*LOCAL, *EXCHANGES):
        row: list[object] = [name]
        for baud in (9600, SHOWN_BAUD, 115200):
            found = samples(results, "turnaround", case=name, baud=baud, form=FORM)
            if found:
                worst = max(found, key=lambda sample: sample.total - sample.floor)
                row += [f"{1e3 * worst.floor:.3f}", f"{1e3 * worst.total:.3f}"]
            else:
                row += ["-", "-"]
        if ratios := values(samples(results, "turnaround", case=name), "ratio"):
            rows.append([*row, f"{max(ratios):.4f}"])
    return rows_of(
        "transaction | floor 9600 | ours | floor 19200 | ours | floor 115200 | ours | "
        "worst ratio, all rates and formats",
        rows,
    )


def printed(results: CardResults) -> str:
    """The tables that the command prints."""
    return "\n\n".join((summary(results), by_rate(results), transactions(results), firmware(results)))


def firmware(results: CardResults) -> str:
    """Clocks from an event for the firmware to its queued answer."""
    early, chance = samples(results, OF_CASES), samples(results, "random")
    rows = []
    for name in (*CASES, "write 40001"):
        found = [sample for sample in early if sample.case == name]
        decode, answer = (values(found, attribute) for attribute in ("decode_clocks", "answer_clocks"))
        rows.append([name, middle_and_worst(decode), middle_and_worst(answer)])
    decode, answer = (values(chance, attribute) for attribute in ("decode_clocks", "answer_clocks"))
    rows.append([f"random, {len(chance)}", middle_and_worst(decode), middle_and_worst(answer)])
    return rows_of(
        "clocks of the firmware | request → queued, median | worst | drive's reply → queued, median | worst",
        rows,
    )


def budgets(clk_hz: int, baud: int) -> tuple[float, float]:
    """Clocks from the candidate to t3.5, and of the BCC's character."""
    line = LineFormat(baud, FORM, clk_hz)
    of_drive = drive_line(clk_hz)
    return (line.t35_bits - line.half_bits) * line.bit, of_drive.character_bits * of_drive.bit


def shares(results: CardResults) -> dict[tuple[str, int], tuple[float, float]]:
    """Budget and its greatest use, for each rate."""
    found = {}
    for baud in BAUDS:
        at_rate = samples(results, (*OF_CASES, "random"), baud=baud)
        request, reply = budgets(results.clk_hz, baud)
        for what, attribute, allowed in (
            ("request", "decode_clocks", request),
            ("drive's reply", "answer_clocks", reply),
        ):
            if used := values(at_rate, attribute):
                found[what, baud] = allowed, max(used)
    return found


def budget(results: CardResults) -> str:
    rows = []
    used = shares(results)
    for baud in BAUDS:
        row: list[object] = [baud]
        for what in ("request", "drive's reply"):
            if (what, baud) in used:
                allowed, worst = used[what, baud]
                row += [f"{allowed:,.0f}", f"{worst:,.0f}", f"{100 * worst / allowed:.0f} %"]
            else:
                row += 3 * ["-"]
        rows.append(row)
    return rows_of(
        "bit/s | candidate to t3.5, clocks | worst request | of it | BCC's character, clocks | "
        "worst reply of the drive | of it",
        rows,
    )


def slowest_clock_hz(results: CardResults) -> float:
    """Clock at which the slowest request would be ready just in time."""
    return results.clk_hz * max((worst / allowed for allowed, worst in shares(results).values()), default=0)


def image(results: CardResults) -> str:
    found = results.image
    path = " → ".join(found.stack_path)
    sizes = rows_of(
        "code and constants | variables | deepest stack by call graph | deepest seen in the random requests",
        [[f"{size} bytes" for size in (found.code, found.data, found.stack, results.stack_seen)]],
    )
    return f"""\
The slowest request is ready at t3.5 from {slowest_clock_hz(results) / 1e6:.1f} MHz on; the clock here is \
{results.clk_hz / 1e6:g} MHz.

{sizes}

Deepest path: {path} (`sw/tools/stack.py`)."""


def conformance(results: CardResults) -> str:
    """The rows at SHOWN_BAUD and those elsewhere."""
    ours = [(piece, outcome) for piece, outcome in results.outcomes.values() if piece.kind == "conformance"]
    ours.sort(key=lambda item: (item[0].baud != SHOWN_BAUD, item[0].baud, item[0].form))
    at_rate = [(piece, outcome) for piece, outcome in ours if piece.baud == SHOWN_BAUD]
    others = [(piece, outcome) for piece, outcome in ours if piece.baud != SHOWN_BAUD]
    header = " | ".join(
        [f"at {SHOWN_BAUD}"]
        + [f"**rtu2fc {piece.form}**" for piece, _ in at_rate]
        + ["as the specification has it"]
    )
    rows = [
        [
            text,
            *(outcome.rows[key] for _, outcome in at_rate),
            SPECIFICATION[key],
        ]
        for key, text in ROWS.items()
    ]
    first = rows_of(header, rows)
    header = " | ".join(["elsewhere", *(f"{piece.baud} {piece.form}" for piece, _ in others)])
    rows = [[text, *(outcome.rows[key] for _, outcome in others)] for key, text in ROWS.items()]
    return first + "\n\n" + rows_of(header, rows)


SPECIFICATION = {
    "inside": "16.5; 15.0 by 10-bit characters",
    "foreign": "38.5; 35.0 by 10-bit characters",
    "own": "38.5",
    "latency": "≥ 38.5; ≥ 35.0 by 10-bit characters",
    "de": "-",
    "rate": "2 / 2 %",
    "damage": "silent",
    "crc": "silent",
    "function": "exception (this card's manual: 67)",
    "arguments": "exceptions (this card's manual: 64 / 66 / 66)",
    "noise": "answered",
    "truncated": "answered",
    "glitch": "answered",
    "break": "answered",
}


def tables(results: CardResults) -> dict[str, str]:
    """What the template of the page takes of each card."""
    return {
        "mhz": f"{results.clk_hz / 1e6:g}",
        "summary": summary(results),
        "by_rate": by_rate(results),
        "transactions": transactions(results),
        "conformance": conformance(results),
        "firmware": firmware(results),
        "budget": budget(results),
        "image": image(results),
    }
