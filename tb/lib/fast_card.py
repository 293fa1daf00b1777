# SPDX-License-Identifier: Apache-2.0
"""The whole card without cocotb, for tests that last seconds of the card's time.

The same Verilog and the same firmware image as elsewhere, Verilated and run by sim/harness:
about 5 million clocks a second instead of half a million under cocotb. Times are in ps, counted from
power-up; the resolution is a clock, by default of the slow card of tb/lib/config.py. A drive answers through
any model (tb/agents/fc_slave.py).
"""

from __future__ import annotations

import functools
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest

from regs.generated.card_tables import DRIVE_BAUD
from sim.harness import simulated_card
from sim.harness.library import BuildError, build
from sim.harness.simulated_card import APART, CROSSED, INPUTS, SimulatedCard
from tb.agents import rtu
from tb.agents.edges import Trace
from tb.agents.uart import Character, Flaws, Format, Frame, waveform
from tb.lib.card import MS, baud_switches, switch_word
from tb.lib.config import SLOW_HZ, boot_clocks
from tb.lib.runner import firmware
from tb.lib.seeds import seeded

OUTPUTS = tuple(name for name in simulated_card.SIGNALS if name not in ("order_reply", "order_telegram"))
LEDS = OUTPUTS[4:8]
COLOURS = {(0, 0): "off", (1, 0): "red", (0, 1): "green", (1, 1): "orange"}
RESET_CLOCKS = 10  # SAFE-5
# From the telegram's last stop bit to the reply's start bit: the pause of two characters and a little more.
REPLY_DELAY_BITS = 23


@functools.cache
def library(config: str, clk_hz: int, extra: str = "", parameters: tuple[tuple[str, int], ...] = ()) -> Path:
    """The card of the configuration at a clock, built unless this very content was built before."""
    try:
        return build(clk_hz, config=config, parameters=dict(parameters), extra=extra)
    except BuildError as error:
        pytest.fail(str(error), pytrace=False)


@dataclass(frozen=True)
class Shown:
    """A LED colour and its start."""

    since_ps: int
    colour: str


def steps_ms(history: list[Shown]) -> list[tuple[str, float]]:
    """Each colour with its duration in ms, without the last one, which still lasts."""
    return [(now.colour, (then.since_ps - now.since_ps) / MS) for now, then in pairwise(history)]


class Line:
    """One line of the card: the frames that the card sent on it, and transmissions to the card."""

    def __init__(self, card: FastCard, name: str, fmt: Format):
        self.card, self.name, self.fmt = card, name, fmt
        self.tx = card.recorded[f"{name}_tx"]
        self.de = card.recorded[f"{name}_de"]
        self._free_ps = 0
        self._frames: list[Frame] = []
        self._read = 0  # edges of tx that are in these frames

    @property
    def driven(self) -> bool:
        return bool(self.de) and self.de[-1][1] == 1

    def send(self, data: bytes, delay_ps: float = 0, flaws: Flaws | None = None) -> int:
        """Plans a transmission `delay_ps` after the last one on the line; returns its last stop bit's end."""
        edges, length = waveform(self.fmt, data, flaws or Flaws())
        busy_until = max(self._free_ps, self.de[-1][0] if self.de else 0)
        start = max(self.card.now_ps, busy_until + delay_ps)
        for at, level in edges:
            self.card.plan(start + at, f"{self.name}_line", level)
        self._free_ps = round(start + length)
        return self._free_ps

    def be_silent(self) -> None:
        """Forgets the transmissions that were planned."""
        self._free_ps = self.card.now_ps

    def frames(self) -> list[Frame]:
        """Frames of the card, one for each time that DE was high."""
        for (rise, _), (fall, _) in list(zip(self.de[::2], self.de[1::2], strict=False))[len(self._frames) :]:
            end = bisect_right(self.tx, (fall, 1), self._read)
            edges = self.tx[self._read : end]
            self._read = end
            self._frames.append(Frame(tuple(self._characters(edges, rise))))
        return list(self._frames)

    def _characters(self, edges: list[tuple[int, int]], rise: int) -> Iterator[Character]:
        return (c for c in Trace(self.fmt, edges).characters if c.start_ps >= rise)

    def check(self) -> None:
        """Every character lies in a whole frame, and DE was high for each."""
        frames = self.frames()
        assert all(frame.ok for frame in frames), f"{self.name}: {frames}"
        heard = [c for frame in frames for c in frame.characters]
        assert heard == Trace(self.fmt, self.tx).characters, f"{self.name}: characters without DE"


# Seed of the registers at power-up in the runs that diagrams and recordings show. It decides the phases of
# the tick counters, and so the times.
SHOWN_SEED = 1


