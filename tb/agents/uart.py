# SPDX-License-Identifier: Apache-2.0
"""A UART on a simulated pin: a source that can send faults on purpose, a monitor that measures exactly.

Both use edges and timers, never the clock, so an idle line costs no simulation time. Times are picoseconds
of simulated time, widths and gaps are bit times. `Format` is baud rate, parity and stop bits of a line;
source and monitor have one each, so that they may differ on purpose. Rules: LINE-1 to LINE-5.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import cocotb
from cocotb.handle import LogicObject
from cocotb.simtime import get_sim_time
from cocotb.task import Task
from cocotb.triggers import Event, FallingEdge, First, Timer, ValueChange

PS_PER_S = 1_000_000_000_000


def now_ps() -> int:
    """Simulated time in ps."""
    return round(get_sim_time(unit="ps"))


async def sleep_until(when_ps: float) -> None:
    """Waits until a time; returns at once if it has passed."""
    left = round(when_ps) - now_ps()
    if left > 0:
        await Timer(left, unit="ps")


@dataclass(frozen=True)
class Format:
    """Baud rate, parity ("N", "E" or "O") and stop bits of a line."""

    baud: int = 9600
    parity: str = "N"
    stop_bits: int = 2

    @classmethod
    def named(cls, baud: int, name: str) -> Format:
        """From the usual short form, for example `named(19200, "8E1")`."""
        assert name[0] == "8" and name[1] in "NEO" and name[2] in "12", name
        return cls(baud, name[1], int(name[2]))

    @property
    def bit_ps(self) -> float:
        return PS_PER_S / self.baud

    @property
    def parity_bits(self) -> int:
        return 0 if self.parity == "N" else 1

    @property
    def bits(self) -> int:
        """Bits of one character, start and stop bits included."""
        return 1 + 8 + self.parity_bits + self.stop_bits

    @property
    def character_ps(self) -> float:
        return self.bits * self.bit_ps

    def parity_bit(self, byte: int) -> int:
        return (byte.bit_count() + (self.parity == "O")) & 1

    def levels(self, byte: int) -> list[int]:
        """Level of the line in each bit of one character."""
        data = [byte >> i & 1 for i in range(8)]
        return [0, *data, *([self.parity_bit(byte)] * self.parity_bits), *([1] * self.stop_bits)]

    def __str__(self) -> str:
        return f"{self.baud} 8{self.parity}{self.stop_bits}"


@dataclass
class Flaws:
    """Faults of a transmission; the default is none.

    gaps          idle bit times put before a character, by its number
    bad_parity    numbers of the characters whose parity bit is inverted
    bad_stop      numbers of the characters whose first stop bit is low
    ppm           error of the sender's clock, + is faster
    jitter        each edge moves by up to this part of a bit, either way
    jitter_seed   seed of the jitter
    low_stretch   every low phase is longer by this part of a bit (duty distortion; negative is shorter)
    glitches      (place, width) in bits from the first start edge: the line is inverted there
    """

    gaps: dict[int, float] = field(default_factory=dict)
    bad_parity: Sequence[int] = ()
    bad_stop: Sequence[int] = ()
    ppm: float = 0.0
    jitter: float = 0.0
    jitter_seed: int = 0
    low_stretch: float = 0.0
    glitches: Sequence[tuple[float, float]] = ()


@dataclass(frozen=True)
class Sent:
    """Start (first start edge) and end (of the last stop bit) of a transmission."""

    start_ps: int
    end_ps: int


def waveform(fmt: Format, data: Iterable[int], flaws: Flaws) -> tuple[list[tuple[float, int]], float]:
    """The line as a list of (time in ps from the first start edge, new level), and its length in ps.

    Needs no simulator: every edge is decided before the first one is sent.
    """
    bit = fmt.bit_ps / (1 + flaws.ppm * 1e-6)
    level, at, edges = 1, 0.0, []
    for number, byte in enumerate(data):
        at += flaws.gaps.get(number, 0.0) if number else 0.0
        bits = fmt.levels(byte)
        if number in flaws.bad_parity:
            assert fmt.parity_bits, f"{fmt} has no parity bit"
            bits[9] ^= 1
        if number in flaws.bad_stop:
            bits[9 + fmt.parity_bits] = 0
        for value in bits:
            if value != level:
                edges.append((at, value))
                level = value
            at += 1
        if level == 0:  # the only stop bit is bad: the line returns to high one bit later
            edges.append((at, 1))
            level, at = 1, at + 1
    rng = random.Random(flaws.jitter_seed)
    moved = []
    for place, value in edges:
        place += rng.uniform(-flaws.jitter, flaws.jitter) if flaws.jitter else 0.0
        moved.append(place + (flaws.low_stretch if value else 0.0))
    # A glitch inverts the level twice; edges are kept as places where the level changes.
    toggles = sorted(moved + [t for place, width in flaws.glitches for t in (place, place + width)])
    shift = -min(0.0, toggles[0]) if toggles else 0.0
    played, level = [], 1
    for place in toggles:
        level ^= 1
        played.append(((place + shift) * bit, level))
    return played, (at + shift) * bit


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


@dataclass(frozen=True)
class Character:
    """One character as seen on the line.

    start_ps is its start edge, end_ps the nominal end of its last stop bit.
    """

    byte: int
    start_ps: int
    end_ps: int
    parity_ok: bool
    stop_ok: bool

    @property
    def ok(self) -> bool:
        return self.parity_ok and self.stop_ok


@dataclass(frozen=True)
class Frame:
    """Characters without a long silence between them."""

    characters: tuple[Character, ...]

    @property
    def data(self) -> bytes:
        return bytes(c.byte for c in self.characters)

    @property
    def start_ps(self) -> int:
        return self.characters[0].start_ps

    @property
    def end_ps(self) -> int:
        return self.characters[-1].end_ps

    @property
    def ok(self) -> bool:
        return all(c.ok for c in self.characters)

    @property
    def largest_gap_ps(self) -> int:
        """Longest idle time between two of its characters."""
        pairs = zip(self.characters, self.characters[1:], strict=False)
        return max((b.start_ps - a.end_ps for a, b in pairs), default=0)

    def __str__(self) -> str:
        return self.data.hex(" ").upper()


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
