# SPDX-License-Identifier: Apache-2.0
"""A UART on a simulated pin: a source that can send faults on purpose, a monitor that measures exactly.

Both use edges and timers, never the clock, so an idle line costs no simulation time. Times are picoseconds
of simulated time, widths and gaps are bit times. `Format` is baud rate, parity and stop bits of a line;
source and monitor have one each, so that they may differ on purpose. Rules: LINE-1 to LINE-5.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import cocotb
from cocotb.handle import LogicObject
from cocotb.simtime import get_sim_time
from cocotb.task import Task
from cocotb.triggers import Event, FallingEdge, First, Timer, ValueChange

from .line import Character, Flaws, Format, Frame, waveform


def now_ps() -> int:
    """Simulated time in ps."""
    return round(get_sim_time(unit="ps"))


async def sleep_until(when_ps: float) -> None:
    """Waits until a time; returns at once if it has passed."""
    left = round(when_ps) - now_ps()
    if left > 0:
        await Timer(left, unit="ps")


@dataclass(frozen=True)
class Sent:
    """Start (first start edge) and end (of the last stop bit) of a transmission."""

    start_ps: int
    end_ps: int


class UartSource:
    """Sends characters on one pin. `pin` is a signal, or a function that takes the level.

    With a function (see rs485.py) several senders can share one line. `sent` holds every transmission that
    has ended.
    """

    def __init__(self, pin: LogicObject | Callable[[int], None], fmt: Format):
        self.fmt = fmt
        if callable(pin):
            self._set = pin
            pin(1)
        else:
            self._set = lambda level: setattr(pin, "value", level)
            pin.value = 1
        self.busy = False
        self.sent: list[Sent] = []

    async def send(self, data: Iterable[int], flaws: Flaws | None = None, fmt: Format | None = None) -> Sent:
        """Sends `data` and returns at the end of the last stop bit."""
        edges, length = waveform(fmt or self.fmt, data, flaws or Flaws())
        return await self._play(edges, length)

    async def send_break(self, bits: float, idle_after: float = 1.0) -> Sent:
        """Holds the line low for `bits`, then high for `idle_after`."""
        bit = self.fmt.bit_ps
        return await self._play([(0.0, 0), (bits * bit, 1)], (bits + idle_after) * bit)

    async def low_pulse(self, width_ps: float) -> Sent:
        """Sends one low pulse of any width, for example a glitch on an idle line."""
        return await self._play([(0.0, 0), (width_ps, 1)], width_ps)

    async def idle(self, bits: float) -> None:
        """Waits `bits` with the line idle."""
        await Timer(max(1, round(bits * self.fmt.bit_ps)), unit="ps")

    def hold(self, level: int) -> None:
        """Holds the line at a level."""
        self._set(level)

    async def _play(self, edges: Sequence[tuple[float, int]], length: float) -> Sent:
        assert not self.busy, "two transmissions at once on one source"
        self.busy = True
        try:
            start = now_ps()
            for when, level in edges:
                await sleep_until(start + when)
                self._set(level)
            await sleep_until(start + length)
        finally:
            self.busy = False
        done = Sent(start, round(start + length))
        self.sent.append(done)
        return done


class UartMonitor:
    """Decodes each character on one pin and records every edge with its time.

    `characters` holds every character so far; `frame()` waits for the next group.
    """

    def __init__(self, pin: LogicObject, fmt: Format):
        self.pin = pin
        self.fmt = fmt
        self.edges: list[tuple[int, int]] = []
        self.characters: list[Character] = []
        self._fresh: deque[Character] = deque()
        self._news = Event()
        self._tasks: list[Task] = [
            cocotb.start_soon(self._record_edges()),
            cocotb.start_soon(self._decode()),
        ]

    def stop(self) -> None:
        for task in self._tasks:
            task.cancel()

    def level_at(self, when_ps: float) -> int:
        """Level of the pin at a past time (idle before the first edge)."""
        for at, level in reversed(self.edges):
            if at <= when_ps:
                return level
        return 1

    async def _record_edges(self) -> None:
        while True:
            await ValueChange(self.pin)
            # An unknown level counts as idle: a pin that is never driven shows as silence.
            self.edges.append((now_ps(), 0 if str(self.pin.value) == "0" else 1))

    async def _decode(self) -> None:
        while True:
            await FallingEdge(self.pin)
            start, fmt = now_ps(), self.fmt
            bit = fmt.bit_ps
            # Decode in the middle of the last stop bit: the next start edge may follow half a bit later.
            await sleep_until(start + (fmt.bits - 0.5) * bit)
            levels = [self.level_at(start + (i + 0.5) * bit) for i in range(fmt.bits)]
            byte = sum(levels[1 + i] << i for i in range(8))
            parity_ok = not fmt.parity_bits or levels[9] == fmt.parity_bit(byte)
            stop_ok = all(levels[9 + fmt.parity_bits :])
            heard = Character(byte, start, round(start + fmt.character_ps), parity_ok, stop_ok)
            self.characters.append(heard)
            self._fresh.append(heard)
            self._news.set()
            while str(self.pin.value) == "0":
                await ValueChange(self.pin)

    def forget(self) -> None:
        """Drops the characters that no call has returned yet."""
        self._fresh.clear()

    async def character(self, timeout_ps: float | None = None) -> Character | None:
        """The next character, or None if none was complete in time."""
        deadline = None if timeout_ps is None else now_ps() + max(1, round(timeout_ps))
        while not self._fresh:
            self._news.clear()
            if deadline is None:
                await self._news.wait()
            elif now_ps() >= deadline:
                return None
            else:
                await First(self._news.wait(), Timer(deadline - now_ps(), unit="ps"))
        return self._fresh.popleft()

    async def frame(self, timeout_ps: float | None = None, gap_bits: float = 16.5) -> Frame | None:
        """The next characters up to a silence of `gap_bits`, or None if none came in time.

        The default gap is 1.5 characters of 11 bits.
        """
        got = await self.character(timeout_ps)
        if got is None:
            return None
        characters = []
        while got is not None:
            characters.append(got)
            # Each character is reported in the middle of its last stop bit.
            got = await self.character((gap_bits + self.fmt.bits) * self.fmt.bit_ps)
        return Frame(tuple(characters))

    def frames(self, gap_bits: float = 16.5) -> list[Frame]:
        """All characters so far, grouped by silences of `gap_bits`."""
        groups: list[list[Character]] = []
        for c in self.characters:
            if groups and c.start_ps - groups[-1][-1].end_ps < gap_bits * self.fmt.bit_ps:
                groups[-1].append(c)
            else:
                groups.append([c])
        return [Frame(tuple(group)) for group in groups]

    async def pin_idle(self, for_ps: float) -> None:
        """Waits until the pin has had no edge for `for_ps`, from now on."""
        begin = now_ps()
        while now_ps() - max(begin, self.edges[-1][0] if self.edges else 0) < for_ps:
            await Timer(round(for_ps / 4), unit="ps")

    def edges_of(self, frame: Frame) -> list[tuple[int, int]]:
        """The edges of a frame, from its first start edge on."""
        return [(at, level) for at, level in self.edges if frame.start_ps <= at < frame.end_ps]

    def measure(self, frame: Frame) -> BitTiming:
        """Average bit time of gap-free characters, and the largest deviation of an edge.

        The average is taken from the first to the last start edge. Edges are compared with the grid of that
        average, so an error of whole bits within a character still shows.
        """
        characters = frame.characters
        assert len(characters) > 1, "one character is too short to measure"
        bits = (len(characters) - 1) * self.fmt.bits
        average = (characters[-1].start_ps - characters[0].start_ps) / bits
        worst = 0.0
        for at, _ in self.edges_of(frame):
            place = (at - frame.start_ps) / average
            worst = max(worst, abs(place - round(place)) * average)
        return BitTiming(average, worst)


@dataclass(frozen=True)
class BitTiming:
    """Average length of a bit, and the largest deviation of an edge from the grid."""

    average_ps: float
    worst_edge_ps: float

    def error(self, fmt: Format) -> float:
        """Relative error of the average, + is slower."""
        return self.average_ps / fmt.bit_ps - 1


def with_gaps(count: int, gap: float) -> Flaws:
    """The same gap (in bits) before every character but the first."""
    return Flaws(gaps=dict.fromkeys(range(1, count), gap))
