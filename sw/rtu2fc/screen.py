# SPDX-License-Identifier: Apache-2.0
"""All output: lines for people, or one JSON object for scripts (--json)."""

from __future__ import annotations

import json
import shutil
import sys
import textwrap

from rich.console import Console

from .problem import Problem

TICK, CROSS, NOT_ASKED = "✓", "✗", "-"
COLOURS = {TICK: "green", CROSS: "bold red", NOT_ASKED: "dim"}


class Output(Console):
    def on_broken_pipe(self) -> None:
        """The library would end the program, without a word of the motor."""
        raise


class Screen:
    """`result` becomes the JSON object. Lines are wrapped on a terminal only: a pipe gets them whole."""

    def __init__(self, as_json: bool = False) -> None:
        self.as_json, self.result, self.motor = as_json, {}, ""
        for stream in (sys.stdout, sys.stderr):
            if hasattr(stream, "reconfigure"):  # an old code page of Windows has no tick
                stream.reconfigure(errors="replace")
        self.console = Output(highlight=False, markup=False, soft_wrap=True, emoji=False)
        encoding = sys.stdout.encoding or "ascii"
        self.fancy = TICK.encode(encoding, "replace").decode(encoding) == TICK

    def mark(self, mark: str) -> str:
        return mark if self.fancy else {TICK: "ok", CROSS: "NO"}.get(mark, mark)

    def say(self, text: str = "", style: str | None = None, indent: int = 2) -> None:
        if self.as_json:
            return
        if self.console.is_terminal and len(text) > self.console.width:
            first = len(text) - len(text.lstrip())
            text = textwrap.fill(
                text.strip(),
                self.console.width,
                initial_indent=" " * first,
                subsequent_indent=" " * (first + indent),
            )
        self.console.print(text, style=style)

    def row(self, mark: str, text: str, indent: int) -> None:
        self.say(f"  {self.mark(mark)} {text}", COLOURS.get(mark) if mark != TICK else None, indent)

    def problem(self, command: str, problem: Problem) -> None:
        if self.as_json:
            self.result["error"] = {"text": str(problem), "advice": list(problem.advice)}
            return
        width = shutil.get_terminal_size().columns if sys.stderr.isatty() else 0
        for number, text in enumerate((f"rtu2fc {command}: {problem}", *problem.advice)):
            text = text if number == 0 else f"  {text}"
            print("\n".join(textwrap.wrap(text, width, subsequent_indent="    ")) if width else text,
                  file=sys.stderr)  # fmt: skip

    def finish(self, code: int) -> None:
        if self.as_json:
            print(json.dumps(self.result | {"exit_code": code}), flush=True)
