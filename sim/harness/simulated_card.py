# SPDX-License-Identifier: Apache-2.0
"""A card of the harness from Python: input edges in, output edges out (card_library.cpp, through ctypes).

Unit of time: clocks since the release of the reset, or since power-up if the caller drives rst_n. Three faces
build on it: `Bench` (campaigns/bench/card.py), `Pins` (pins.py) and `FastCard` (tb/lib/fast_card.py).
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
from collections.abc import Iterable, Iterator
from pathlib import Path

# In the order of the enums Signal (card_model.h), Input and Wiring (line_player.h).
SIGNALS = (
    *("modbus_tx", "modbus_de", "drive_tx", "drive_de"),
    *("led_modbus_red", "led_modbus_green", "led_drive_red", "led_drive_green"),
    *("modbus_rx", "drive_rx", "candidate", "commit", "revoke", "order_reply", "order_telegram"),
    *("reply_queued", "telegram_queued", "drive_candidate", "drive_good"),
)
INPUTS = (
    *("modbus_line", "drive_line", "cut_to_modbus", "cut_to_drive", "flip_to_modbus", "flip_to_drive"),
    *("wiring", "rst_n", "sw_baud", "sw_addr"),
)
PAIRS, APART, CROSSED = range(3)
NUMBER = {name: number for number, name in enumerate(SIGNALS)}
ROOM = 4096


class Edge(ctypes.Structure):
    _fields_ = (("at", ctypes.c_int64), ("signal", ctypes.c_int32), ("level", ctypes.c_int32))


@functools.cache
def load(path: Path) -> ctypes.CDLL:
    loaded = ctypes.CDLL(str(path))
    pointer, size, clocks, integer = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int64, ctypes.c_int
    edges, number, text = ctypes.POINTER(Edge), ctypes.c_uint32, ctypes.c_char_p
    found = ctypes.POINTER(number)
    for name, result, arguments in (
        ("card_open", pointer, [number, number, integer, number, integer, text]),
        ("card_close", None, [pointer]),
        ("card_now", clocks, [pointer]),
        ("card_play", None, [pointer, size, edges, size]),
        ("card_hush", None, [pointer, size]),
        ("card_run", clocks, [pointer, clocks, number, number]),
        ("card_take_edges", size, [pointer, edges, size]),
        ("card_memory_word", number, [pointer, size]),
        # In a build with flips only.
        ("card_variables", size, [pointer]),
        ("card_variable", text, [pointer, size, found, found]),
        ("card_watch", None, [pointer, size]),
        ("card_watched", ctypes.c_uint64, [pointer]),
        ("card_flip", None, [pointer, size, number, number]),
        ("card_digest", ctypes.c_uint64, [pointer]),
    ):
        if hasattr(loaded, name):
            function = getattr(loaded, name)
            function.restype, function.argtypes = result, arguments
    return loaded


def mask(names: Iterable[str]) -> int:
    return sum(1 << NUMBER[name] for name in names)


class SimulatedCard:
    """A card that was just switched on.

    `folder`: where its firmware image lies. `watched`: names of the signals whose edges are kept. `reset`:
    the card goes through its reset here, else the caller drives rst_n. `wave`: FST file, in a build with
    waves. `seed`: of what every register holds at power-up; 0: zeros.
    """

    def __init__(
        self,
        library: Path,
        folder: Path,
        sw_baud: int,
        sw_addr: int,
        *,
        watched: Iterable[str] = SIGNALS,
        reset: bool = True,
        wave: Path | None = None,
        seed: int = 1,
    ) -> None:
        self._library = load(library)
        self._room = (Edge * ROOM)()
        path = str(wave.absolute()).encode() if wave else None
        # The model reads the firmware image from the working directory.
        with contextlib.chdir(folder):
            self._card = self._library.card_open(sw_baud, sw_addr, seed, mask(watched), reset, path)

    def close(self) -> None:
        if self._card:
            self._library.card_close(self._card)
            self._card = None

    @property
    def now(self) -> int:
        return self._library.card_now(self._card)

    def play(self, which: int, edges: Iterable[tuple[int, int]]) -> None:
        """Levels of an input, each from its time on."""
        items = [Edge(at, which, level) for at, level in edges]
        self._library.card_play(self._card, which, (Edge * len(items))(*items), len(items))

    def hush(self, line: int) -> None:
        """Takes back the levels of a line that are not due yet; the line is idle from now on."""
        self._library.card_hush(self._card, line)

    def run(self, until: int, rising: int = 0, falling: int = 0) -> int:
        """Runs to a time, or to the first edge of a signal whose bit is set; returns the time."""
        return self._library.card_run(self._card, until, rising, falling)

    def take_edges(self) -> Iterator[tuple[int, int, int]]:
        """Time, signal and level of each edge since the last call."""
        while (count := self._library.card_take_edges(self._card, self._room, ROOM)) > 0:
            for edge in self._room[:count]:
                yield edge.at, edge.signal, edge.level

    def memory_word(self, word: int) -> int:
        return self._library.card_memory_word(self._card, word)

    def variables(self) -> list[tuple[str, int, int]]:
        """Name, words and bits of each register and memory."""
        words, bits = ctypes.c_uint32(), ctypes.c_uint32()
        found = []
        for i in range(self._library.card_variables(self._card)):
            name = self._library.card_variable(self._card, i, ctypes.byref(words), ctypes.byref(bits))
            found.append((name.decode(), words.value, bits.value))
        return found

    def watch(self, variable: int) -> None:
        """From now on counts the clocks in which a variable is not 0."""
        self._library.card_watch(self._card, variable)

    def watched(self) -> int:
        return self._library.card_watched(self._card)

    def digest(self) -> int:
        """A number of all that the card holds, to be compared within a process and its forks."""
        return self._library.card_digest(self._card)

    def flip(self, variable: int, word: int, bit: int) -> None:
        self._library.card_flip(self._card, variable, word, bit)
