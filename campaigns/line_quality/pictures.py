# SPDX-License-Identifier: Apache-2.0
"""The pictures of build/reports/line-quality.md."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.pyplot import subplots

from campaigns.line_quality.limits import QUANTITIES, jitter_left
from campaigns.line_quality.measure import Limit
from campaigns.line_quality.work import CARD_HZ
from campaigns.plots import save, use_style
from sim.harness.pins import BAUDS

COLOURS = {"8E1": "#2e7d32", "8O1": "#e39b33", "8N2": "#7f9bb3", "8N1": "#5b3f8c"}
PROMISE = "#c62828"
SPREAD = 0.13  # distance between the formats


def draw(limits: list[Limit], eyes: list) -> None:
    use_style()
    save("line-quality", _limits(limits))
    save("line-quality-eye", _eye(eyes))


def _limits(limits: list[Limit]) -> Figure:
    """Each quantity over the rates: dots for measurements, bars behind them for theory."""
    figure, panels = subplots(2, 3, figsize=(12, 6.4))
    bauds = sorted(BAUDS)
    for panel, (name, quantity) in zip(panels.flat, QUANTITIES.items(), strict=True):
        scale = 100 if quantity.unit == "%" else 1
        top = 0.0
        for i, (form, colour) in enumerate(COLOURS.items()):
            first, last = quantity.theory(form)
            top = max(top, last)
            shift = SPREAD * (i - (len(COLOURS) - 1) / 2)
            for at in range(len(bauds)):
                panel.fill_between(
                    [at + shift - SPREAD / 2, at + shift + SPREAD / 2],
                    first * scale,
                    last * scale,
                    color=colour,
                    alpha=0.3,
                    linewidth=0,
                )
            for one in limits:
                if (one.quantity, one.line, one.form) == (name, "network", form):
                    whole = "none" if one.clk_hz == CARD_HZ else colour
                    place = bauds.index(one.baud) + shift
                    panel.plot(
                        place, one.found * scale, "o", markersize=4, color=colour, markerfacecolor=whole
                    )
        if quantity.promise:
            panel.axhline(quantity.promise * scale, color=PROMISE, linewidth=0.9, linestyle="--")
            panel.text(-0.5, 0.99 * quantity.promise * scale, "LINE-5", color=PROMISE, va="top", fontsize=9)
        panel.set_ylim(0, 1.12 * top * scale)
        panel.set_title(quantity.title, loc="left")
        panel.set_ylabel("%" if quantity.unit == "%" else "bits")
        panel.set_xticks(range(len(bauds)), [str(baud) for baud in bauds], fontsize=8, rotation=45)
        panel.tick_params(axis="x", length=0)
    marks = [
        Line2D([], [], color=colour, marker="o", linestyle="", label=form) for form, colour in COLOURS.items()
    ]
    marks.append(
        Line2D([], [], color="black", marker="o", linestyle="", markerfacecolor="none", label="at 12 MHz")
    )
    marks.append(Patch(color="black", alpha=0.3, label="theory"))
    marks.append(Line2D([], [], color=PROMISE, linewidth=0.9, linestyle="--", label="promise (LINE-5)"))
    figure.legend(handles=marks, loc="lower center", ncols=len(marks), frameon=False)
    figure.suptitle("Limits of a line that the card still reads, by rate and format")
    figure.tight_layout(rect=(0, 0.05, 1, 1))
    return figure


def _eye(eyes: list) -> Figure:
    """Jitter left over the error of the sender's rate."""
    figure, panel = subplots(figsize=(8, 3.8))
    for form in sorted({form for form, _, _ in eyes}, reverse=True):
        points = sorted((100 * error, found) for one, error, found in eyes if one == form)
        colour = COLOURS[form]
        panel.plot(*zip(*points, strict=True), "o", color=colour, label=f"{form}, measured")
        fine = [i / 20 for i in range(-120, 121)]
        panel.plot(
            fine,
            [jitter_left(form, percent / 100) for percent in fine],
            color=colour,
            linewidth=0.9,
            label=f"{form}, theory: first errors",
        )
    panel.axvspan(-4, 4, color=PROMISE, alpha=0.06, linewidth=0)
    panel.set_title("Rate and jitter together: the jitter left at each rate error", loc="left")
    panel.text(0, 0, "promise (LINE-5): ±4 %", color=PROMISE, ha="center", va="bottom", fontsize=9)
    panel.set_xlabel("error of the sender's rate, %")
    panel.set_ylabel("jitter of each edge, ± bits")
    panel.legend(frameon=False, fontsize=9)
    figure.tight_layout()
    return figure
