# SPDX-License-Identifier: Apache-2.0
"""The pictures of build/reports/results.md, from the results of campaigns/bench/run.py."""

from __future__ import annotations

import statistics

from matplotlib.patches import Patch
from matplotlib.pyplot import subplots

from campaigns.bench.judge import LIMIT_BITS
from campaigns.bench.report import (
    EXCHANGES,
    LOCAL,
    RIVAL_ROWS,
    RIVALS,
    SHOWN_BAUD,
    CardResults,
    Results,
    measured_on,
    samples,
    values,
)
from campaigns.bench.wave import BAUDS, Line
from campaigns.bench.work import FORM
from campaigns.plots import save, use_style

WIRE, SILENCE = "#7f9bb3", "#d5dbe1"
DRIVE_WIRE, DELAY, DRIVE_REPLY = "#8fb08a", "#ece5cf", "#b9cfae"
OURS, CARD, LATE = "#c62828", "#2e7d32", "#e39b33"


def draw(results: Results) -> None:
    """All pictures are of the standard card."""
    use_style()
    for name, picture in PICTURE_OF.items():
        save(name, picture(results.card("standard")), measured_on(results.fingerprint))


def _transactions(results: CardResults):
    """For each case a bar for the wire's floor, with the card's time on top."""
    figure, panels = subplots(1, 2, figsize=(11, 4.8), width_ratios=(1, 2.4))
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
            found = samples(results, "turnaround", case=name, baud=SHOWN_BAUD, form=FORM)
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


def _overhead(results: CardResults):
    """Histograms of the random requests' latencies, with the limit."""
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
        if low < -0.1:
            panel.axvspan(low, 0, color=SILENCE, alpha=0.4, linewidth=0)
            panel.text(low, 0.82, " early", ha="left", transform=panel.get_xaxis_transform())
        panel.set_yscale("log")
        panel.set_title(
            f"{title}\n{len(numbers)} requests, worst {max(numbers):.2f}", loc="left", fontsize=10
        )
        panel.set_xlabel(unit)
    panels[0].set_ylabel("requests")
    figure.suptitle("Random requests: what the card adds to t3.5 and to the drive's reply")
    figure.supxlabel(
        "Early, below 0: t3.5 ends up to 1/16 bit of the line early, which is more drive bits at a slow rate;"
        " the drive's reply is taken inside its last stop bit.",
        fontsize=9,
    )
    figure.tight_layout()
    return figure


def _early(results: CardResults):
    """Time lost after t3.5 for each rate: with and without prepare early, and the limit."""
    figure, panel = subplots(figsize=(8, 4))
    limit = [1e6 / baud for baud in BAUDS]
    panel.plot(BAUDS, limit, color="black", linewidth=0.8, linestyle="--")
    panel.text(BAUDS[1] * 1.05, limit[1] * 1.2, "the limit: one bit of the line")
    for kind, colour, name in (("late", LATE, "prepare early off"), ("turnaround", CARD, "ours")):
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


def _latency(results: CardResults):
    """From the request's end to the reply's first bit: this card and other slaves."""

    def ours(kind: str) -> float:
        found = samples(results, kind, case=LOCAL[0], baud=SHOWN_BAUD, form=FORM)
        return legal + statistics.median(values(found, "local"))

    legal = Line.of(SHOWN_BAUD, FORM).t35_bits
    bars = {"rtu2fc": ours("turnaround"), "rtu2fc, prepare early off": ours("late")}
    for name, latency in zip(RIVALS, RIVAL_ROWS["latency"], strict=True):
        bars[name.split("/")[0]] = float(latency.strip("*"))
    figure, panel = subplots(figsize=(8, 3.6))
    for at, (name, bits) in enumerate(reversed(bars.items())):
        colour = CARD if name == "rtu2fc" else LATE if name.startswith("rtu2fc") else WIRE
        panel.barh(at, bits, height=0.6, color=colour if bits >= legal else SILENCE)
        panel.text(bits + 0.6, at, f"{bits:.1f}" + (" too early" if bits < legal - 4 else ""), va="center")
    panel.axvline(legal, color="black", linewidth=0.8, linestyle="--")
    panel.text(legal, len(bars) - 0.45, f"t3.5 = {legal}", ha="center")
    panel.set_yticks(range(len(bars)), list(reversed(bars)))
    panel.tick_params(axis="y", length=0)
    panel.set_xlabel(f"bits from the request's end to the reply's first bit, {SHOWN_BAUD} bit/s")
    panel.set_title("Reply latency: this card and other open Modbus RTU slaves", loc="left", pad=16)
    known = {CARD: "this card", LATE: "this card without early preparation", WIRE: "another design"}
    known[SILENCE] = "answers before t3.5"
    handles = [Patch(color=colour, label=text) for colour, text in known.items()]
    figure.legend(handles=handles, loc="lower center", ncols=4, frameon=False, fontsize=9)
    figure.tight_layout(rect=(0, 0.07, 1, 1))
    return figure


PICTURE_OF = {"transactions": _transactions, "overhead": _overhead, "early": _early, "latency": _latency}
