# SPDX-License-Identifier: Apache-2.0
"""`rtu2fc watch`: parameters again and again, as a live table, a CSV file, and a plot at the end."""

from __future__ import annotations

import argparse
import contextlib
import csv
import json
import time
from collections.abc import Iterator
from pathlib import Path

from rich.live import Live
from rich.table import Table

from .card import Card, Parameter, parameter
from .port import written
from .problem import DONE, NoAnswer, Refused
from .screen import Screen

BARS = "▁▂▃▄▅▆▇█"
PLOT_WIDTH, PLOT_HEIGHT, MARGIN = 720, 180, 50


class Series:
    """The values of one parameter, scaled, with their times; None where it was refused."""

    def __init__(self, one: Parameter) -> None:
        self.one = one
        self.times: list[float] = []
        self.values: list[float | None] = []
        self.shown = ""

    def add(self, at: float, card: Card) -> None:
        self.times.append(at)
        try:
            raw = card.read(self.one)
        except (Refused, NoAnswer) as problem:  # the next one may come
            self.values.append(None)
            self.shown = str(problem)
            return
        self.shown = card.shown(self.one, raw)
        scale = 10.0**self.one.conversion if -6 < self.one.conversion < 6 else 1
        self.values.append(None if isinstance(raw, str) else raw * scale)

    @property
    def numbers(self) -> list[float]:
        return [value for value in self.values if value is not None]

    def bars(self, width: int) -> str:
        """The newest values as a row of bars."""
        numbers = self.numbers[-width:]
        low, high = min(numbers, default=0), max(numbers, default=0)
        step = (high - low) / (len(BARS) - 1) or 1
        return "".join(BARS[round((value - low) / step)] for value in numbers)


def live_table(series: list[Series], screen: Screen) -> Table:
    table = Table(expand=False)
    for title in ("parameter", "value", "least", "most"):
        table.add_column(title, justify="left" if title == "parameter" else "right")
    room = max(0, screen.console.width - 66) if screen.fancy else 0
    if room:
        table.add_column("trend", no_wrap=True)
    for one in series:
        ends = [f"{end(one.numbers):.6g}" if one.numbers else "" for end in (min, max)]
        table.add_row(str(one.one), one.shown, *ends, *([one.bars(min(room, 40))] if room else []))
    return table


def svg(series: list[Series]) -> str:
    """A plot of each parameter below the other, on one axis of time."""
    height = len(series) * (PLOT_HEIGHT + MARGIN) + MARGIN
    said = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {PLOT_WIDTH + 2 * MARGIN} {height}" '
        'font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/>'
    ]
    for number, one in enumerate(series):
        top = MARGIN + number * (PLOT_HEIGHT + MARGIN)
        low, high = min(one.numbers, default=0), max(one.numbers, default=0)
        span, last = (high - low) or 1, one.times[-1] or 1
        points = " ".join(
            f"{MARGIN + PLOT_WIDTH * at / last:.1f},{top + PLOT_HEIGHT * (1 - (value - low) / span):.1f}"
            for at, value in zip(one.times, one.values, strict=True)
            if value is not None
        )
        title = f"{one.one}{f' ({one.one.unit})' if one.one.unit else ''}: {low:g} to {high:g}"
        title = title.replace("&", "&amp;").replace("<", "&lt;")
        right, below = MARGIN + PLOT_WIDTH, top + PLOT_HEIGHT
        said += [
            f'<text x="{MARGIN}" y="{top - 8}">{title}</text>',
            f'<path d="M{MARGIN} {top}H{right}V{below}H{MARGIN}Z" fill="none" stroke="#999"/>',
            f'<polyline points="{points}" fill="none" stroke="#0072b2" stroke-width="1.5"/>',
            f'<text x="{right}" y="{below + 16}" text-anchor="end">{last:.1f} s</text>',
        ]
    return "\n".join([*said, "</svg>", ""])


@contextlib.contextmanager
def csv_rows(path: Path | None, series: list[Series]) -> Iterator[object]:
    """A function that appends a row, which is in the file at once."""
    if path is None:
        yield lambda at: None
        return
    file = path.open("w", newline="", encoding="utf-8")
    rows = csv.writer(file)

    def append(at: float) -> None:
        with written(path):
            rows.writerow(
                [f"{at:.3f}", *("" if one.values[-1] is None else one.values[-1] for one in series)]
            )
            file.flush()

    try:
        rows.writerow(["seconds", *(f"{one.one} {one.one.unit}".strip() for one in series)])
        yield append
    finally:
        with written(path):
            file.close()


def watch(args: argparse.Namespace, screen: Screen, card: Card) -> int:
    """Until --for is over or Ctrl-C, which is its usual end."""
    series = [Series(parameter(card.drive, word)) for word in args.parameters]
    live = None
    if not screen.as_json and screen.console.is_terminal:
        live = Live(console=screen.console, auto_refresh=False)
    began, due = time.monotonic(), 0.0
    with (
        csv_rows(args.csv, series) as append,
        live or contextlib.nullcontext(),
        contextlib.suppress(KeyboardInterrupt),
    ):
        while due <= args.seconds:
            time.sleep(max(0.0, began + due - time.monotonic()))
            at = time.monotonic() - began
            for one in series:
                one.add(at, card)
            append(at)
            if live:
                live.update(live_table(series, screen), refresh=True)
            elif screen.as_json:
                print(
                    json.dumps({"t": round(at, 3), **{str(s.one.number): s.shown for s in series}}),
                    flush=True,
                )
            else:
                screen.say(f"{at:8.1f} s  " + "  ".join(f"{s.one.number} = {s.shown}" for s in series))
            due = max(due + args.every, at)
    screen.say()
    for one in (one for one in series if one.numbers):
        trend = f"  {one.bars(60)}" if screen.fancy else ""
        screen.say(f"{one.one}: {min(one.numbers):.6g} to {max(one.numbers):.6g} {one.one.unit}".rstrip())
        screen.say(trend)
    if args.plot:
        with written(args.plot):
            args.plot.write_text(svg(series), encoding="utf-8")
        screen.say(f"plot: {args.plot}")
    screen.result["readings"] = len(series[0].times)
    return DONE
