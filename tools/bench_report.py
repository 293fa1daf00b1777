# SPDX-License-Identifier: Apache-2.0
"""The bench's table, docs/results.md and its pictures, from the results of tools/bench.py."""

from __future__ import annotations

import statistics
from collections.abc import Iterable
from dataclasses import dataclass, field

from sim.bench.card import BAUDS, CLK_HZ, DRIVE_LINE, FORMAT_NAMES, Line
from sim.bench.cases import CASES, LIMIT_BITS, LIMIT_RATIO, Outcome, Sample
from sim.bench.conformance import ROWS
from sim.bench.work import FORM, Piece
from tools.sources import ROOT

RESULTS = ROOT / "docs/results.md"
PICTURES = ROOT / "docs/pictures"
TEMPLATE = ROOT / "sim/bench/results.md.in"
LOCAL = tuple(name for name, case in CASES.items() if case.local)
EXCHANGES = tuple(name for name, case in CASES.items() if not case.local)
SHOWN_BAUD = 19200

# Other open Modbus RTU slaves in an FPGA under the same rows: Verilated at 12 MHz, 19200 bit/s. Written down
# once; their code is not part of this project.
RIVALS = (
    "yxgi5/modbus_rtu_slave 8N1",
    "Shroubovak/FPGA_Modbus_RTU 8N1",
    "imihajlow/etester 8N1 / 8E1",
    "vasilydenisenko/modbus_rtu_slave 8E1",
)
RIVAL_ROWS = {
    "inside": ("14.8", "**49.5**", "**32.7**", "**7.0**"),
    "foreign": ("34.9", "**0.1**", "32.7", "41.0"),
    "own": ("-", "-", "-", "-"),
    "latency": ("**10.0**", "68.7", "**0.5**", "41.7"),
    "de": ("10.0 / 10.0", "19.2 / 0.02", "none", "0.16 / 0.00"),
    "rate": ("6.5 / **0.8** %", "6.4 / 4.8 %", "5.0 / 5.0 (E: 4.6 / 4.5) %", "5.0 / 4.5 %"),
    "damage": ("n.a. / **answered**", "n.a. / **answered**", "silent / **answered**", "silent / silent"),
    "crc": ("silent", "silent", "silent", "silent"),
    "function": ("exc 1", "exc 1", "**silent**", "not its own"),
    "arguments": ("2 / **silent** / 3", "**answered** / 3 / 3", "**reply without address**", "not its own"),
    "noise": ("answered", "**lost**", "answered", "answered"),
    "truncated": ("answered", "**lost**", "answered", "answered"),
    "glitch": ("answered", "answered", "answered", "**lost**"),
    "break": ("answered", "answered", "answered", "answered"),
}


@dataclass
class Results:
    """Everything a report is made of."""

    seed: int
    outcomes: dict[str, tuple[Piece, Outcome]] = field(default_factory=dict)
    clk_hz: int = CLK_HZ
    code_bytes: int = 0
    data_bytes: int = 0
    stack_bytes: int = 0
    stack_path: list[str] = field(default_factory=list)
    # Simulated seconds in a second of wall time (of processor time for the bench itself).
    speeds: dict[str, float] = field(default_factory=dict)

    def faults(self) -> list[str]:
        return [fault for _, outcome in self.outcomes.values() for fault in outcome.faults]


# ---------------------------------------------------------------- what the numbers say


def samples(results: Results, kind: str, **fits: object) -> list[Sample]:
    """Of one kind of work; `fits` are attributes a sample must have, one value or several."""
    found = [
        sample
        for piece, outcome in results.outcomes.values()
        if piece.kind == kind
        for sample in outcome.samples
    ]
    for attribute, wanted in fits.items():
        allowed = wanted if isinstance(wanted, tuple) else (wanted,)
        found = [sample for sample in found if getattr(sample, attribute) in allowed]
    return found


def values(found: Iterable[Sample], attribute: str) -> list[float]:
    return [value for sample in found if (value := getattr(sample, attribute)) is not None]


def span(numbers: list[float], digits: int = 2) -> str:
    """Least to greatest."""
    return f"{min(numbers):.{digits}f} … {max(numbers):.{digits}f}" if numbers else "-"


