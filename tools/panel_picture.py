# SPDX-License-Identifier: Apache-2.0
"""The picture of the panel in the README: the panel itself, showing a recorded log of the virtual card.

    python -m tools.panel_picture            writes docs/pictures/panel.svg
    python -m tools.panel_picture --check    exit 1 if the panel differs from the picture

The recording is sim/card/panel.jsonl: a motor that a master has started. Its lines are without process words
and without bytes for which there is no room. Each word is a text of its own, because librsvg takes leading
blanks away and knows no textLength. The picture takes no font from the network.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
from collections.abc import Iterator
from html import escape, unescape

from rtl.command import run_main, write_files
from rtl.sources import ROOT
from sim.card.panel import Panel, View

PICTURE = ROOT / "docs/pictures/panel.svg"
RECORDED = ROOT / "sim/card/panel.jsonl"
# Simulated: the motor runs, a request was refused. The LEDs blink and are lit in the last of these states.
UNTIL_S, STATES_UNTIL_S = 7.2, 6.4
SIZE = (80, 24)
TITLE = "make run: the virtual card with a simulated VLT 6000"
WEB_FONT = re.compile(r"\s*@font-face \{.*?\n\s*\}", re.DOTALL)
# No text is longer than its line, so none needs to be cut off.
CLIP = re.compile(r'<clipPath id="[^"]+-line-\d+">.*?</clipPath>| clip-path="[^"]+-line-\d+\)"', re.DOTALL)
TEXT = re.compile(
    r'<text (class="[^"]+-r\d+") x="([\d.]+)" (y="[\d.]+") textLength="[\d.]+"\s*>([^<]*)</text>'
)
COLUMN = 12.2  # width of a character
PROCESS_WORDS = re.compile(r"; (?:control|status) .*")
ROOM = 60  # characters of a frame
FONT = re.compile(r"Fira Code, monospace")


class Recording:
    """A source for the panel: frames and states up to their times."""

    def __init__(self) -> None:
        entries = [json.loads(line) for line in RECORDED.read_text().splitlines()]
        known = [entry for entry in entries if entry.get("state", 0) <= STATES_UNTIL_S]
        self.entries = [entry for entry in known if entry.get("t", 0) <= UNTIL_S]

    def command(self, text: str) -> None:
        """A recording obeys no key."""

    def events(self) -> Iterator[dict]:
        entries, self.entries = self.entries, []
        yield from entries


class ShortLines(View):
    """The panel's text, its frames no longer than a line of the panel."""

    def _write(self, frame: dict, sender: str, ok: bool) -> None:
        what = PROCESS_WORDS.sub("", frame["what"]).replace("Readout: ", "")
        what = what if len(what) <= ROOM else what.replace(" (Motor current)", "")
        data = frame["bytes"] if len(what) + len(frame["bytes"]) <= ROOM else ""
        super()._write(frame | {"what": what, "bytes": data}, sender, ok)


def by_words(text: re.Match) -> str:
    """One text a word, each at its column."""
    kind, x, y, content = text.groups()
    shown = unescape(content).replace("\N{NO-BREAK SPACE}", " ")
    return "".join(
        f'<text {kind} x="{float(x) + COLUMN * word.start():.1f}" {y} '
        f'textLength="{COLUMN * len(word[0]):.1f}">{escape(word[0])}</text>'
        for word in re.finditer(r"\S+", shown)
    )


def picture() -> str:
    async def shown() -> str:
        app = Panel(Recording(), ShortLines())
        async with app.run_test(size=SIZE) as pilot:
            app.step()
            await pilot.pause()
            return app.export_screenshot(title=TITLE)

    # The picture has the panel's colours, whatever the terminal of this command has.
    terminal = {name: os.environ.pop(name, None) for name in ("NO_COLOR", "TERM", "COLORTERM")}
    try:
        text = asyncio.run(shown())
    finally:
        os.environ.update({name: value for name, value in terminal.items() if value is not None})
    text = FONT.sub("DejaVu Sans Mono, Liberation Mono, monospace", WEB_FONT.sub("", text))
    text = TEXT.sub(by_words, CLIP.sub("", text))
    return "\n".join(line.rstrip() for line in text.splitlines() if line.strip()) + "\n"


def main() -> int:
    return write_files("panel-picture", __doc__, {PICTURE: picture()}, "make pictures")


if __name__ == "__main__":
    run_main("panel-picture", main)
