# SPDX-License-Identifier: Apache-2.0
"""The virtual card on a terminal: LEDs, switches, process words, both lines.

    python -m sim.card.panel [options of build/card]

Keys trip the simulated drive, cut a line, add noise, detune the master's rate, move switches and cycle the
power. The panel shows the card's log and its answers to `state` (build/card --control). 80 x 24 characters
are enough. Without a terminal, build/card prints plain lines instead.

Times are simulated seconds. Exit code: that of build/card.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
import textwrap
import time
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal
from textual.widgets import Static

from regs.dialects import DEFAULT, DIALECTS
from rtl.command import run_main
from sim.card.run_card import CARD, CardError, RunningCard, option
from sw.rtu2fc import fc, tables
from sw.rtu2fc.drives import DRIVES
from tb.agents import rtu
from tb.model import fc_telegram

TRIP, VALID = 0x0008, 0x0400  # bits of status and control word
REFRESH_S = 0.1
TREND_S = 0.5  # simulated time between two points of the trends
LEFT, RIGHT = 28, 51  # columns of the upper half
TRENDS = 26  # points
BARS = " ▁▂▃▄▅▆▇█"
LINES_KEPT = 200
LED_STYLE = {"off": "grey50", "red": "bold red", "green": "bold green", "orange": "bold dark_orange"}
BAUD_STEP, BAUD_MOST = 0.5, 10.0  # percent
NOISE = (0, 10, 50, 200)  # per thousand bytes
MESSAGE_S = 5.0  # wall time that a message is shown
KEYS = " t trip  c/C cut  n/N noise  +/- baud  arrows, space  p power  h help  q quit"
HELP = """\
t       trip the simulated drive (alarm 13)
c, C    cut or mend the network line, the drive line
n, N    noise on the network line, the drive line: 0, 1, 5, 20 % of the bytes
+, -    the master sends faster, slower, in steps of 0.5 %
arrows  choose a switch; space moves it
p       power off and on: the card reads its switches
q       quit
"""


def hints(link: str) -> list[str]:
    """Commands to try in another terminal."""
    ask = "mbpoll -m rtu -a 1 -b 9600 -P none -1"
    return [
        "# motor current",
        f"{ask} -t 4 -r 5140 -c 2 {link}",
        "# start, 50 %: control word 047Ch, reference 2000h",
        f"{ask} -t 0 -r 1 {link} \\",
        "  0 0 1 1 1 1 1 0 0 0 1 0 0 0 0 0  0 0 0 0 0 0 0 0 0 0 0 0 0 1 0 0",
        "# status and frequency",
        f"{ask} -t 0 -r 33 -c 32 {link}",
    ]


# ---------------------------------------------------------------- formatting


def trend(values: deque[float], full: float = 100.0) -> str:
    steps = len(BARS) - 1
    return "".join(BARS[min(steps, math.ceil(abs(value) / full * steps - 0.01))] for value in values)


def switch_row(digits: str, cursor: int | None) -> Text:
    """Levers up (1) or down; the selected lever is highlighted."""
    row = Text()
    for number, digit in enumerate(digits):
        row.append("▀" if digit == "1" else "▄", style="bold yellow" if number == cursor else "bold")
        row.append(" ")
    return row


class View:
    """Collects log entries and states, and renders the panel's parts as text."""

    def __init__(self, link: str = "build/modbus", profile: str = "vlt6000") -> None:
        self.link, self.of = link, DRIVES[profile]
        self.state: dict = {}
        self.word = {"control": 0, "reference": 0, "status": 0, "frequency": 0}
        self.heard: set[str] = set()  # process words seen so far
        self.trends = {name: deque(maxlen=TRENDS) for name in ("reference", "frequency")}
        self.count: Counter[str] = Counter()
        self.transactions: deque[Text] = deque(maxlen=LINES_KEPT)
        self.slowest_ms = 0.0
        self.cursor = 0
        self.message = ""
        self._asked: float | None = None
        self._told: float | None = None
        self._next_point = 0.0

    # ------------------------------------------------------------ input

    def take(self, entry: dict) -> None:
        if "state" in entry:
            self._take_state(entry)
        elif "line" in entry:
            self._take_frame(entry)

    def _take_state(self, state: dict) -> None:
        self.state = state
        if motor := state["motor"]:
            self.word |= {name: motor[name] for name in self.word}
            self.heard |= set(self.word)
        if state["state"] >= self._next_point:
            self._next_point = state["state"] + TREND_S
            for name, points in self.trends.items():
                points.append(fc.share(self.word[name]))

    def _take_frame(self, frame: dict) -> None:
        data, ok, sender = bytes.fromhex(frame["bytes"]), frame["ok"], frame["from"]
        if frame["line"] == "modbus":
            self._count_modbus(data, ok, sender, frame["what"])
        else:
            self._take_telegram(data, ok, sender)
        self._write(frame, sender, ok)

    def _count_modbus(self, data: bytes, ok: bool, sender: str, what: str) -> None:
        if not ok:
            self.count["revoked" if what.startswith("revoked") else "bad"] += 1
        elif sender == "master":
            self.count["requests"] += 1
        else:
            refused = bool(data[1] & rtu.EXCEPTION_BIT)
            self.count["exceptions" if refused else "replies"] += 1

    def _take_telegram(self, data: bytes, ok: bool, sender: str) -> None:
        reply = sender == "drive"
        if not ok:
            self.count["harmed"] += 1
            return
        self.count["answers" if reply else "telegrams"] += 1
        with suppress(fc_telegram.TelegramError):
            telegram = fc_telegram.parse(data, reply)
            self.count["refused"] += reply and telegram.fault is not None
            if self.state.get("motor"):
                return
            if reply:
                self._hear(status=telegram.pcd1, frequency=telegram.pcd2)
            elif telegram.pcd1 & VALID:
                self._hear(control=telegram.pcd1, reference=telegram.pcd2)

    def _hear(self, **words: int) -> None:
        self.word |= words
        self.heard |= set(words)

    def _write(self, frame: dict, sender: str, ok: bool) -> None:
        """Adds a line: time, or delay after the request or telegram; sender; description."""
        line, since = frame["line"], None
        if sender == "card":
            since, mark = (self._asked, "reply") if line == "modbus" else (None, "> drive")
        else:
            since, mark = (None, "master") if line == "modbus" else (self._told, "< drive")
        when = f"{frame['t']:9.3f}  " if since is None else f"{(frame['t'] - since) * 1000:+8.2f}ms "
        if sender == "card" and line == "modbus" and since is not None:
            self.slowest_ms = max(self.slowest_ms, (frame["t"] - since) * 1000)
        style = "bold red" if not ok else {"master": "bold", "reply": "bold"}.get(mark, "cyan")
        row = Text(when, style="grey62", no_wrap=True, overflow="ellipsis")
        row.append(f"{mark:<8}", style=style)
        row.append(frame["what"] if ok else f"BAD {frame['what']}", style="" if ok else "red")
        row.append(f"  {frame['bytes']}", style="grey50")
        self.transactions.append(row)
        if line == "modbus":
            self._asked = frame["end"] if sender == "master" else None
        else:
            self._told = frame["end"] if sender == "card" else None

    # ------------------------------------------------------------ parts

    def _side(self, line: str) -> dict:
        return {"led": "off", "cut": False, "noise": 0, "baud_error": 0} | self.state.get(line, {})

    def title(self) -> Text:
        text = Text(no_wrap=True)
        text.append(" rtu2fc ", style="reverse bold")
        unit = sum(int(digit) << i for i, digit in enumerate(self.state.get("read", ["", "0"])[1]))
        text.append(f" unit {unit}  {self.state.get('line', '')}", style="bold")
        # 80 columns do not fit both: a message replaces link and time.
        if self.message:
            text.append(f"  {self.message}", style="bold yellow")
        else:
            text.append(f"  {self.link}", style="bold")
            text.append(f"  {self.state.get('state', 0):.1f} s", style="grey62")
        return text

    def card(self) -> Text:
        text = Text(no_wrap=True)
        for line, name in (("modbus", "network"), ("drive", "drive")):
            shows = self._side(line)["led"]
            text.append("● " if shows != "off" else "○ ", style=LED_STYLE[shows])
            text.append(f"{name:<9}", style="bold")
            text.append(f"{shows}\n", style=LED_STYLE[shows])
        set_to, read = self.state.get("switches", ["", ""]), self.state.get("read", ["", ""])
        for name, digits, first in (("rate", set_to[0], 0), ("addr", set_to[1], len(set_to[0]))):
            at = self.cursor - first
            text.append(f"\n{name}  ", style="bold")
            text.append(switch_row(digits, at if 0 <= at < len(digits) else None))
            text.append(f"\n      {' '.join(str(i + 1) for i in range(len(digits)))}", style="grey50")
        text.append("\np: power off and on" if set_to != read else "\n", style="bold yellow")
        if self.slowest_ms:
            text.append(f"\nslowest {self.slowest_ms:.1f} ms", style="grey62")
        return text

    def drive(self) -> Text:
        text = Text(no_wrap=True)
        said = {
            "control": fc_telegram.describe_control(self.word["control"], 0).split(", reference")[0],
            "status": fc_telegram.describe_status(self.word["status"], 0).split(", output")[0],
        }
        for name, summary in said.items():
            word = self.word[name]
            text.append(f"{name:<10}", style="bold")
            if name not in self.heard:
                text.append("not heard yet\n\n\n", style="grey50")
                continue
            alarm = name == "status" and word & TRIP
            text.append(f"{word:04X}h  {summary}\n", style="bold red" if alarm else "bold")
            bits = tables.CONTROL if name == "control" else tables.STATUS
            rows = textwrap.wrap(fc.bits_in_words(word, bits, self.of), RIGHT - 3)
            text.append("".join(f" {row}\n" for row in [*rows, "", ""][:2]), style="grey62")
        for name, points in self.trends.items():
            text.append(f"{name:<10}", style="bold")
            text.append(f"{fc.share(self.word[name]):7.1f} %  ")
            text.append(f"{trend(points)}\n", style="green" if name == "frequency" else "blue")
        return text

    def _troubles(self, line: str) -> Text:
        side, text = self._side(line), Text()
        if side["cut"]:
            text.append(" CUT", style="bold red")
        if side["noise"]:
            text.append(f" noise {side['noise'] / 10:g}%", style="bold yellow")
        if side["baud_error"]:
            text.append(f" baud {side['baud_error']:+.1f}%", style="bold yellow")
        return text

    def lines(self) -> Text:
        c, text = self.count, Text()
        text.append("network ", style="bold")
        text.append(f"asked {c['requests']} replied {c['replies']} exc {c['exceptions']}")
        text.append(f" bad {c['bad']} revoked {c['revoked']}")
        text.append_text(self._troubles("modbus"))
        text.append("\ndrive   ", style="bold")
        text.append(f"asked {c['telegrams']} replied {c['answers']} refused {c['refused']}")
        text.append(f" bad {c['harmed']}")
        text.append_text(self._troubles("drive"))
        return text

    def log(self, rows: int) -> Text:
        shown = list(self.transactions)[-rows:] if rows > 0 else []
        if not shown:
            shown = [
                Text("nothing heard yet; in another terminal:", style="grey62"),
                *map(Text, hints(self.link)),
            ]
        return Text("\n", no_wrap=True, overflow="ellipsis").join(shown)


