# SPDX-License-Identifier: Apache-2.0
"""The measuring bench: a card at its own clock, its two lines, a master and a drive.

The simulated card (sim/harness) takes edges on its inputs and returns the edges of its outputs. Every
measured time is between such edges, as on an oscilloscope at the pins. Unit of time: cycles of the card's
clock since the release of the reset. Times on a line are floats, because a bit need not be a whole number of
cycles.

    bench = Bench(LineFormat(19200, "8E1", STANDARD.clk_hz))
    talk = bench.ask(rtu.build(1, rtu.read_coils(0, 16)))
    talk.reply, talk.reply_start - talk.request_end
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from campaigns.bench import wave
from campaigns.bench.wave import t35
from regs.generated.card_tables import DRIVE_PAUSE_TICKS, TICKS_PER_BIT
from rtl.sources import ROOT, configurations
from sim.harness import library
from sim.harness.simulated_card import SIGNALS as ALL_SIGNALS
from sim.harness.simulated_card import SimulatedCard, mask
from sw.rtu2fc import switches
from tb.model import fc_telegram
from tb.model.vlt_drive import VltDrive
from tb.model.wire import CardCharacter, LineFormat, drive_line

# Outputs, then probes.
SIGNALS = (
    *("modbus_tx", "modbus_de", "drive_tx", "drive_de"),
    *("candidate", "commit", "order_reply", "order_telegram", "drive_candidate"),
)
MODBUS, DRIVE = 0, 1
UNIT_ADDRESS, BROADCAST_ADDRESS = 1, 0
BOOT_MS = 20  # BOOT-1, unless the configuration says otherwise
# The shortest response time a drive may have: two characters, as long as the pause (FC-8).
SHORTEST_DELAY_BITS = DRIVE_PAUSE_TICKS / TICKS_PER_BIT
# Silence that the master adds to t3.5: the tolerance of FRAME-1. conformance.py measures the limit itself.
EXTRA_SILENCE_BITS = 0.25
DRIVERS, PROBES = ("modbus_de", "drive_de"), SIGNALS[4:]
# The bench waits this long after the card's deadline, in bits of the network line and in s. With a
# slower core, the firmware's time comes on top.
MARGIN_BITS = 4
MARGIN_S, SLOW_MARGIN_S = 0.0003, 0.005
# The card counts the wait of FC-9 in ticks of 1/1200 s, and the repeat may have to wait for the pause.
WAIT_MARGIN_S = 0.006
DEFAULT_WAIT_S = 0.15  # register 40003
# Before the end of the wait: start of a late reply (the shortest reply lasts twice that), end of a last one.
LATE_S, PUNCTUAL_S = 0.004, 0.002


class BenchError(Exception):
    """Error for the user, in one line."""


@dataclass(frozen=True)
class Build:
    """A card to measure: a configuration of configs.toml."""

    config: str = "standard"

    @property
    def clk_hz(self) -> int:
        return configurations()[self.config]["clk_hz"]

    @functools.cached_property
    def library(self) -> Path:
        """The library with the card. It is built when it is missing or its sources have changed."""
        return library.build(self.clk_hz, config=self.config)

    @property
    def image_folder(self) -> Path:
        folder = (ROOT / configurations()[self.config]["firmware_hex"]).parent
        if not (folder / library.IMAGE).exists():
            raise BenchError(f"{(folder / library.IMAGE).relative_to(ROOT)} is missing; run `make firmware`")
        return folder

    @property
    def boot_s(self) -> float:
        return configurations()[self.config].get("boot_ms", BOOT_MS) / 1000

    @property
    def margin_s(self) -> float:
        return MARGIN_S if self == STANDARD else SLOW_MARGIN_S


STANDARD, TINY = Build(), Build("tiny")


@dataclass(frozen=True)
class DriveAnswer:
    """The drive's way to answer one telegram. `is_reply`: the card must accept it as the reply (FC-8)."""

    name: str = "at once"
    is_reply: bool = True
    # The correct reply to the reply that the drive sends; None: it sends nothing.
    content: Callable[[bytes], bytes | None] = lambda reply: reply
    # The reply to the bytes on the line, and more arguments of send().
    wire: Callable[[bytes], tuple[bytes, dict]] = lambda reply: (reply, {})
    # None: the reply starts after drive_delay_bits. Else it "starts" or "ends" just before the wait ends.
    at_the_end: str | None = None


