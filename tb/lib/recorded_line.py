# SPDX-License-Identifier: Apache-2.0
"""A line of a bench of ours: what is on it goes to the recorder, if one is wanted (see recording.py)."""

from __future__ import annotations

from cocotb.handle import LogicObject

from tb.agents.rs485 import Rs485Line
from tb.agents.uart import Format
from tb.lib.line_tap import tap_line


class RecordedLine(Rs485Line):
    """The line of tb/agents with two more monitors while a test is recorded."""

    def __init__(self, rx: LogicObject, tx: LogicObject, de: LogicObject, fmt: Format, echo: bool = False):
        super().__init__(rx, tx, de, fmt, echo)
        self._tap = tap_line(self, rx, tx)

    def set_format(self, fmt: Format) -> None:
        super().set_format(fmt)
        if self._tap:
            self._tap.use(fmt)
