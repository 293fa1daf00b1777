# SPDX-License-Identifier: Apache-2.0
"""Verilog with signals that only a waveform shows: states by name, and a UART's bytes in letters.

rtl/ has nothing for simulation alone. A copy of a module gets `state_name`, made from its localparams S_...:
numbers of `state`, or its bits if they have no range. The UART gets uart_text.vh.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from rtl.sources import ROOT

TEXTS = {"uart": ROOT / "sim/harness/uart_text.vh"}
ROW_FILES = (Path(__file__), *TEXTS.values())
STATE = re.compile(r"^  localparam (\[\d+:0\] )?S_(\w+) =", re.MULTILINE)
END = "\nendmodule\n"


def state_name(text: str) -> str:
    """The signal for a module; empty if this has no states."""
    states = STATE.findall(text)
    if not states:
        return ""
    numbers = [f"state == S_{name}" if number else f"state[S_{name}]" for number, name in states]
    tests = [f'{test} ? "{name}"' for test, (_, name) in zip(numbers, states, strict=True)]
    if not all(number for number, _ in states):
        tests.append('state == 0 ? "IDLE"')
    width = max(len(name) for _, name in (*states, ("", "UNDEF")))
    return f'\n  wire [8*{width}-1:0] state_name = {" : ".join(tests)} : "UNDEF";\n'


def copies_with_rows(sources: Sequence[Path], folder: Path) -> list[Path]:
    """The sources, and in place of each module with something to show a copy below this folder."""
    found = []
    for path in sources:
        text = path.read_text()
        more = state_name(text) if path.suffix == ".v" else ""
        if path.stem in TEXTS:
            more += TEXTS[path.stem].read_text()
        if more:
            path = path if path.is_relative_to(folder) else folder / path.relative_to(ROOT)
            path.parent.mkdir(parents=True, exist_ok=True)
            before, _, after = text.rpartition(END)
            path.write_text(f"{before}\n{more}{END}{after}")
        found.append(path)
    return found
