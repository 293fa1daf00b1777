# SPDX-License-Identifier: Apache-2.0
"""The panel of `make run`: display of a recorded log, commands of the keys, and a real screen.

sim/card/panel.jsonl is a log of the virtual card with states in between: start at 50 %, a read, a refused
write, a wrong CRC, a cut drive line, a trip, noise, moved switches, and at last a cut network line.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest
from textual.widgets import Static

from rtl.sources import ROOT
from sim.card.panel import KEYS, LiveCard, Panel, View
from sim.card.run_card import CardError
from sim.card.test_virtual_card import RawPort, request_of
from tb.agents.crc16 import with_crc
from tb.lib.nightly import first

RECORDED = [json.loads(line) for line in (ROOT / "sim/card/panel.jsonl").read_text().splitlines()]
COLUMNS, ROWS = 80, 24
START_HALF = with_crc(bytes.fromhex("01 0F 00 00 00 20 04 7C 04 00 20"))
SCREEN_S = 40.0  # wall time for a text to appear on the real screen, on a busy machine


class Recording:
    """Source that plays entries and records commands."""

    def __init__(self, entries: list[dict]) -> None:
        self.waiting, self.commands = list(entries), []

    def command(self, text: str) -> str:
        self.commands.append(text)
        return "ok"

    def events(self) -> Iterator[dict]:
        while self.waiting:
            yield self.waiting.pop(0)


def shown(app: Panel, part: str) -> str:
    return str(app.query_one(f"#{part}", Static).content)


def play(entries: list[dict], *keys: str) -> tuple[Panel, Recording, dict[str, str]]:
    """Panel after the entries and the keys, with the text of its parts."""
    source = Recording(entries)
    app = Panel(source, View())
    parts: dict[str, str] = {}

    async def run() -> None:
        async with app.run_test(size=(COLUMNS, ROWS)) as pilot:
            await pilot.pause(0.3)
            await pilot.press(*keys)
            await pilot.pause(0.3)
            parts.update({name: shown(app, name) for name in ("title", "card", "drive", "lines", "log")})

    asyncio.run(run())
    return app, source, parts


def until(when: float) -> list[dict]:
    return [entry for entry in RECORDED if entry.get("t", entry.get("state")) <= when]


# ---------------------------------------------------------------- display


def test_a_running_motor():
    _, _, parts = play(until(7.2))
    assert "unit 1  9600 8N2" in parts["title"]
    assert re.search(r"control +047Ch  start", parts["drive"])
    assert "start, data valid" in parts["drive"] and "Serial control" in parts["drive"]
    assert re.search(r"status +0E03h  running", parts["drive"])
    assert re.search(r"reference +50\.0 %", parts["drive"])
    assert re.search(r"frequency +37\.8 % +▁▂▂▃", parts["drive"])
    assert "asked 3 replied 2 exc 1 bad 0 revoked 0" in parts["lines"]
    assert "asked 3 replied 3 refused 1 bad 0" in parts["lines"]
    last = parts["log"].splitlines()
    assert re.search(r"7\.019 +master +unit 1: write parameter 514", last[-4])
    assert "> drive" in last[-3] and "< drive" in last[-2]
    assert re.match(r" +\+45\.91ms reply +unit 1: exception 1: no write access", last[-1])


def test_faults_trip_and_moved_switches():
    _, _, parts = play(RECORDED)
    assert re.search(r"status +....h  tripped", parts["drive"])
    network, drive = parts["lines"].splitlines()
    assert "exc 2 bad 1" in network and "CUT noise 1% baud +1.5%" in network
    assert "slowest 342.0 ms" in parts["card"]
    assert "CUT" not in drive and "asked 5 replied 3" in drive
    assert "power off and on" in parts["card"]
    assert "BAD CRC wrong" in parts["log"] and "no answer from the drive" in parts["log"]


def test_everything_fits_80_columns():
    assert len(KEYS) <= COLUMNS
    _, _, parts = play(RECORDED)
    for name in ("title", "card", "drive", "lines"):
        assert max(map(len, parts[name].splitlines())) <= COLUMNS, name
    assert len(parts["drive"].splitlines()) <= 9 and len(parts["card"].splitlines()) <= 9
    view = View()
    view.take({**RECORDED[-1], "read": ["111110000", "11111101"], "line": "115200 8N2"})
    view.message = "only the simulated drive can be tripped"  # the longest one
    assert view.message in view.title().plain and len(view.title().plain) <= COLUMNS


# ---------------------------------------------------------------- keys


KEYS_PRESSED = {
    "n n n n": [f"noise modbus {step}" for step in (10, 50, 200, 0)],
    "+ + -": ["baud modbus 0.5", "baud modbus 1", "baud modbus 0.5"],
    "left space": ["switches 111110000 10000001"],
    "down right space": ["switches 111110000 11000000"],
    "t p c c C N x": [
        "trip",
        "power-cycle",
        "cut modbus on",
        "cut modbus off",
        "cut drive on",
        "noise drive 10",
    ],
}


@pytest.mark.parametrize("keys", first(list(KEYS_PRESSED)[::-1], 3))
def test_keys_send_commands(keys):
    _, source, _ = play(until(7.2), *keys.split())
    assert source.commands == KEYS_PRESSED[keys]


# ---------------------------------------------------------------- with the card


@pytest.mark.nightly
def test_without_a_terminal_the_card_prints_plain_lines(tmp_path):
    link = tmp_path / "modbus"
    command = [sys.executable, "-m", "sim.card.panel", "--modbus", str(link), "--for", "0.3"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0 and run.stderr == ""
    assert f"ready modbus={link} drive=sim" in run.stdout and "mbpoll" in run.stdout
    assert re.search(r"^ *0\.0\d+  drive  LED     red$", run.stdout, re.MULTILINE)
    assert "\x1b" not in run.stdout


def test_a_card_that_does_not_start_is_one_line(tmp_path):
    (tmp_path / "modbus").write_text("mine")
    with pytest.raises(CardError, match=r"^build/card does not get ready: card: .* exists already.*$"):
        LiveCard(["--modbus", str(tmp_path / "modbus")], tmp_path)


class Terminal:
    """The panel in its own tmux session, 80 x 24."""

    def __init__(self, folder, options: str = "", then: str = "") -> None:
        self.socket = str(folder / "tmux")
        self.link = folder / "modbus"
        command = f"{sys.executable} -m sim.card.panel --modbus {self.link} {options}{then}"
        self.tmux("-f", "/dev/null", "new-session", "-d", "-x", str(COLUMNS), "-y", str(ROWS), command)

    def tmux(self, *words: str) -> str:
        environment = {**os.environ, "LC_ALL": "C.UTF-8", "TERM": "xterm-256color"}
        environment.pop("TMUX", None)
        done = subprocess.run(
            ["tmux", "-u", "-S", self.socket, *words],
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        return done.stdout

    def __enter__(self) -> Terminal:
        return self

    def __exit__(self, *_: object) -> None:
        self.tmux("kill-server")

    def wait_for(self, *patterns: str) -> list[str]:
        """Returns the screen as soon as it matches all patterns."""
        end, screen = time.monotonic() + SCREEN_S, ""
        while time.monotonic() < end:
            screen = self.tmux("capture-pane", "-p")
            if all(re.search(pattern, screen) for pattern in patterns):
                return screen.split("\n")
            time.sleep(0.1)
        raise AssertionError(f"{[p for p in patterns if not re.search(p, screen)]} not in\n{screen}")


def test_reason_for_the_end_stays_on_the_terminal(tmp_path):
    with Terminal(tmp_path, "--pcap /dev/full", "; echo code $?; sleep 60") as terminal:
        screen = terminal.wait_for(r"code 2")
        assert "card: cannot write /dev/full: No space left on device" in screen


def test_a_real_screen_of_80_by_24(tmp_path):
    with Terminal(tmp_path) as terminal:
        terminal.wait_for(r"rtu2fc  unit 1  9600 8N2", r"status +0607h  stopped", r"nothing heard yet")
        with RawPort(terminal.link) as master:
            assert len(master.ask(START_HALF, 8)) == 8
            terminal.wait_for(r"control +047Ch  start", r"reference +50\.0 %", r"asked 1 replied 1 exc 0")
            assert len(master.ask(request_of("ex5-read-514"), 9)) == 9
        screen = terminal.wait_for(
            r"asked 2 replied 2", r"frequency +[1-9][\d.]+ %", r"ms reply +unit 1: param"
        )
        assert len([row for row in screen if row]) >= 20 and max(map(len, screen)) <= COLUMNS
        assert screen[0].startswith(" rtu2fc ")
        assert re.match(r"[●○] network", screen[2]) and re.match(r"[●○] drive", screen[3])
        assert screen[23].startswith(" t trip") and "q quit" in screen[23]
        terminal.tmux("send-keys", "t", "C", "+")
        terminal.wait_for(r"status +....h  tripped", r"drive +asked.* CUT", r"network +asked.* baud \+0\.5%")
        terminal.tmux("send-keys", "Down", "Right", "Space", "p")
        terminal.wait_for(r"unit 3  9600 8N2", r"status +0607h  stopped")
        terminal.tmux("send-keys", "q")
        end = time.monotonic() + SCREEN_S
        while terminal.link.is_symlink() and time.monotonic() < end:
            time.sleep(0.1)
        assert not terminal.link.is_symlink(), "the card goes with the panel"
