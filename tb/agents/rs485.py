# SPDX-License-Identifier: Apache-2.0
"""One EIA-485 line with the device under test at one end: its pins rx, tx and de.

`source` sends for every other station, `monitor` decodes the device's characters, `check_direction` checks
DE against LINE-6 and FC-10. With `echo` the device hears itself while DE is high, as on a two-wire line.
"""

from __future__ import annotations

import cocotb
from cocotb.handle import LogicObject
from cocotb.triggers import First, ValueChange

from .line import Format, Pulse
from .uart import UartMonitor, UartSource, now_ps

# DE edges are compared with bit boundaries, which drift with the device's own bit clock (LINE-4).
TOLERANCE_BITS = 0.02


class DirectionMonitor:
    """Records the times of all DE edges."""

    def __init__(self, de: LogicObject):
        self.pulses: list[Pulse] = []
        self._task = cocotb.start_soon(self._watch(de))

    async def _watch(self, de: LogicObject) -> None:
        up = False
        while True:
            await ValueChange(de)
            level = str(de.value)
            if level == "1" and not up:
                self.pulses.append(Pulse(now_ps(), None))
            elif up and level != "1":
                self.pulses[-1] = Pulse(self.pulses[-1].rise_ps, now_ps())
            up = level == "1"


def check_direction(pulses: list[Pulse], monitor: UartMonitor) -> None:
    """Checks that DE encloses every character, covers no silence, and has both edges in time."""
    bit = monitor.fmt.bit_ps
    slack = TOLERANCE_BITS * bit
    characters = list(monitor.characters)
    for pulse in pulses:
        assert pulse.fall_ps is not None, f"DE is still high, up since {pulse.rise_ps} ps"
        inside = [c for c in characters if pulse.rise_ps <= c.start_ps < pulse.fall_ps]
        assert inside, f"DE was high from {pulse.rise_ps} to {pulse.fall_ps} ps without a character"
        lead = (inside[0].start_ps - pulse.rise_ps) / bit
        lag = (pulse.fall_ps - inside[-1].end_ps) / bit
        assert lead <= 1, f"DE rose {lead:.3f} bits before the first start bit"
        assert -TOLERANCE_BITS <= lag <= 1, f"DE fell {lag:.3f} bits after the last stop bit"
        characters = [c for c in characters if c not in inside]
    assert not characters, f"sent without DE: {[hex(c.byte) for c in characters]}"
    for at, level in monitor.edges:
        driven = any(p.rise_ps <= at <= (p.fall_ps or at) + slack for p in pulses)
        assert level == 1 or driven, f"tx fell at {at} ps without DE"


class Rs485Line:
    """The line with its far end and its checks."""

    def __init__(self, rx: LogicObject, tx: LogicObject, de: LogicObject, fmt: Format, echo: bool = False):
        self._rx, self._tx, self._de = rx, tx, de
        self._far_level = 1
        self.echo = echo
        self.source = UartSource(self._set_far, fmt)
        self.monitor = UartMonitor(tx, fmt)
        self.direction = DirectionMonitor(de)
        if echo:
            cocotb.start_soon(self._follow_own_sending())

    @property
    def fmt(self) -> Format:
        return self.monitor.fmt

    def set_format(self, fmt: Format) -> None:
        """Changes the format of both ends; first checks DE for everything sent in the old format."""
        self.check_direction()
        self.monitor.characters.clear()
        self.monitor.edges.clear()
        self.direction.pulses.clear()
        self.source.fmt = self.monitor.fmt = fmt

    def _set_far(self, level: int) -> None:
        self._far_level = level
        self._update()

    def _update(self) -> None:
        # With two drivers, low wins.
        own = str(self._tx.value) == "0" and str(self._de.value) == "1"
        self._rx.value = 0 if self.echo and own else self._far_level

    async def _follow_own_sending(self) -> None:
        while True:
            await First(ValueChange(self._tx), ValueChange(self._de))
            self._update()

    def check_direction(self) -> None:
        check_direction(self.direction.pulses, self.monitor)

    def collisions(self) -> list[tuple[int, int]]:
        """Times (from, to) in ps at which DE was high during a transmission of the far end that has ended."""
        found = []
        for sent in self.source.sent:
            for pulse in self.direction.pulses:
                begin = max(sent.start_ps, pulse.rise_ps)
                end = sent.end_ps if pulse.fall_ps is None else min(sent.end_ps, pulse.fall_ps)
                if begin < end:
                    found.append((begin, end))
        return found
