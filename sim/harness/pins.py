# SPDX-License-Identifier: Apache-2.0
"""The fuzzer's card from Python: characters onto its two lines, and what it sends taken apart.

Unit of time: clocks since the release of the reset; floats where a bit is no whole number of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sim.harness import simulated_card
from sim.harness.simulated_card import SimulatedCard
from sw.rtu2fc.switches import BAUDS, FORMS
from tb.model.wire import Burst, CardCharacter, LineFormat, drive_line

SIGNALS = simulated_card.SIGNALS[:8]
NETWORK, DRIVE = 0, 1
TX = {NETWORK: SIGNALS.index("modbus_tx"), DRIVE: SIGNALS.index("drive_tx")}
DE = {NETWORK: SIGNALS.index("modbus_de"), DRIVE: SIGNALS.index("drive_de")}
DRIVERS = sum(1 << signal for signal in DE.values())
LEDS = SIGNALS[4:]


@dataclass
class Pins:
    """A card that was just switched on. `folder`: where its firmware image lies.

    `more`: signals of the harness whose edges are kept, beside SIGNALS.
    """

    library: Path
    folder: Path
    network: LineFormat
    address: int
    wave: Path | None = None
    edges: dict[int, list[tuple[int, int]]] = field(
        default_factory=lambda: {i: [] for i in range(len(simulated_card.SIGNALS))}
    )
    more: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.lines = {NETWORK: self.network, DRIVE: drive_line(self.network.clk_hz)}
        switches = BAUDS[self.network.baud] + FORMS[self.network.form]
        positions = sum(int(on) << i for i, on in enumerate(switches))
        self._card = SimulatedCard(
            self.library, self.folder, positions, self.address, watched=SIGNALS + self.more, wave=self.wave
        )
        self._card.run(1)
        self.bursts: dict[int, list[Burst]] = {NETWORK: [], DRIVE: []}
        self._rise: dict[int, int | None] = {NETWORK: None, DRIVE: None}

    def close(self) -> None:
        self._card.close()

    @property
    def now(self) -> int:
        return self._card.now

    def sending(self, line: int) -> bool:
        return self._rise[line] is not None

    def play(self, line: int, edges: Iterable[tuple[float, int]]) -> None:
        """Levels of a far end, each from its time on. Of two at the same clock the last one counts."""
        merged: dict[int, int] = {}
        for at, level in edges:
            merged[round(at)] = level
        self._card.play(line, sorted(merged.items()))

    def hush(self, line: int) -> None:
        """A far end stops in the middle of whatever it sends."""
        self._card.hush(line)

    def run(self, until: float, stops: int = DRIVERS) -> list[tuple[int, int]]:
        """Runs to a time or to the first edge of a driver; returns the drivers' edges: line, level."""
        self._card.run(round(until), stops, stops)
        switched = []
        for at, signal, level in self._card.take_edges():
            self.edges[signal].append((at, level))
            for line, driver in DE.items():
                if signal == driver:
                    switched.append((line, level))
                    self._switch(line, at, level)
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

    def memory_word(self, word: int) -> int:
        """A word of the firmware memory, without its parity."""
        return self._card.memory_word(word)

    def variables(self) -> list[tuple[str, int, int]]:
        """Name, words and bits of each public variable; only in a build with flips."""
        return self._card.variables()

    def watch(self, variable: int) -> None:
        """From now on counts the clocks in which a variable is not 0."""
        self._card.watch(variable)

    def watched(self) -> int:
        return self._card.watched()

    def lit(self) -> set[str]:
        """The LEDs that are lit."""
        return {
            led for i, led in enumerate(SIGNALS) if led in LEDS and self.edges[i] and self.edges[i][-1][1]
        }

    def state(self) -> tuple:
        """Card and lines as they are now, and all that the card has sent, to be compared within forks."""
        sent = tuple((b.rise, b.fall, b.data) for line in self.lines for b in self.bursts[line])
        return self.now, self._card.digest(), sent, str(self.edges), self.watched()

    def flip(self, variable: int, word: int, bit: int) -> None:
        self._card.flip(variable, word, bit)


def decode(line: LineFormat, edges: Sequence[tuple[int, int]], rise: int) -> list[CardCharacter]:
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
        found.append(CardCharacter(start, end, byte, levels == line.levels(byte)))
    return found
