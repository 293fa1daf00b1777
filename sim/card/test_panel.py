# SPDX-License-Identifier: Apache-2.0
"""The panel of `make run`: display of a recorded log, commands of the keys, and a card.

sim/card/panel.jsonl is a log of the virtual card with states in between: start at 50 %, a read, a refused
write, a wrong CRC, a cut drive line, a trip, noise, moved switches, and at last a cut network line.
"""

from __future__ import annotations

import asyncio
import contextlib
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
PARTS = ("title", "card", "drive", "lines", "log")
START_HALF = with_crc(bytes.fromhex("01 0F 00 00 00 20 04 7C 04 00 20"))
SCREEN_S = 40.0  # wall time for a text to appear, on a busy machine


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
            parts.update({name: shown(app, name) for name in PARTS})

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


def test_reason_for_the_end_stays_on_the_terminal(tmp_path):
    ours, terminal = os.openpty()
    options = ["--modbus", str(tmp_path / "modbus"), "--pcap", "/dev/full", "--for", "5"]
    panel = subprocess.Popen(
        [sys.executable, "-m", "sim.card.panel", *options],
        cwd=ROOT,
        env=os.environ | {"TERM": "xterm-256color"},
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
    )
    os.close(terminal)
    written = b""
    with contextlib.suppress(OSError):  # the panel has ended
        while data := os.read(ours, 4096):
            written += data
    os.close(ours)
    assert panel.wait(SCREEN_S) == 2
    end = written.decode().rpartition("\x1b[?1049l")[2]  # after the panel's own screen
    assert "card: cannot write /dev/full: No space left on device" in end


def test_the_panel_with_its_card(tmp_path):
    async def run(card: LiveCard, master: RawPort) -> None:
        app = Panel(card, View(str(card.link)))
        async with app.run_test(size=(COLUMNS, ROWS)) as pilot:

            async def wait_for(*patterns: str) -> None:
                end, screen = time.monotonic() + SCREEN_S, ""
                while missing := [pattern for pattern in patterns if not re.search(pattern, screen)]:
                    assert time.monotonic() < end, f"{missing} not in\n{screen}"
                    await pilot.pause(0.1)
                    screen = "\n".join(shown(app, part) for part in PARTS)

            await wait_for(r"unit 1  9600 8N2", r"status +0607h  stopped", r"nothing heard yet")
            assert len(master.ask(START_HALF, 8)) == 8
            await wait_for(r"control +047Ch  start", r"reference +50\.0 %", r"asked 1 replied 1 exc 0")
            assert len(master.ask(request_of("ex5-read-514"), 9)) == 9
            await wait_for(r"asked 2 replied 2", r"frequency +[1-9][\d.]+ %", r"ms reply +unit 1: param")
            places = {part: app.query_one(f"#{part}").region for part in (*PARTS, "keys")}
            assert [places[part].y for part in (*PARTS, "keys")] == [0, 2, 2, 11, 14, ROWS - 1]
            await pilot.press("t", "C", "+")
            await wait_for(r"status +....h  tripped", r"drive +asked.* CUT", r"network +asked.* baud \+0\.5%")
            await pilot.press("down", "right", "space", "p")
            await wait_for(r"unit 3  9600 8N2", r"status +0607h  stopped")
            await pilot.press("q")
        assert app.return_value == 0

    with LiveCard([], tmp_path) as card, RawPort(card.link) as master:
        asyncio.run(run(card, master))
    assert not card.link.is_symlink(), "the card goes with the panel"