CORRECT = DriveAnswer()


@dataclass(frozen=True)
class Exchange:
    """A telegram and the drive's answer. Times in cycles; `end`: end of the last traffic."""

    telegram: list[CardCharacter]
    broadcast: bool
    answer: DriveAnswer
    start: float
    end: float
    reply: bytes | None = None

    @property
    def telegram_end(self) -> float:
        return self.telegram[-1].end

    @property
    def answered(self) -> bool:
        return self.reply is not None and self.answer.is_reply


@dataclass
class Talk:
    """A request, and the traffic that it caused. Times in cycles."""

    request: bytes
    request_start: float
    request_end: float
    telegrams: list[list[CardCharacter]] = field(default_factory=list)
    exchanges: list[Exchange] = field(default_factory=list)
    answers: list[list[CardCharacter]] = field(default_factory=list)
    marks: dict[str, list[int]] = field(default_factory=dict)  # rising edges of the probes
    de: dict[str, wave.Spans] = field(default_factory=dict)  # driver on, off
    form: list[str] = field(default_factory=list)  # faults in the bits and drivers of the card
    quiet_since: float = float("-inf")  # end of the last traffic on the drive line before the request
    wait: float = 0.0  # FC-9, in cycles

    @property
    def replies(self) -> list[bytes]:
        return [bytes(c.byte for c in answer) for answer in self.answers]

    @property
    def sent(self) -> list[bytes]:
        return [bytes(c.byte for c in telegram) for telegram in self.telegrams]

    @property
    def reply(self) -> bytes | None:
        return self.replies[0] if self.answers else None

    @property
    def reply_start(self) -> float:
        return self.answers[0][0].start

    @property
    def reply_end(self) -> float:
        return self.answers[0][-1].end

    def clocks(self, after: str, until: str) -> int | None:
        """Clocks from the first strobe of one probe to the next strobe of another; None without either."""
        first = next(iter(self.marks.get(after, [])), None)
        if first is None:
            return None
        return next((at - first for at in self.marks.get(until, []) if at >= first), None)