def middle_and_worst(numbers: list[float]) -> str:
    return f"{statistics.median(numbers):.0f} | {max(numbers):.0f}" if numbers else "- | -"


def rows_of(header: str, rows: Iterable[Iterable[object]]) -> str:
    """A Markdown table; `header` with | between its columns."""
    columns = header.count("|") + 1
    lines = [f"| {header} |", "|" + "---|" * columns]
    return "\n".join(lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows])


def verdict(met: bool) -> str:
    return "met" if met else "**missed**"


def summary(results: Results) -> str:
    """The table of targets."""
    cases, chance = samples(results, "early"), samples(results, "random")
    rows = []
    for name, attribute, target, found in (
        ("local request: reply's first bit after t3.5", "local", "≤ 1 bit of the line", cases),
        ("telegram's first bit after t3.5", "telegram", "≤ 1 drive bit (104 µs)", cases),
        ("reply's first bit after the drive's last stop bit", "answer", "≤ 1 bit of the line", cases),
        (f"random, {len(chance)} requests: local", "local", "≤ 1 bit of the line", chance),
        ("random: telegram", "telegram", "≤ 1 drive bit", chance),
        ("random: after the drive's reply", "answer", "≤ 1 bit of the line", chance),
    ):
        numbers = values(found, attribute)
        if numbers:
            rows.append(
                [name, target, f"{max(numbers):.2f}", verdict(max(numbers) <= LIMIT_BITS), len(numbers)]
            )
    ratios = values([s for s in cases if s.case in EXCHANGES], "ratio")
    everything = values(cases + chance, "ratio")
    for name, numbers in (
        ("full transactions over their floor", ratios),
        ("every answered request over its floor", everything),
    ):
        met = verdict(max(numbers) <= LIMIT_RATIO)
        rows.append([name, f"≤ {LIMIT_RATIO}", f"{max(numbers):.4f}", met, len(numbers)])
    earliest = min(values(cases + chance, "local"))
    rows.append(
        ["no reply before t3.5 of its request", "≥ 0 bits", f"{earliest:.2f}", verdict(earliest >= 0), "all"]
    )
    for kind, name in (
        ("gate", "a character between t1.5 and t3.5: nothing sent, nothing changed"),
        ("overtaken", "another frame while the drive answers: newest served, exchange finished"),
        ("conformance", "conformance rows"),
        ("random", "random: right bytes on both lines, silence where due"),
    ):
        outcomes = [outcome for piece, outcome in results.outcomes.values() if piece.kind == kind]
        checks, faults = sum(o.checks for o in outcomes), sum(len(o.faults) for o in outcomes)
        rows.append([name, "no fault", f"{faults} faults", verdict(faults == 0), f"{checks} checks"])
    return rows_of("case | target | worst measured | verdict | of", rows)


def by_rate(results: Results) -> str:
    rows = []
    for baud in BAUDS:
        found = samples(results, "early", baud=baud)
        spans = [span(values(found, attribute)) for attribute in ("local", "telegram", "answer")]
        ratios = values(found, "ratio")
        rows.append([baud, *spans, f"{max(ratios):.4f}", len(found)])
    return rows_of(
        "bit/s | local, bits after t3.5 | telegram, drive bits after t3.5 | "
        "reply, bits after the drive's | worst total / floor | transactions",
        rows,
    )


def transactions(results: Results) -> str:
    rows = []
    for name in CASES:
        row: list[object] = [name]
        for baud in (9600, SHOWN_BAUD, 115200):
            found = samples(results, "early", case=name, baud=baud, form=FORM)
            if found:
                worst = max(found, key=lambda sample: sample.total - sample.floor)
                row += [f"{1e3 * worst.floor:.3f}", f"{1e3 * worst.total:.3f}"]
            else:
                row += ["-", "-"]
        row.append(f"{max(values(samples(results, 'early', case=name), 'ratio')):.4f}")
        rows.append(row)
    return rows_of(
        "transaction | floor 9600 | ours | floor 19200 | ours | floor 115200 | ours | "
        "worst ratio, all rates and formats",
        rows,
    )


