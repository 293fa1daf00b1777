# SPDX-License-Identifier: Apache-2.0
"""Passes characters and LED changes of a bench to the recorder, if one is wanted (see recording.py)."""

from __future__ import annotations

import os

import cocotb
from cocotb.handle import LogicObject, SimHandleBase
from cocotb.triggers import First, ReadOnly, Timer, ValueChange

from tb.agents.rs485 import Rs485Line
from tb.agents.uart import Format, UartMonitor, now_ps
from tb.lib.recording import DRIVE, LED_LOOK_MS, MODBUS, PS_PER_MS, Recorder, wanted


class LineTap:
    """Two extra monitors on one line; the monitors of the bench stay untouched."""

    def __init__(self, line: Rs485Line, rx: LogicObject, tx: LogicObject, recorder: Recorder):
        self._line = line
        self._recorder = recorder
        self._id = DRIVE if "drive" in rx._path else MODBUS
        self._last: bool | None = None  # last sender: True the card, False the far end, None unknown
        self._monitors = {True: UartMonitor(tx, line.fmt), False: UartMonitor(rx, line.fmt)}
        self.use(line.fmt)
        for from_card in self._monitors:
            cocotb.start_soon(self._listen(from_card))

    def use(self, fmt: Format) -> None:
        self.end_frame()
        for monitor in self._monitors.values():
            monitor.fmt = fmt
        strict = os.environ.get("RECORD_STRICT", "1") != "0"
        self._frame_end_ps = self._recorder.use(self._id, fmt, strict)

    def end_frame(self) -> None:
        self._last = None
        self._recorder.end_frame(self._id)

    def _is_echo(self, start_ps: int) -> bool:
        """With echo, the rx pin of the card also carries the card's own characters."""
        pulses = self._line.direction.pulses
        return self._line.echo and any(
            p.rise_ps <= start_ps and (p.fall_ps is None or start_ps < p.fall_ps) for p in pulses
        )

    async def _listen(self, from_card: bool) -> None:
        monitor = self._monitors[from_card]
        try:
            while True:
                own = self._last is from_card
                heard = await monitor.character(
                    self._frame_end_ps + monitor.fmt.character_ps if own else None
                )
                if heard is None:
                    if self._last is from_card:
                        self.end_frame()
                elif from_card or not self._is_echo(heard.start_ps):
                    self._last = from_card
                    self._recorder.character(self._id, from_card, heard)
                self._recorder.write(now_ps())
        finally:
            self.end_frame()  # the end of a cocotb test


class RecordedLine(Rs485Line):
    """The line of tb/agents with two more monitors while a test is recorded."""

    def __init__(self, rx: LogicObject, tx: LogicObject, de: LogicObject, fmt: Format, echo: bool = False):
        super().__init__(rx, tx, de, fmt, echo)
        recorder = wanted()
        self._tap = LineTap(self, rx, tx, recorder) if recorder else None

    def set_format(self, fmt: Format) -> None:
        super().set_format(fmt)
        if self._tap:
            self._tap.use(fmt)


async def _watch_led(recorder: Recorder, led: int, red: LogicObject, green: LogicObject) -> None:
    while True:
        await ReadOnly()  # both pins have settled
        recorder.led(led, str(red.value) == "1", str(green.value) == "1", now_ps())
        recorder.write(now_ps())
        await First(ValueChange(red), ValueChange(green), Timer(LED_LOOK_MS * PS_PER_MS, unit="ps"))


def tap_leds(dut: SimHandleBase) -> None:
    """Both LEDs of a whole card."""
    recorder = wanted()
    if recorder:
        cocotb.start_soon(_watch_led(recorder, MODBUS, dut.led_modbus_red, dut.led_modbus_green))
        cocotb.start_soon(_watch_led(recorder, DRIVE, dut.led_drive_red, dut.led_drive_green))
