# SPDX-License-Identifier: Apache-2.0
"""Verilog without the power-up values of its registers, so that a simulator may choose them (SAFE-5).

An FPGA loads these values with its configuration. Flip-flops of another technology hold anything, as do those
after a dip of the supply. The memory keeps its firmware image: $readmemh stays. Line numbers stay, too.
The synchronisers keep their value: that of reset_sync is the reset itself. No circuit could do without it:
flip-flops that hold a running card at power-up look as they do when rst_n falls, and then nothing may reach
the memory before the clock.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from rtl.sources import ROOT

# A register with a value in its declaration, in any position of a line.
DECLARED = re.compile(r"(\breg\b(?:\s+signed)?(?:\s*\[[^\]]*\])?\s*\w+)\s*=[^=;,\n][^;,\n]*(?=[;,])")
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
STATEMENT = re.compile(r"\binitial\b(?=\s)")
WORD = re.compile(r"\b(begin|end)\b|;")
IMAGE = "$readmemh"
KEPT = "sync_2ff"


def without_values(text: str) -> str:
    """The same modules; each of their registers has no value at power-up."""
    text = COMMENT.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    text = DECLARED.sub(r"\1", text)
    at = 0
    while found := STATEMENT.search(text, at):
        end = _end(text, found.end())
        body = text[found.start() : end]
        at = end
        if IMAGE not in body:
            kept = ";" + "\n" * body.count("\n")
            text = text[: found.start()] + kept + text[end:]
            at = found.start() + len(kept)
    return text


def copies_without_values(sources: Sequence[Path], folder: Path) -> list[Path]:
    """Copies below this folder, in folders named as theirs, because the waivers of Verilator go by those."""
    copies = []
    for path in sources:
        copies.append(folder / path.relative_to(ROOT if path.is_relative_to(ROOT) else path.anchor))
        copies[-1].parent.mkdir(parents=True, exist_ok=True)
        text = path.read_text()
        copies[-1].write_text(text if path.stem == KEPT else without_values(text))
    return copies


def _end(text: str, start: int) -> int:
    """Where the statement that starts here ends."""
    depth = 0
    for word in WORD.finditer(text, start):
        depth += {"begin": 1, "end": -1, ";": 0}[word[0]]
        if depth == 0:
            return word.end()
    raise ValueError("an initial statement without its end")