def table(results: Results) -> str:
    """What the command prints."""
    parts = ["", summary(results), "", by_rate(results), "", transactions(results), "", firmware(results), ""]
    return "\n".join(parts)


def early_or_late(results: Results) -> str:
    rows = []
    for baud in BAUDS:
        bit_us = 1e6 / baud
        early = samples(results, "early", baud=baud, form=FORM)
        late = samples(results, "late", baud=baud)
        for what, attribute, unit_us in (
            ("reply", "local", bit_us),
            ("telegram", "telegram", 1e6 / DRIVE_LINE.baud),
        ):
            ours, theirs = (
                [unit_us * value for value in values(found, attribute)] for found in (early, late)
            )
            software = [1e6 * clocks / CLK_HZ for clocks in values(with_kind(late, what), "decode_clocks")]
            if not ours or not theirs:
                continue
            a, b = statistics.median(ours), statistics.median(theirs)
            t35_us = 1e6 * Line.of(baud, FORM).t35_bits / baud
            rows.append(
                [
                    baud if what == "reply" else "",
                    what,
                    f"{a:.0f} ({max(ours):.0f})",
                    f"{b:.0f} ({max(theirs):.0f})",
                    f"{statistics.median(software):.0f}",
                    f"{b - a:.0f}",
                    f"{b / a:.0f} x" if a > 0 else "-",
                    f"{(t35_us + b) / (t35_us + a):.3f}",
                ]
            )
    return rows_of(
        "bit/s | first bit of | ours, µs after t3.5: median (worst) | prepare early off | "
        "wait, then think: the firmware's clocks alone | gain, µs | lost, off / ours | "
        "turnaround, off / ours",
        rows,
    )


def with_kind(found: list[Sample], what: str) -> list[Sample]:
    return [s for s in found if (s.telegram is not None) == (what == "telegram")]


def firmware(results: Results) -> str:
    """Clocks from being handed something to having queued the answer to it."""
    early, chance = samples(results, "early"), samples(results, "random")
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