class FastCard:
    """A card that was just switched on.

    drive: telegram to reply, None for silence. clk_hz: default that of the slow card. seed: of the registers
    at power-up (SAFE-5); without it each card draws one and prints it. extra: "flips" for `flip`.
    wave: FST file, closed with the card.
    dialect: folder of the image below that of the configuration, or any folder with a firmware.hex.
    parameters: of rtl/rtu2fc.v, beside the configuration's.
    """

    def __init__(
        self,
        switches: str | None = None,
        baud: int = 9600,
        form: str = "8E1",
        address: int = 1,
        drive: Callable[[bytes], bytes | None] = lambda telegram: None,
        config: str = "standard",
        clk_hz: int | None = None,
        seed: int | None = None,
        reset_clocks: int = RESET_CLOCKS,
        dialect: str = "",
        extra: str = "",
        parameters: tuple[tuple[str, int], ...] = (),
        wave: Path | None = None,
        **wires: int,
    ):
        if seed is None:
            seed = seeded("register contents at power-up").randrange(1, 1 << 31)
        clk_hz = clk_hz or SLOW_HZ[config]
        self.config = config
        self.period_ps = round(1e12 / clk_hz)
        self.boot_ms = boot_clocks(config) * self.period_ps / MS
        self._card = SimulatedCard(
            library(config, clk_hz, "waves" if wave else extra, parameters),
            firmware(config).parent / dialect,
            switch_word(switches or baud_switches(baud, form)),
            address,
            watched=OUTPUTS,
            reset=False,
            wave=wave,
            seed=seed,
        )
        self._clock = 0
        # Every change of every output, as (ps, new level).
        self.recorded: dict[str, list[tuple[int, int]]] = {name: [] for name in OUTPUTS}
        self.drive_model = drive
        self.reply_bits = REPLY_DELAY_BITS
        self.modbus = Line(self, "modbus", Format.named(baud, form))
        self.drive = Line(self, "drive", Format.named(DRIVE_BAUD, "8E1"))
        # Colours of each LED, with the time of each change.
        self.shown: dict[str, list[Shown]] = {led: [Shown(0, "off")] for led in ("modbus", "drive")}
        self._lit = dict.fromkeys(LEDS, 0)
        self.set(rst_n=0, wired=0)
        self.set(**wires)
        self.plan(reset_clocks * self.period_ps, "rst_n", 1)

    def close(self) -> None:
        self._card.close()

    def __enter__(self) -> FastCard:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ------------------------------------------------------------ pins

    @property
    def now_ps(self) -> int:
        return self._clock * self.period_ps

    def plan(self, when_ps: float, pin: str, value: int) -> None:
        if pin == "wired":
            pin, value = "wiring", CROSSED if value else APART
        self._card.play(INPUTS.index(pin), [(round(when_ps / self.period_ps), value)])

    def set(self, **pins: int) -> None:
        for pin, value in pins.items():
            self.plan(self.now_ps, pin, value)

    def reset(self, clocks: int = RESET_CLOCKS) -> int:
        """Resets the card, with both far ends silent from now on; returns when the reset was released."""
        for number, line in enumerate((self.modbus, self.drive)):
            self._card.hush(number)
            line.be_silent()
        self.set(rst_n=0)
        self.run_until(self.now_ps + clocks * self.period_ps)
        self.set(rst_n=1)
        return self.now_ps

    # ------------------------------------------------------------ time

    def run_until(self, when_ps: float, *stop: str) -> bool:
        """Runs the card; the drive answers. True if one of the outputs `stop` changed before `when_ps`."""
        until = round(when_ps / self.period_ps)
        mask = simulated_card.mask({*stop, "drive_de"})
        while self._clock < until:
            self._clock = self._card.run(until, mask, mask)
            changed = self._take_changes()
            if ("drive_de", 0) in changed:
                self._answer()
            if any(pin in stop for pin, _ in changed):
                return True
        return False

    def run(self, ms: float) -> None:
        self.run_until(self.now_ps + ms * MS)

    def _take_changes(self) -> list[tuple[str, int]]:
        changes = [
            (clock, simulated_card.SIGNALS[signal], value) for clock, signal, value in self._card.take_edges()
        ]
        for clock, pin, value in changes:
            self.recorded[pin].append((clock * self.period_ps, value))
            if pin in LEDS:
                self._light(clock * self.period_ps, pin, value)
        last = max((clock for clock, _, _ in changes), default=0)
        return [(pin, value) for clock, pin, value in changes if clock == last]

    def _light(self, when_ps: int, pin: str, value: int) -> None:
        self._lit[pin] = value
        led = pin.split("_")[1]
        history = self.shown[led]
        if history[-1].since_ps == when_ps:
            history.pop()  # red and green changed at once
        now = COLOURS[self._lit[f"led_{led}_red"], self._lit[f"led_{led}_green"]]
        if not history or history[-1].colour != now:
            history.append(Shown(when_ps, now))

    def _answer(self) -> None:
        reply = self.drive_model(self.drive.frames()[-1].data)
        if reply is not None:
            self.drive.send(reply, self.reply_bits * self.drive.fmt.bit_ps)

    # ------------------------------------------------------------ for tests

    def memory_word(self, word: int) -> int:
        """A word of the firmware memory, without its parity."""
        return self._card.memory_word(word)

    @functools.cached_property
    def variables(self) -> dict[str, int]:
        """Number of each register and memory, by its name below the card."""
        names = [variable for variable, _, _ in self._card.variables()]
        return {name.removeprefix("TOP.rtu2fc."): number for number, name in enumerate(names)}

    def flip(self, name: str, word: int, bit: int) -> None:
        """Flips a bit of a register or memory."""
        self._card.flip(self.variables[name], word, bit)

    def recorded_so_far(self) -> dict[str, list[tuple[int, int]]]:
        """Every change of every output until now, as (ps, new level)."""
        return {name: list(changes) for name, changes in self.recorded.items()}

    def led(self, which: str) -> str:
        """Present colour of an LED."""
        return self.shown[which][-1].colour

    def request(self, adu: bytes, timeout_ms: float = 100) -> Frame | None:
        """Sends a request; returns the answer, or None after the time-out."""
        end = self.modbus.send(adu, 1.05 * rtu.t35_ps(self.modbus.fmt.baud))
        return self.next_frame(self.modbus, end + timeout_ms * MS)

    def next_frame(self, line: Line, limit_ps: float) -> Frame | None:
        """Runs to the end of the card's next frame on a line; None if there is none by then."""
        before = len(line.frames())
        while self.run_until(limit_ps, f"{line.name}_de"):
            if len(line.frames()) > before:
                return line.frames()[-1]
        return None
