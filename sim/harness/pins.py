# SPDX-License-Identifier: Apache-2.0
"""The fuzzer's card from Python: characters onto its two lines, and what it sends taken apart.

Unit of time: clocks since the release of the reset; floats where a bit is no whole number of them.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from regs.generated.card_tables import FORMATS, RATES
from tb.model.wire import Burst, Line, Sent, drive_line

# In the order of fuzz_card.cpp.
SIGNALS = (
    *("modbus_tx", "modbus_de", "drive_tx", "drive_de"),
    *("led_modbus_red", "led_modbus_green", "led_drive_red", "led_drive_green"),
)
NETWORK, DRIVE = 0, 1
TX = {NETWORK: SIGNALS.index("modbus_tx"), DRIVE: SIGNALS.index("drive_tx")}
DE = {NETWORK: SIGNALS.index("modbus_de"), DRIVE: SIGNALS.index("drive_de")}
DRIVERS = sum(1 << signal for signal in DE.values())
LEDS = SIGNALS[4:]
ROOM = 4096
LETTERS = {"none": "N", "even": "E", "odd": "O"}
FORMS = {f"8{LETTERS[form.parity]}{form.stop_bits}": switches for switches, form in FORMATS.items()}
BAUDS = {rate.baud: switches for switches, rate in RATES.items()}


class Edge(ctypes.Structure):
    _fields_ = (("at", ctypes.c_int64), ("signal", ctypes.c_int32), ("level", ctypes.c_int32))


@functools.cache
def load(path: Path) -> ctypes.CDLL:
    loaded = ctypes.CDLL(str(path))
    pointer, size, clocks = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int64
    edges, number, text = ctypes.POINTER(Edge), ctypes.c_uint32, ctypes.c_char_p
    for name, result, arguments in (
        ("fuzz_open", pointer, [number, number, text]),
        ("fuzz_close", None, [pointer]),
        ("fuzz_now", clocks, [pointer]),
        ("fuzz_play", None, [pointer, ctypes.c_int, edges, size]),
        ("fuzz_hush", None, [pointer, ctypes.c_int]),
        ("fuzz_run", clocks, [pointer, clocks, number]),
        ("fuzz_take_edges", size, [pointer, edges, size]),
    ):
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    if hasattr(loaded, "fuzz_flip"):
        found = ctypes.POINTER(number)
        loaded.fuzz_variables.restype, loaded.fuzz_variables.argtypes = size, [pointer]
        loaded.fuzz_variable.restype, loaded.fuzz_variable.argtypes = text, [pointer, size, found, found]
        loaded.fuzz_watch.restype, loaded.fuzz_watch.argtypes = None, [pointer, size]
        loaded.fuzz_watched.restype, loaded.fuzz_watched.argtypes = ctypes.c_uint64, [pointer]
        loaded.fuzz_flip.restype, loaded.fuzz_flip.argtypes = None, [pointer, size, number, number]
    return loaded


@dataclass
class Pins:
    """A card that was just switched on. `folder`: where its firmware image lies."""

    library: Path
    folder: Path
    network: Line
    address: int
    wave: Path | None = None
    edges: dict[int, list[tuple[int, int]]] = field(
        default_factory=lambda: {i: [] for i in range(len(SIGNALS))}
    )

    def __post_init__(self) -> None:
        self._library = load(self.library)
        self.lines = {NETWORK: self.network, DRIVE: drive_line(self.network.clk_hz)}
        switches = BAUDS[self.network.baud] + FORMS[self.network.form]
        positions = sum(int(on) << i for i, on in enumerate(switches))
        wave = str(self.wave.absolute()).encode() if self.wave else None
        with contextlib.chdir(self.folder):
            self._card = self._library.fuzz_open(positions, self.address, wave)
            self._library.fuzz_run(self._card, 1, 0)
        self._room = (Edge * ROOM)()
        self.bursts: dict[int, list[Burst]] = {NETWORK: [], DRIVE: []}
        self._rise: dict[int, int | None] = {NETWORK: None, DRIVE: None}

    def close(self) -> None:
        if self._card:
            self._library.fuzz_close(self._card)
            self._card = None

    @property
    def now(self) -> int:
        return self._library.fuzz_now(self._card)

    def sending(self, line: int) -> bool:
        return self._rise[line] is not None

    def play(self, line: int, edges: Iterable[tuple[float, int]]) -> None:
        """Levels of a far end, each from its time on. Of two at the same clock the last one counts."""
        merged: dict[int, int] = {}
        for at, level in edges:
            merged[round(at)] = level
        items = [Edge(at, line, level) for at, level in sorted(merged.items())]
        self._library.fuzz_play(self._card, line, (Edge * len(items))(*items), len(items))

    def hush(self, line: int) -> None:
        """A far end stops in the middle of whatever it sends."""
        self._library.fuzz_hush(self._card, line)

    def run(self, until: float, stops: int = DRIVERS) -> list[tuple[int, int]]:
        """Runs to a time or to the first edge of a driver; returns the drivers' edges: line, level."""
        self._library.fuzz_run(self._card, round(until), stops)
        switched = []
        while (count := self._library.fuzz_take_edges(self._card, self._room, ROOM)) > 0:
            for edge in self._room[:count]:
                self.edges[edge.signal].append((edge.at, edge.level))
                for line, signal in DE.items():
                    if edge.signal == signal:
                        switched.append((line, edge.level))
                        self._switch(line, edge.at, edge.level)
        return switched

    def sent(self, line: int) -> list[Burst]:
        """All bursts, one that is not over yet as far as it came."""
        rise = self._rise[line]
        if rise is None:
            return self.bursts[line]
        return [
            *self.bursts[line],
            Burst(rise, self.now, decode(self.lines[line], self.edges[TX[line]], rise)),
        ]

    def _switch(self, line: int, at: int, level: int) -> None:
        if level:
            self._rise[line] = at
            return
        rise = self._rise[line]
        self._rise[line] = None
        if rise is not None:
            edges = self.edges[TX[line]]
            self.bursts[line].append(Burst(rise, at, decode(self.lines[line], edges, rise)))
            edges.clear()

    def variables(self) -> list[tuple[str, int, int]]:
        """Name, words and bits of each public variable; only in a build with flips."""
        words, bits = ctypes.c_uint32(), ctypes.c_uint32()
        found = []
        for i in range(self._library.fuzz_variables(self._card)):
            name = self._library.fuzz_variable(self._card, i, ctypes.byref(words), ctypes.byref(bits))
            found.append((name.decode(), words.value, bits.value))
        return found

    def watch(self, variable: int) -> None:
        """From now on counts the clocks in which a variable is not 0."""
        self._library.fuzz_watch(self._card, variable)

    def watched(self) -> int:
        return self._library.fuzz_watched(self._card)

    def lit(self) -> set[str]:
        """The LEDs that are lit."""
        return {
            led for i, led in enumerate(SIGNALS) if led in LEDS and self.edges[i] and self.edges[i][-1][1]
        }

    def flip(self, variable: int, word: int, bit: int) -> None:
        self._library.fuzz_flip(self._card, variable, word, bit)


def decode(line: Line, edges: Sequence[tuple[int, int]], rise: int) -> list[Sent]:
    """The characters in the edges of a transmit pin, each bit sampled in its middle."""
    found, i, count = [], 0, len(edges)
    while i < count:
        start, level = edges[i]
        if level or start < rise:
            i += 1
            continue
        levels = []
        for number in range(line.character_bits):
            middle = start + (number + 0.5) * line.bit
            while i < count and edges[i][0] <= middle:
                level = edges[i][1]
                i += 1
            levels.append(level)
        byte = sum(bit << k for k, bit in enumerate(levels[1:9]))
        end = start + line.character_bits * line.bit
        found.append(Sent(start, end, byte, levels == line.levels(byte)))
    return found
