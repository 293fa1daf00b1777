# SPDX-License-Identifier: Apache-2.0
"""The pictures of build/reports/results.md, from the results of campaigns/bench/run.py."""

from __future__ import annotations

import statistics

from matplotlib.patches import Patch
from matplotlib.pyplot import subplots

from campaigns.bench.report import (
    LOCAL,
    SHOWN_BAUD,
    CardResults,
    Results,
    measured_on,
    samples,
    values,
)
from campaigns.bench.wave import Line
from campaigns.bench.work import FORM
from campaigns.plots import save, use_style

WIRE, SILENCE = "#7f9bb3", "#d5dbe1"
DRIVE_WIRE, DELAY, DRIVE_REPLY = "#8fb08a", "#ece5cf", "#b9cfae"
OURS, CARD = "#c62828", "#2e7d32"
# Bits from the request's end to the reply of other open Modbus RTU slaves in an FPGA: Verilated at 12 MHz, at
# SHOWN_BAUD. Measured once and recorded here; their code is not part of this project.
OTHERS = {"yxgi5": 10.0, "Shroubovak": 68.7, "imihajlow": 0.5, "vasilydenisenko": 41.7}


def draw(results: Results) -> None:
    """The picture of the standard card beside other slaves."""
    use_style()
    save("latency", _latency(results.card("standard")), measured_on(results.fingerprint))


def _latency(results: CardResults):
    """From the request's end to the reply's first bit: this card and other slaves. Readable on a phone."""
    legal = Line.of(SHOWN_BAUD, FORM).t35_bits
    found = samples(results, "turnaround", case=LOCAL[0], baud=SHOWN_BAUD, form=FORM)
    bars = {"rtu2fc": legal + statistics.median(values(found, "local"))} | OTHERS
    figure, panel = subplots(figsize=(4.6, 4.0))
    for at, (name, bits) in enumerate(reversed(bars.items())):
        colour = CARD if name == "rtu2fc" else WIRE
        panel.barh(at, bits, height=0.6, color=colour if bits >= legal else SILENCE)
        panel.text(bits + 0.6, at, f"{bits:.1f}" + (" too early" if bits < legal - 4 else ""), va="center")
    panel.axvline(legal, color="black", linewidth=0.8, linestyle="--")
    panel.text(legal, len(bars) - 0.45, f"t3.5 = {legal}", ha="center")
    panel.set_yticks(range(len(bars)), [name.replace("denisenko", "-\ndenisenko") for name in reversed(bars)])
    panel.tick_params(axis="y", length=0)
    panel.set_xlim(0, 1.15 * max(bars.values()))
    panel.set_xlabel(f"bits from the request's end\nto the reply's first bit, {SHOWN_BAUD} bit/s")
    figure.suptitle("Reply latency: this card and\nother open Modbus RTU slaves", x=0.03, ha="left")
    known = {CARD: "this card", WIRE: "another design", SILENCE: "answers before t3.5"}
    handles = [Patch(color=colour, label=text) for colour, text in known.items()]
    figure.legend(
        handles=handles, loc="lower center", ncols=3, frameon=False, columnspacing=1, handlelength=1
    )
    figure.tight_layout(rect=(0, 0.07, 1, 1))
    return figure