def conformance(results: Results) -> str:
    ours = [(piece, outcome) for piece, outcome in results.outcomes.values() if piece.kind == "conformance"]
    ours.sort(key=lambda item: (item[0].baud != SHOWN_BAUD, item[0].baud, item[0].form))
    at_rate = [(piece, outcome) for piece, outcome in ours if piece.baud == SHOWN_BAUD]
    others = [(piece, outcome) for piece, outcome in ours if piece.baud != SHOWN_BAUD]
    header = " | ".join(
        ["at 19200"]
        + [f"**rtu2fc {piece.form}**" for piece, _ in at_rate]
        + list(RIVALS)
        + ["as the specification has it"]
    )
    rows = [
        [text, *(outcome.rows[key] for _, outcome in at_rate), *RIVAL_ROWS[key], SPECIFICATION[key]]
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


def speeds(results: Results) -> str:
    rows = [[name, f"{speed:.3g}", f"{1 / speed:.3g}"] for name, speed in results.speeds.items()]
    return rows_of("simulation | simulated s in a wall s | wall s for a simulated s", rows)


# ---------------------------------------------------------------- the document


def document(results: Results) -> str:
    """The text is in TEMPLATE, its numbers and tables come from here."""
    chance = samples(results, "random")
    drive = [sample for sample in chance if sample.telegram is not None]
    local = [sample for sample in chance if sample.local is not None]
    return TEMPLATE.read_text().format(
        seed=results.seed,
        mhz=f"{CLK_HZ / 1e6:.0f}",
        formats=", ".join(FORMAT_NAMES),
        form=FORM,
        summary=summary(results),
        by_rate=by_rate(results),
        transactions=transactions(results),
        requests=len(chance),
        local=len(local),
        drive=len(drive),
        silent=len(chance) - len(local) - len(drive),
        early_or_late=early_or_late(results),
        conformance=conformance(results),
        firmware=firmware(results),
        code=results.code_bytes,
        data=results.data_bytes,
        stack=results.stack_bytes,
        stack_seen=max(outcome.stack_bytes for _, outcome in results.outcomes.values()),
        stack_path=" → ".join(results.stack_path),
        speeds=speeds(results),
    )


# ---------------------------------------------------------------- pictures

WIRE, SILENCE = "#7f9bb3", "#d5dbe1"
DRIVE_WIRE, DELAY, DRIVE_REPLY = "#8fb08a", "#ece5cf", "#b9cfae"
OURS, CARD, LATE = "#c62828", "#2e7d32", "#e39b33"


def pictures(results: Results) -> None:
    import matplotlib

    matplotlib.use("svg")
    # The same numbers make the same file.
    matplotlib.rcParams.update(
        {
            "svg.hashsalt": "rtu2fc",
            "svg.fonttype": "none",
            "font.family": "sans-serif",
            "font.size": 10,
            "axes.spines.top": False,
            "axes.spines.right": False,
        }
    )
    PICTURES.mkdir(exist_ok=True)
    for name, draw in PICTURE_OF.items():
        figure = draw(results)
        figure.savefig(PICTURES / f"{name}.svg", metadata={"Date": None}, bbox_inches="tight")


def _transactions(results: Results):
    """A bar of the wire's floor for each case, ours on top."""
    from matplotlib.patches import Patch
    from matplotlib.pyplot import subplots

    figure, panels = subplots(1, 2, figsize=(11, 4.2), width_ratios=(1, 2.4))
    colours = {
        "request": WIRE,
        "t3.5": SILENCE,
        "telegram": DRIVE_WIRE,
        "drive's delay": DELAY,
        "drive's reply": DRIVE_REPLY,
        "reply": WIRE,
    }
    for panel, names, title in (
        (panels[0], LOCAL, "answered by the card"),
        (panels[1], EXCHANGES, "with the drive"),
    ):
        for at, name in enumerate(reversed(names)):
            found = samples(results, "early", case=name, baud=SHOWN_BAUD, form=FORM)
            worst = max(found, key=lambda sample: sample.total - sample.floor)
            left = 0.0
            for what, seconds in worst.floor_parts.items():
                panel.barh(
                    at,
                    1e3 * seconds,
                    left=left,
                    height=0.55,
                    color=colours[what],
                    edgecolor="white",
                    linewidth=0.6,
                )
                left += 1e3 * seconds
            over = 1e3 * (worst.total - worst.floor)
            panel.barh(at, over, left=left, height=0.75, color=OURS, edgecolor=OURS, linewidth=1.5)
            label = f"  +{1e3 * over:.0f} µs ({100 * over / left:.2f} %)"
            panel.text(left + over, at, label, va="center", color=OURS)
        panel.set_yticks(range(len(names)), list(reversed(names)))
        panel.set_xlabel("ms")
        panel.set_title(title, loc="left")
        panel.set_xlim(0, panel.get_xlim()[1] * (1.6 if panel is panels[0] else 1.16))
        panel.tick_params(axis="y", length=0)
    names = {"request": "request, reply"}
    handles = [
        Patch(color=colour, label=names.get(what, what))
        for what, colour in colours.items()
        if what != "reply"
    ]
    handles.append(Patch(color=OURS, label="ours on top (drawn thicker than it is)"))
    figure.legend(handles=handles, loc="lower center", ncols=6, frameon=False, bbox_to_anchor=(0.5, -0.06))
    figure.suptitle(f"Whole transactions at {SHOWN_BAUD} bit/s {FORM}: the wire's floor, and ours on top")
    figure.tight_layout()
    return figure


def _overhead(results: Results):
    """Histograms of the random requests' latencies, with the limit."""
    from matplotlib.pyplot import subplots

    figure, panels = subplots(1, 3, figsize=(11, 3.4), sharey=True)
    for panel, attribute, title, unit in (
        (panels[0], "local", "reply after t3.5", "bits of the line"),
        (panels[1], "telegram", "telegram after t3.5", "drive bits"),
        (panels[2], "answer", "reply after the drive's reply", "bits of the line"),
    ):
        numbers = values(samples(results, "random"), attribute)
        low = min(-0.1, min(numbers))
        width = (1.1 - low) / 60
        bins = [low + i * width for i in range(61)]
        panel.hist(numbers, bins=bins, color=WIRE, histtype="stepfilled")
        panel.axvline(LIMIT_BITS, color=OURS)
        panel.text(LIMIT_BITS, 0.93, "limit ", color=OURS, ha="right", transform=panel.get_xaxis_transform())
        panel.axvline(0, color="black", linewidth=0.8)
        panel.set_yscale("log")
        panel.set_title(
            f"{title}\n{len(numbers)} requests, worst {max(numbers):.2f}", loc="left", fontsize=10
        )
        panel.set_xlabel(unit)
    panels[0].set_ylabel("requests")
    figure.tight_layout()
    return figure


def _early(results: Results):
    """Time lost after t3.5, rate by rate: ours, with prepare early off, and what the limit allows."""
    from matplotlib.pyplot import subplots

    figure, panel = subplots(figsize=(8, 4))
    limit = [1e6 / baud for baud in BAUDS]
    panel.plot(BAUDS, limit, color="black", linewidth=0.8, linestyle="--")
    panel.text(BAUDS[1] * 1.05, limit[1] * 1.2, "the limit: one bit of the line")
    for kind, colour, name in (("late", LATE, "prepare early off"), ("early", CARD, "ours")):
        lost = [
            [1e6 / baud * value for value in values(samples(results, kind, baud=baud, form=FORM), "local")]
            for baud in BAUDS
        ]
        middle = [statistics.median(numbers) for numbers in lost]
        worst = [max(numbers) for numbers in lost]
        panel.fill_between(
            BAUDS, [min(numbers) for numbers in lost], worst, color=colour, alpha=0.25, linewidth=0
        )
        panel.plot(BAUDS, middle, color=colour, marker="o")
        panel.text(BAUDS[-1] * 1.12, middle[-1], f"{name}\n{middle[-1]:.1f} µs", color=colour, va="center")
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xticks(BAUDS, [str(baud) for baud in BAUDS], fontsize=9)
    panel.set_yticks((1, 10, 100, 1000), ("1", "10", "100", "1000"))
    panel.minorticks_off()
    panel.set_xlabel("bit/s")
    panel.set_ylabel("µs after t3.5")
    panel.set_title(f"Local requests, {FORM}: time lost after t3.5", loc="left")
    figure.tight_layout()
    return figure


def _latency(results: Results):
    """From the request's end to the reply's first bit: this card and others."""
    from matplotlib.pyplot import subplots

    def ours(kind: str) -> float:
        found = samples(results, kind, case=LOCAL[0], baud=SHOWN_BAUD, form=FORM)
        return legal + statistics.median(values(found, "local"))

    legal = Line.of(SHOWN_BAUD, FORM).t35_bits
    bars = {"rtu2fc": ours("early"), "rtu2fc, prepare early off": ours("late")}
    for name, latency in zip(RIVALS, RIVAL_ROWS["latency"], strict=True):
        bars[name.split("/")[0]] = float(latency.strip("*"))
    figure, panel = subplots(figsize=(8, 3))
    for at, (name, bits) in enumerate(reversed(bars.items())):
        colour = CARD if name == "rtu2fc" else LATE if name.startswith("rtu2fc") else WIRE
        panel.barh(at, bits, height=0.6, color=colour if bits >= legal else SILENCE)
        panel.text(bits + 0.6, at, f"{bits:.1f}" + (" too early" if bits < legal - 4 else ""), va="center")
    panel.axvline(legal, color="black", linewidth=0.8, linestyle="--")
    panel.text(legal, len(bars) - 0.45, f"t3.5 = {legal}", ha="center")
    panel.set_yticks(range(len(bars)), list(reversed(bars)))
    panel.tick_params(axis="y", length=0)
    panel.set_xlabel(f"bits from the request's end to the reply's first bit, {SHOWN_BAUD} bit/s")
    figure.tight_layout()
    return figure


PICTURE_OF = {"transactions": _transactions, "overhead": _overhead, "early": _early, "latency": _latency}


def write(results: Results) -> None:
    pictures(results)
    RESULTS.write_text(document(results))