# ---------------------------------------------------------------- the card


class LiveCard(RunningCard):
    """build/card with all that the panel shows of it."""

    def __init__(self, options: Sequence[str], folder: Path) -> None:
        super().__init__(folder, *options, "--quiet", "--control", apart=True)
        self._told = len(self.output)

    def events(self) -> Iterator[dict]:
        """Returns new log entries, the state, {"message": ...} and {"exit": code}."""
        code = None if self.process.poll() is None else self.wait()
        yield from self.new_entries()
        if code is None:
            with suppress(CardError, OSError):  # it ends just now
                yield self.state()
        new = self.output[self._told :]
        self._told += len(new)
        yield from ({"message": line.removeprefix("card: warning: ")} for line in new)
        if code is not None:
            yield {"exit": code}


# ---------------------------------------------------------------- the terminal


class Panel(App[int]):
    CSS = f"""
    Screen {{ layout: vertical; }}
    #title, #keys {{ height: 1; }}
    #upper {{ height: 9; margin-top: 1; }}
    #card {{ width: {LEFT}; }}
    #drive {{ width: 1fr; }}
    #lines {{ height: 2; margin-bottom: 1; }}
    #log {{ height: 1fr; }}
    Static {{ text-wrap: nowrap; text-overflow: ellipsis; }}
    #keys {{ background: $primary-background; }}
    """
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar = [
        Binding("t", "send('trip')", "trip"),
        Binding("c", "cut('modbus')", "cut"),
        Binding("C", "cut('drive')", "cut drive"),
        Binding("n", "noise('modbus')", "noise"),
        Binding("N", "noise('drive')", "noise drive"),
        Binding("plus", "baud(1)", "faster"),
        Binding("minus", "baud(-1)", "slower"),
        Binding("left", "choose(-1)", "switch"),
        Binding("right", "choose(1)", "switch"),
        Binding("up", "choose(-9)", "switch"),
        Binding("down", "choose(9)", "switch"),
        Binding("space", "move", "move"),
        Binding("p", "send('power-cycle')", "power"),
        Binding("h,question_mark", "help", "help"),
        Binding("q,ctrl+c", "leave", "quit"),
    ]

    def __init__(self, source: LiveCard, view: View) -> None:
        super().__init__()
        self.source, self.view = source, view
        self._helping = False
        self._message_until = 0.0

    def compose(self) -> ComposeResult:
        yield Static(id="title")
        with Horizontal(id="upper"):
            yield Static(id="card")
            yield Static(id="drive")
        yield Static(id="lines")
        yield Static(id="log")
        yield Static(KEYS, id="keys")

    def on_mount(self) -> None:
        self.set_interval(REFRESH_S, self.step)
        self.call_after_refresh(self.step)

    def step(self) -> None:
        for event in self.source.events():
            if "exit" in event:
                self.exit(event["exit"])
            elif "message" in event:
                self.say(event["message"])
            else:
                self.view.take(event)
        if time.monotonic() > self._message_until:
            self.view.message = ""
        self.show()

    def say(self, message: str) -> None:
        self.view.message = message
        self._message_until = time.monotonic() + MESSAGE_S

    def show(self) -> None:
        # The timer may fire before all parts are mounted, or while they are removed.
        if len(self.query("#title, #card, #drive, #lines, #log")) < 5:
            return
        for name in ("title", "card", "drive", "lines"):
            self.query_one(f"#{name}", Static).update(getattr(self.view, name)())
        log = self.query_one("#log", Static)
        log.update(Text(HELP) if self._helping else self.view.log(log.size.height))

    # ------------------------------------------------------------ keys

    def action_send(self, command: str) -> None:
        self.view.message = ""
        with suppress(CardError, OSError):  # the card has ended: events() reports it
            answer = self.source.command(command)
            if answer != "ok":
                self.say(answer.removeprefix("error: "))

    def _make_trouble(self, line: str, what: str, key: str, value: object, said: str) -> None:
        """Applies the change at once: the next key may come before the card reports its state."""
        self.view.state.setdefault(line, {})[key] = value
        self.action_send(f"{what} {line} {said}")

    def _now(self, line: str, key: str) -> float:
        return self.view.state.get(line, {}).get(key, 0)

    def action_cut(self, line: str) -> None:
        cut = not self._now(line, "cut")
        self._make_trouble(line, "cut", "cut", cut, "on" if cut else "off")

    def action_noise(self, line: str) -> None:
        wanted = next((step for step in NOISE if step > self._now(line, "noise")), NOISE[0])
        self._make_trouble(line, "noise", "noise", wanted, str(wanted))

    def action_baud(self, direction: int) -> None:
        wanted = self._now("modbus", "baud_error") + direction * BAUD_STEP
        wanted = max(-BAUD_MOST, min(BAUD_MOST, wanted))
        self._make_trouble("modbus", "baud", "baud_error", wanted, f"{wanted:g}")

    def action_choose(self, step: int) -> None:
        count = sum(map(len, self.view.state.get("switches", ["0"])))
        wanted = self.view.cursor + step
        self.view.cursor = wanted % count if abs(step) == 1 else max(0, min(count - 1, wanted))
        self.show()

    def action_move(self) -> None:
        if not (switches := self.view.state.get("switches")):
            return
        digits, rate = list("".join(switches)), len(switches[0])
        digits[self.view.cursor] = "10"[int(digits[self.view.cursor])]
        self.action_send(f"switches {''.join(digits[:rate])} {''.join(digits[rate:])}")

    def action_help(self) -> None:
        self._helping = not self._helping
        self.show()

    def action_leave(self) -> None:
        self.exit(0)


def plain(options: list[str], link: str) -> None:
    """Without a terminal: prints the hints, then replaces this process by build/card."""
    print(
        f"Virtual card on {link}, unless options say otherwise unit 1, 9600 bit/s, no parity. To talk to it:"
    )
    print("\n".join(f"  {hint}" for hint in hints(link)), flush=True)
    os.execv(CARD, [str(CARD), *options])


def main() -> int:
    options = sys.argv[1:]
    link = option(options, "--modbus") or option(options, "--modbus-device") or "its pty"
    terminal = sys.stdin.isatty() and sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb"
    if not terminal or {"--help", "--version", "--quiet", "--control"} & set(options):
        plain(options, link)
    with tempfile.TemporaryDirectory() as folder, LiveCard(options, Path(folder)) as card:
        dialect = DIALECTS[option(options, "--dialect") or DEFAULT]
        view = View(link, option(options, "--profile") or dialect.profiles[0])
        ended = Panel(card, view).run()
        code = card.stop()
        if ended not in (0, None) and view.message:
            print(view.message, file=sys.stderr)  # the panel's screen is already closed
        return code if ended in (0, None) else ended


if __name__ == "__main__":
    run_main("panel", main, CardError, OSError)
