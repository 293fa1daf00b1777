# SPDX-License-Identifier: Apache-2.0
"""The measuring bench: the standard card at its own clock, its two lines, a master and a drive.

The Verilated card (card_bench.cpp) takes edges and gives edges; everything here is made of them, so what is
measured is what an oscilloscope on the pins would show. Unit of time: cycles of the card's clock since the
release of the reset, as floats where a bit is no whole number of them.

    bench = Bench(Line.of(19200, "8E1"))
    talk = bench.ask(rtu.build(1, rtu.read_coils(0, 16)))
    talk.reply, talk.reply_start - talk.request_end
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from tb.generated.card_tables import (
    CHARACTER_BITS,
    DRIVE_BAUD,
    DRIVE_FORMAT,
    DRIVE_PAUSE_TICKS,
    FORMATS,
    RATES,
    TICKS_PER_BIT,
)
from tb.model import fc_telegram
from tb.model.vlt_drive import VltDrive
from tools.sources import ROOT, configurations

CLK_HZ = configurations()["standard"]["clk_hz"]
LIBRARIES = {
    True: ROOT / "build/bench_card/early/libcard.so",
    False: ROOT / "build/bench_card/late/libcard.so",
}
# Outputs and probes, in the order of card_bench.cpp.
SIGNALS = (
    *("modbus_tx", "modbus_de", "drive_tx", "drive_de"),
    *("candidate", "commit", "queue_reply", "queue_telegram", "drive_candidate"),
)
MODBUS, DRIVE = 0, 1
UNIT_ADDRESS = 1
BOOT_S = 0.02  # BOOT-1
# The shortest response time a drive may have: two characters, as long as the pause (FC-8).
SHORTEST_DELAY_BITS = DRIVE_PAUSE_TICKS / TICKS_PER_BIT
# What a master leaves beyond t3.5: what that may be off by (FRAME-1); conformance.py finds the limit itself.
POLITE_BITS = 0.25
DRIVERS, PROBES = ("modbus_de", "drive_de"), SIGNALS[4:]
# How long after the last moment it may the card is waited for, in bits of the network and in s: with
# 'prepare early' off the firmware's time comes on top.
MARGIN_BITS = 4
MARGIN_S = {True: 0.0003, False: 0.003}
DRIVE_WAIT_S = 0.16  # register 40003's default and more
ROOM = 4096
NAMES = {"none1": "8N1", "none2": "8N2", "even1": "8E1", "odd1": "8O1"}
FORMAT_NAMES = tuple(NAMES[f"{form.parity}{form.stop_bits}"] for form in FORMATS.values())
BAUDS = tuple(sorted(rate.baud for rate in RATES.values()))


class BenchError(Exception):
    """One line that tells the user what is wrong."""


class Edge(ctypes.Structure):
    _fields_ = (("at", ctypes.c_int64), ("signal", ctypes.c_int32), ("level", ctypes.c_int32))


@functools.cache
def library(early: bool) -> ctypes.CDLL:
    path = LIBRARIES[early]
    if not path.exists():
        raise BenchError(f"{path.relative_to(ROOT)} is missing; run `make bench-card`")
    loaded = ctypes.CDLL(str(path))
    pointer, size, cycles = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int64
    edges, unsigned = ctypes.POINTER(Edge), ctypes.c_uint
    for name, result, arguments in (
        ("bench_clk_hz", cycles, []),
        ("bench_open", pointer, [unsigned, unsigned]),
        ("bench_close", None, [pointer]),
        ("bench_now", cycles, [pointer]),
        ("bench_play", None, [pointer, ctypes.c_int, edges, size]),
        ("bench_run", cycles, [pointer, cycles, unsigned]),
        ("bench_take_edges", size, [pointer, edges, size]),
        ("bench_memory_word", ctypes.c_uint32, [pointer, size]),
    ):
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    if loaded.bench_clk_hz() != CLK_HZ:
        raise BenchError(f"{path.relative_to(ROOT)} was built for another clock; run `make bench-card`")
    return loaded


@dataclass(frozen=True)
class Line:
    """Rate and format of one line. `bit` in cycles, silences in bits."""

    baud: int
    parity: str = "none"
    stop_bits: int = 2

    @classmethod
    def of(cls, baud: int, form: str) -> Line:
        parity = {"N": "none", "E": "even", "O": "odd"}[form[1]]
        return cls(baud, parity, int(form[2]))

    @property
    def name(self) -> str:
        return f"8{self.parity[0].upper()}{self.stop_bits}"

    @property
    def bit(self) -> float:
        return CLK_HZ / self.baud

    @property
    def character_bits(self) -> int:
        """Bits of a character as it is sent."""
        return 1 + 8 + (self.parity != "none") + self.stop_bits

    @property
    def t15_bits(self) -> float:
        return 750e-6 * self.baud if self.baud > 19200 else 1.5 * CHARACTER_BITS

    @property
    def t35_bits(self) -> float:
        return 1750e-6 * self.baud if self.baud > 19200 else 3.5 * CHARACTER_BITS

    @property
    def t35(self) -> float:
        return self.t35_bits * self.bit

    def switches(self) -> str:
        rate = next(key for key, rate in RATES.items() if rate.baud == self.baud)
        form = next(k for k, f in FORMATS.items() if (f.parity, f.stop_bits) == (self.parity, self.stop_bits))
        return rate + form

    def parity_bit(self, byte: int) -> int:
        return byte.bit_count() & 1 ^ (self.parity == "odd")

    def character(self, byte: int, bad_parity: bool = False, bad_stop: bool = False) -> list[int]:
        """Levels, one a bit. A wrong stop bit is the first one at 0."""
        bits = [0, *(byte >> i & 1 for i in range(8))]
        if self.parity != "none":
            bits.append(self.parity_bit(byte) ^ bad_parity)
        return bits + [int(not bad_stop)] + [1] * (self.stop_bits - 1)


DRIVE_LINE = Line(DRIVE_BAUD, DRIVE_FORMAT.parity, DRIVE_FORMAT.stop_bits)


@dataclass(frozen=True)
class Character:
    start: float
    end: float  # of the last stop bit, as the line's rate says
    value: int
    good: bool


@dataclass
class Talk:
    """A request and what came of it. Times in cycles, None where nothing happened."""

    request: bytes
    request_start: float
    request_end: float
    telegrams: list[list[Character]] = field(default_factory=list)
    drive_replies: list[tuple[float, float, bytes]] = field(default_factory=list)  # start, end, bytes
    answers: list[list[Character]] = field(default_factory=list)
    marks: dict[str, list[int]] = field(default_factory=dict)  # rising edges of the probes
    de: dict[str, list[tuple[int, int]]] = field(default_factory=dict)  # driver on, off
    pause_over: float = float("-inf")  # when the drive line had been silent for two characters

    @property
    def reply(self) -> bytes | None:
        return bytes(c.value for c in self.answers[0]) if self.answers else None

    @property
    def reply_start(self) -> float:
        return self.answers[0][0].start

    @property
    def reply_end(self) -> float:
        return self.answers[0][-1].end

    @property
    def telegram(self) -> bytes | None:
        return bytes(c.value for c in self.telegrams[0]) if self.telegrams else None

    @property
    def telegram_start(self) -> float:
        return self.telegrams[0][0].start

    def clocks(self, after: str, until: str) -> int | None:
        """Clocks from the first strobe of one probe to the next one of another."""
        first = next(iter(self.marks.get(after, [])), None)
        if first is None:
            return None
        return next((at - first for at in self.marks.get(until, []) if at >= first), None)


class Bench:
    """The card after its reset, a master on the network line and a simulated drive on the other."""

    def __init__(self, line: Line, *, early: bool = True, drive: VltDrive | None = None) -> None:
        self.line = line
        self.early = early
        self.drive = drive
        self.drive_wait_s = DRIVE_WAIT_S
        self.drive_delay_bits = SHORTEST_DELAY_BITS
        # Changes what the drive sends: reply -> reply, or None for silence.
        self.spoil: Callable[[bytes], bytes | None] = lambda reply: reply
        self._library = library(early)
        switches = sum(int(on) << i for i, on in enumerate(line.switches()))
        # The model reads the firmware image from the working directory.
        with contextlib.chdir(ROOT):
            self._card = self._library.bench_open(switches, UNIT_ADDRESS)
            self._library.bench_run(self._card, 1, 0)
        self._buffer = (Edge * ROOM)()
        self.edges: dict[str, list[tuple[int, int]]] = {name: [] for name in SIGNALS}
        self.silent_since = [0.0, 0.0]  # end of the last traffic, network and drive line
        self._stepped_us = 0
        self._answered = 0  # telegrams that the drive has answered before follow()
        self.run(round(BOOT_S * CLK_HZ))
        # The card has listened since its own start, some time after the reset.
        self.silent_since[MODBUS] = float(self.now)

    def close(self) -> None:
        if self._card:
            self._library.bench_close(self._card)
            self._card = None

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def now(self) -> int:
        return self._library.bench_now(self._card)

    @property
    def seconds(self) -> float:
        return self.now / CLK_HZ

    def memory(self, words: Iterable[int]) -> list[int]:
        return [self._library.bench_memory_word(self._card, word) for word in words]

    # ------------------------------------------------------------ waveforms

    def play(self, where: int, edges: Iterable[tuple[float, int]]) -> None:
        """Puts levels onto a line, each from its time on."""
        items = [Edge(round(at), where, level) for at, level in edges]
        self._library.bench_play(self._card, where, (Edge * len(items))(*items), len(items))

    def send(
        self,
        where: int,
        data: bytes,
        start: float,
        *,
        error: float = 0.0,
        gaps: dict[int, float] | None = None,
        bad_parity: int | None = None,
        bad_stop: int | None = None,
    ) -> float:
        """Puts a frame onto a line; returns the end of its last stop bit.

        error: the sender's rate is (1 + error) times the nominal one. gaps: idle bits before a character, by
        its number. bad_parity, bad_stop: number of the character that is damaged.
        """
        line = self.line if where == MODBUS else DRIVE_LINE
        bit = line.bit / (1 + error)
        at, edges = start, []
        for number, byte in enumerate(data):
            at += (gaps or {}).get(number, 0.0) * bit
            levels = line.character(byte, number == bad_parity, number == bad_stop)
            edges += [(at + i * bit, level) for i, level in enumerate(levels)]
            at += len(levels) * bit
            edges.append((at, 1))
        self.play(
            where, [edge for i, edge in enumerate(edges) if i + 1 == len(edges) or self._differs(edges, i)]
        )
        self.silent_since[where] = at
        return at

    @staticmethod
    def _differs(edges: list[tuple[float, int]], i: int) -> bool:
        """An edge at the same time as its successor is none."""
        return round(edges[i][0]) != round(edges[i + 1][0])

    def run(self, until: float, stops: Iterable[str] = ()) -> int:
        """Runs to a time, or until one of the signals falls."""
        mask = sum(1 << SIGNALS.index(name) for name in stops)
        now = self._library.bench_run(self._card, round(until), mask)
        while (count := self._library.bench_take_edges(self._card, self._buffer, ROOM)) > 0:
            for edge in self._buffer[:count]:
                self.edges[SIGNALS[edge.signal]].append((edge.at, edge.level))
        return now

    def forget(self) -> None:
        """Drops the edges seen so far; the lines are silent."""
        for edges in self.edges.values():
            edges.clear()

    def characters(self, where: int) -> list[Character]:
        """What the card sent on a line since the last forget()."""
        line, name = (self.line, "modbus_tx") if where == MODBUS else (DRIVE_LINE, "drive_tx")
        edges, found, at = self.edges[name], [], 0
        while at < len(edges):
            start = edges[at][0]
            if edges[at][1]:
                at += 1
                continue
            levels, level, i = [], 0, at
            for number in range(line.character_bits):
                middle = start + (number + 0.5) * line.bit
                while i < len(edges) and edges[i][0] <= middle:
                    level = edges[i][1]
                    i += 1
                levels.append(level)
            value = sum(bit << k for k, bit in enumerate(levels[1:9]))
            good = levels == line.character(value)
            found.append(Character(start, start + line.character_bits * line.bit, value, good))
            at = i
        return found

    def bursts(self, where: int) -> list[list[Character]]:
        """The card's characters, split where its driver was off."""
        name = "modbus_de" if where == MODBUS else "drive_de"
        spans = self.spans(name)
        split: list[list[Character]] = [[] for _ in spans]
        for character in self.characters(where):
            for burst, (on, off) in zip(split, spans, strict=True):
                if on <= character.start <= off:
                    burst.append(character)
        return [burst for burst in split if burst]

    def spans(self, name: str) -> list[tuple[int, int]]:
        """Times of a signal's rise and fall; one that is still high ends now."""
        rises = [at for at, level in self.edges[name] if level]
        falls = [at for at, level in self.edges[name] if not level]
        return list(zip(rises, [*falls, self.now][: len(rises)], strict=True))

    # ------------------------------------------------------------ talking

    def next_start(self, idle_bits: float = 0.0) -> float:
        """The earliest time for a new frame: t3.5 after the last traffic, and `idle_bits` more."""
        return max(self.now + 1, self.silent_since[MODBUS] + self.line.t35 + idle_bits * self.line.bit)

    def ask(self, request: bytes, *, start: float | None = None, **how: object) -> Talk:
        """Sends a request and waits until the card has answered, or surely does not."""
        start = self.next_start(POLITE_BITS) if start is None else start
        self.forget()
        return self.follow(Talk(request, start, self.send(MODBUS, request, start, **how)))

    def ask_and_leave(self, request: bytes) -> Talk:
        """Sends a request and comes back when the drive's reply to it is about to start."""
        start = self.next_start(POLITE_BITS)
        self.forget()
        talk = Talk(request, start, self.send(MODBUS, request, start))
        self.run(talk.request_end + self.line.t35 + 0.1 * CLK_HZ, ["drive_de"])
        self._drive_answers(talk)
        self._answered = len(self._ended("drive_de"))
        return talk

    def follow(self, talk: Talk, *, until: float = 0.0) -> Talk:
        """Waits for the answer to a request on its way, and at least to `until`."""
        talk.pause_over = self.silent_since[DRIVE] + SHORTEST_DELAY_BITS * DRIVE_LINE.bit
        deadline = max(talk.request_end + self.line.t35, talk.pause_over) + MARGIN_BITS * self.line.bit
        deadline += MARGIN_S[self.early] * CLK_HZ
        self._attend(talk, max(deadline, until), until)
        talk.answers, talk.telegrams = self.bursts(MODBUS), self.bursts(DRIVE)
        talk.de = {name: self.spans(name) for name in DRIVERS}
        talk.marks = {name: [at for at, level in self.edges[name] if level] for name in PROBES}
        return talk

    def _attend(self, talk: Talk, deadline: float, until: float) -> None:
        """Lets the drive answer each telegram; ends with the card's reply, or at the deadline."""
        replies, telegrams, self._answered = 0, self._answered, 0
        while self.now < deadline or any(self._level(name) for name in DRIVERS):
            self.run(max(deadline, self.now + self.line.bit), DRIVERS)
            if len(spans := self._ended("modbus_de")) > replies:
                replies = len(spans)
                self.silent_since[MODBUS] = self.bursts(MODBUS)[-1][-1].end
                if self.now >= until:
                    return
            if len(spans := self._ended("drive_de")) > telegrams:
                telegrams = len(spans)
                deadline = max(deadline, self._drive_answers(talk))

    def _drive_answers(self, talk: Talk) -> float:
        """The drive has the telegram just ended; returns when the card must have reacted."""
        burst = self.bursts(DRIVE)[-1]
        end = self.silent_since[DRIVE] = burst[-1].end
        margin = MARGIN_BITS * self.line.bit + MARGIN_S[self.early] * CLK_HZ
        request = bytes(c.value for c in burst)
        if self.drive is None or fc_telegram.is_broadcast(request[2]):
            return end + margin
        now_us = int(end / CLK_HZ * 1e6)
        self.drive.step(now_us - self._stepped_us)
        self._stepped_us = now_us
        reply = self.drive.telegram(request)
        reply = reply and self.spoil(reply)
        if not reply:
            return end + margin + self.drive_wait_s * CLK_HZ
        start = end + self.drive_delay_bits * DRIVE_LINE.bit
        done = self.send(DRIVE, reply, start)
        talk.drive_replies.append((start, done, reply))
        return done + margin

    def _level(self, name: str) -> int:
        edges = self.edges[name]
        return edges[-1][1] if edges else 0

    def _ended(self, name: str) -> list[int]:
        return [at for at, level in self.edges[name] if not level]