class Bench:
    """The card after its reset, a master on the network line and a simulated drive on the other."""

    def __init__(self, line: LineFormat, *, build: Build = STANDARD, drive: VltDrive | None = None) -> None:
        self.line = line
        self.drive_line = drive_line(line.clk_hz)
        self.clk_hz = line.clk_hz
        self.drive = drive
        self.drive_wait_s = DEFAULT_WAIT_S
        self.drive_delay_bits = SHORTEST_DELAY_BITS
        # The drive's answers to the next telegrams, in turn. Later telegrams are answered correctly.
        self.drive_answers: list[DriveAnswer] = []
        self.told: list[tuple[bytes, bool]] = []  # all telegrams, each with whether it had a good reply
        self.unasked: list[str] = []  # traffic of the card while nothing was due
        self._margin_s = build.margin_s
        positions = switches.BAUDS[line.baud] + switches.FORMS[line.form]
        self._card = SimulatedCard(
            *(build.library, build.image_folder, int(positions[::-1], 2), UNIT_ADDRESS), watched=SIGNALS
        )
        self._card.run(1)
        self.edges: dict[str, list[tuple[int, int]]] = {name: [] for name in SIGNALS}
        self.silent_since = [0.0, 0.0]  # end of the last traffic, network and drive line
        self._stepped_us = 0
        self.idle_until(build.boot_s * self.clk_hz)
        # The card counts silence from its own start, some time after the reset.
        self.silent_since[MODBUS] = float(self.now)

    def close(self) -> None:
        self._card.close()

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def now(self) -> int:
        return self._card.now

    @property
    def seconds(self) -> float:
        return self.now / self.clk_hz

    def memory(self, words: Iterable[int]) -> list[int]:
        return [self._card.memory_word(word) for word in words]

    # ------------------------------------------------------------ waveforms

    def play(self, where: int, edges: Iterable[tuple[float, int]]) -> None:
        """Sets levels of a line, each from its time on. Of two at the same clock the last one counts."""
        self._card.play(where, list({round(at): level for at, level in edges}.items()))

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
        """Sends a frame on a line; returns the end of its last stop bit.

        error: the sender's rate is (1 + error) times the nominal rate. gaps: number of a character to the
        idle bits before it. bad_parity, bad_stop: number of the damaged character.
        """
        line = self.line if where == MODBUS else self.drive_line
        bit = line.bit / (1 + error)
        at, edges = start, []
        for number, byte in enumerate(data):
            at += (gaps or {}).get(number, 0.0) * bit
            flaw = "parity" if number == bad_parity else "stop" if number == bad_stop else ""
            levels = line.levels(byte, flaw)
            edges += [(at + i * bit, level) for i, level in enumerate(levels)]
            at += len(levels) * bit
            edges.append((at, 1))
        self.play(where, edges)
        self.silent_since[where] = at
        return at

    def run(self, until: float, stops: Iterable[str] = ()) -> int:
        """Runs to a time, or until one of the signals falls."""
        now = self._card.run(round(until), falling=mask(stops))
        for at, signal, level in self._card.take_edges():
            self.edges[ALL_SIGNALS[signal]].append((at, level))
        return now

    def forget(self) -> None:
        """Drops all recorded edges. The lines must be silent."""
        for edges in self.edges.values():
            edges.clear()

    def idle_until(self, time: float) -> None:
        """Runs to `time` while nothing is due. Traffic of the card until then goes to `unasked`."""
        self.forget()
        self.run(time - 1)
        for name in SIGNALS[:4]:
            if edges := self.edges[name]:
                self.unasked.append(f"{name} moves at {edges[0][0] / self.clk_hz:.6f} s, unasked")
        self.forget()

    def bursts(self, where: int) -> list[list[CardCharacter]]:
        """The card's characters, split where its driver was off."""
        if where == MODBUS:
            return wave.bursts(self.line, self.edges["modbus_tx"], self.spans("modbus_de"))
        return wave.bursts(self.drive_line, self.edges["drive_tx"], self.spans("drive_de"))

    def spans(self, name: str) -> wave.Spans:
        """Times of a signal's rise and fall. A signal that is still high ends now."""
        rises = [at for at, level in self.edges[name] if level]
        falls = [at for at, level in self.edges[name] if not level]
        return list(zip(rises, [*falls, self.now][: len(rises)], strict=True))

    # ------------------------------------------------------------ talking

    def next_start(self, idle_bits: float = 0.0) -> float:
        """The earliest time for a new frame: t3.5 after the last traffic, and `idle_bits` more."""
        return max(self.now + 1, self.silent_since[MODBUS] + t35(self.line) + idle_bits * self.line.bit)

    def ask(self, request: bytes, *, start: float | None = None, **how: object) -> Talk:
        """Sends a request and waits for the answer, or until no answer can come any more."""
        start = self.next_start(EXTRA_SILENCE_BITS) if start is None else start
        self.idle_until(start)
        return self.follow(Talk(request, start, self.send(MODBUS, request, start, **how)))

    def ask_and_leave(self, request: bytes) -> Talk:
        """Sends a request and returns when the drive's reply to it is about to start."""
        start = self.next_start(EXTRA_SILENCE_BITS)
        self.idle_until(start)
        talk = Talk(request, start, self.send(MODBUS, request, start), quiet_since=self.silent_since[DRIVE])
        self.run(talk.request_end + t35(self.line) + 0.1 * self.clk_hz, ["drive_de"])
        self._drive_answers(talk)
        self._take(talk)
        self.forget()
        return talk

    def follow(self, talk: Talk, *, until: float = 0.0) -> Talk:
        """Waits for the answer to a request that is being sent, and at least to `until`."""
        talk.quiet_since = self.silent_since[DRIVE]
        pause_over = talk.quiet_since + SHORTEST_DELAY_BITS * self.drive_line.bit
        deadline = max(talk.request_end + t35(self.line), pause_over) + self._margin()
        self._attend(talk, max(deadline, until), until)
        self._take(talk)
        return talk

    def _take(self, talk: Talk) -> None:
        """Copies the recorded traffic into the talk."""
        talk.answers, talk.telegrams = self.bursts(MODBUS), self.bursts(DRIVE)
        talk.de = {name: self.spans(name) for name in DRIVERS}
        talk.marks = {name: [at for at, level in self.edges[name] if level] for name in PROBES}
        talk.wait = self.drive_wait_s * self.clk_hz
        self.told += [(bytes(c.byte for c in e.telegram), e.answered) for e in talk.exchanges]
        for name, line in (("modbus", self.line), ("drive", self.drive_line)):
            wrong = wave.faults(line, self.edges[f"{name}_tx"], talk.de[f"{name}_de"])
            talk.form += [f"{name} line: {fault}" for fault in wrong]

    def _margin(self) -> float:
        return MARGIN_BITS * self.line.bit + self._margin_s * self.clk_hz

    def _attend(self, talk: Talk, deadline: float, until: float) -> None:
        """Lets the drive answer each telegram; ends with the card's reply, or at the deadline."""
        replies = telegrams = 0
        while self.now < deadline or any(self._level(name) for name in DRIVERS):
            self.run(max(deadline, self.now + self.line.bit), DRIVERS)
            if len(spans := self._ended("modbus_de")) > replies:
                replies = len(spans)
                if bursts := self.bursts(MODBUS):
                    self.silent_since[MODBUS] = bursts[-1][-1].end
                if self.now >= until:
                    return
            if len(spans := self._ended("drive_de")) > telegrams:
                telegrams = len(spans)
                if self.bursts(DRIVE):
                    deadline = max(deadline, self._drive_answers(talk))

    def _drive_answers(self, talk: Talk) -> float:
        """Sends the drive's answer to the telegram that just ended; returns the deadline of the card."""
        burst = self.bursts(DRIVE)[-1]
        end = self.silent_since[DRIVE] = burst[-1].end
        request = bytes(c.byte for c in burst)
        broadcast = len(request) > 2 and fc_telegram.is_broadcast(request[2])
        if self.drive and broadcast:
            self.drive.telegram(request)
        if self.drive is None or broadcast:
            talk.exchanges.append(Exchange(burst, broadcast, CORRECT, end, end))
            return end + self._margin()
        now_us = int(end / self.clk_hz * 1e6)
        self.drive.step(now_us - self._stepped_us)
        self._stepped_us = now_us
        answer = self.drive_answers.pop(0) if self.drive_answers else CORRECT
        reply = self.drive.telegram(request)
        reply = reply and answer.content(reply)
        wait_over = end + (self.drive_wait_s + WAIT_MARGIN_S) * self.clk_hz
        if not reply:
            talk.exchanges.append(Exchange(burst, False, answer, end, end))
            return wait_over + self._margin()
        data, how = answer.wire(reply)
        start = end + self.drive_delay_bits * self.drive_line.bit
        if answer.at_the_end == "starts":
            start = end + (self.drive_wait_s - LATE_S) * self.clk_hz
        elif answer.at_the_end == "ends":
            length = len(data) * self.drive_line.character_bits * self.drive_line.bit
            start = end + (self.drive_wait_s - PUNCTUAL_S) * self.clk_hz - length
        done = self.send(DRIVE, data, start, **how)
        talk.exchanges.append(Exchange(burst, False, answer, start, done, reply))
        pause = SHORTEST_DELAY_BITS * self.drive_line.bit
        return (done if answer.is_reply else max(wait_over, done + pause)) + self._margin()

    def _level(self, name: str) -> int:
        edges = self.edges[name]
        return edges[-1][1] if edges else 0

    def _ended(self, name: str) -> list[int]:
        return [at for at, level in self.edges[name] if not level]
