# SPDX-License-Identifier: Apache-2.0
"""Finds the line faults at which the whole card, measured on its pins, misses a good request.

A point is a line with one fault of one size. It holds if each of many random requests gets its right answer.
On the network line the request is distorted, on the drive line the drive's reply to the telegram. In both
cases the right Modbus reply must come at the first try. Limits are found by halving the interval.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

from campaigns.fuzz.case import BOOT_S, BUDGET_CLOCKS, DRIVE_DELAY_BITS, PARAMETER, spoilt
from campaigns.line_quality.limits import QUANTITIES, Quantity
from campaigns.line_quality.waveform import Badness, edges
from sim.harness.library import Target
from sim.harness.pins import DRIVE, NETWORK, Pins
from tb.agents import rtu
from tb.model.card import FUNCTIONS, CardModel
from tb.model.vlt_drive import VltDrive
from tb.model.wire import LineFormat

ADDRESS = 1
OWN = Target()
# Factors: below the first errors of theory, and above the last ones.
SURE, TOO_BAD = 0.9, 1.1
SHORTEST, LONGEST = 6, 40  # random bytes of a request
PATTERNS = (b"\x55", b"\x00", b"\xff", b"\x80", b"\x7f", b"\x01")
# After a missed request: time for the card to finish.
RECOVERY_BITS = 60
DRIVE_RECOVERY_S = 0.4  # both waits of FC-9


def request(rng: random.Random) -> bytes:
    """A PDU that the card answers without the drive. An unknown function may have any data."""
    roll = rng.random()
    if roll < 0.2:
        return rtu.read_coils(rng.randrange(64), rng.randrange(1, 65))
    count = rng.randrange(SHORTEST, LONGEST)
    data = rng.choice(PATTERNS) * count if roll < 0.35 else rng.randbytes(count)
    return bytes([rng.choice([code for code in range(1, 0x80) if code not in FUNCTIONS])]) + data


@dataclass
class Prober:
    """A card after power-up, and its master."""

    line: LineFormat
    target: Target = OWN
    line_name = "network"

    def __post_init__(self) -> None:
        library = self.target.library(self.line.clk_hz)
        self.pins = Pins(library, self.target.image_folder("card"), self.line, ADDRESS)
        self.pins.run(BOOT_S * self.line.clk_hz)
        self.characters = 0
        # Model of the card's memory, which does not change here.
        self.model = CardModel()

    def close(self) -> None:
        self.pins.close()

    def __enter__(self) -> Prober:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self, rng: random.Random) -> float:
        """Start at any phase of the card's bits, after enough silence on the line."""
        silence = self.line.t35_bits + 2 + rng.random()
        return self.pins.now + 2 + silence * self.line.bit

    def answered(self, bad: Badness, rng: random.Random) -> bool:
        pdu = request(rng)
        data, begin = rtu.build(ADDRESS, pdu), self.start(rng)
        self.characters += len(data)
        wave, end = edges(self.line, data, begin, bad, rng)
        self.pins.play(NETWORK, wave)
        right = self._reply(end) == rtu.build(ADDRESS, CardModel().request(pdu).reply)
        if not right:
            self.pins.run(self.pins.now + RECOVERY_BITS * self.line.bit)
        return right

    def _reply(self, end: float) -> bytes | None:
        """The card's answer to a request that ends at `end`."""
        bursts = self.pins.bursts[NETWORK]
        bursts.clear()
        deadline = end + (self.line.t35_bits + 3) * self.line.bit + BUDGET_CLOCKS
        while self.pins.now < round(deadline) or self.pins.sending(NETWORK):
            self.pins.run(max(deadline, self.pins.now + self.line.bit))
            if bursts:
                return bursts[0].data
        return None


@dataclass
class DriveProber(Prober):
    """A good network line; the drive's replies are distorted."""

    line_name = "drive"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.drive = VltDrive()

    def answered(self, bad: Badness, rng: random.Random) -> bool:
        data = rtu.build(ADDRESS, rtu.read_registers(10 * PARAMETER - 1, 2))
        wave, end = edges(self.line, data, self.start(rng), Badness(), rng)
        self.pins.play(NETWORK, wave)
        line, bursts, telegrams = self.pins.lines[DRIVE], self.pins.bursts[NETWORK], self.pins.bursts[DRIVE]
        bursts.clear()
        telegrams.clear()
        value = rng.choice((rng.randrange(1 << 32), 0x55555555, 0, 0xFFFFFFFF))
        limit = end + 0.1 * self.line.clk_hz
        while not telegrams and self.pins.now < limit:
            self.pins.run(limit)
        reply = spoilt(self.drive.telegram(telegrams[0].data), {"pwe": value})
        self.characters += len(reply)
        pause = (DRIVE_DELAY_BITS + rng.random()) * line.bit
        wave, end = edges(line, reply, telegrams[0].fall + pause, bad, rng)
        self.pins.play(DRIVE, wave)
        # A repeat is a failure, too.
        limit = max(self.pins.now, end) + 3 * self.line.bit + BUDGET_CLOCKS
        while self.pins.now < round(limit) or self.pins.sending(NETWORK):
            self.pins.run(max(limit, self.pins.now + self.line.bit))
            if bursts:
                break
        due = rtu.build(ADDRESS, bytes([rtu.READ_REGISTERS, 4]) + value.to_bytes(4, "big"))
        right = bool(bursts) and bursts[0].data == due and len(telegrams) == 1
        if not right:
            self.pins.run(self.pins.now + DRIVE_RECOVERY_S * self.line.clk_hz, 0)
        return right


@dataclass(frozen=True)
class Limit:
    """Result for one line and quantity; `beyond`: the line held up to the greatest value tried."""

    quantity: str
    line: str
    baud: int
    form: str
    clk_hz: int
    found: float
    characters: int  # minimum per point
    asked: int  # characters sent in all
    beyond: bool = False

    @property
    def faults(self) -> list[str]:
        """Violations of LINE-5 or theory."""
        quantity = QUANTITIES[self.quantity]
        where = f"{self.line} line, {self.baud} {self.form}, {self.clk_hz} Hz: {quantity.title}"
        first, last = quantity.span(self.form, self.clk_hz / self.baud)
        if self.found < quantity.promise - quantity.resolution:
            return [f"{where}: {self.found:.4f}, LINE-5 promises {quantity.promise}"]
        if not first <= self.found <= last:
            return [f"{where}: {self.found:.4f}, theory has {first:.4f} … {last:.4f}"]
        return []


def holds(prober: Prober, bad: Badness, characters: int, seed: str) -> bool:
    """Whether every request is answered until `characters` have been sent."""
    rng = random.Random(seed)
    until = prober.characters + characters
    while prober.characters < until:
        if not prober.answered(bad, rng):
            return False
    return True


def halve(passes: Callable[[float], bool], good: float, bad: float, resolution: float) -> float:
    """The last value that passes, between a passing and a failing value."""
    while bad - good > resolution:
        middle = (good + bad) / 2
        good, bad = (middle, bad) if passes(middle) else (good, middle)
    return good


def limit(prober: Prober, quantity: Quantity, characters: int, seed: int) -> Limit:
    line = prober.pins.lines[DRIVE] if prober.line_name == "drive" else prober.line
    before = prober.characters

    def passes(amount: float) -> bool:
        where = f"{seed}/{prober.line_name}/{line.baud}/{line.form}/{line.clk_hz}"
        point = f"{where}/{quantity.name}/{amount:.6f}"
        return holds(prober, Badness.of(quantity.name, amount), characters, point)

    first, last = quantity.theory(line.form)
    good, bad = SURE * first, TOO_BAD * last
    beyond = False
    # The promised value is always tested.
    if quantity.promise and passes(quantity.promise - quantity.resolution):
        good = max(good, quantity.promise - quantity.resolution)
    if not passes(good):
        found = halve(passes, 0.0, good, quantity.resolution)
    elif passes(bad):
        found, beyond = bad, True
    else:
        found = halve(passes, good, bad, quantity.resolution)
    return Limit(
        *(quantity.name, prober.line_name, line.baud, line.form, line.clk_hz, found),
        *(characters, prober.characters - before, beyond),
    )


def measured(
    line: LineFormat,
    *,
    of_drive: bool = False,
    characters: int,
    seed: int,
    target: Target = OWN,
    quantities: tuple[str, ...] = tuple(QUANTITIES),
) -> list[Limit]:
    """All limits of one line. `of_drive`: limits of the drive line; `line` is then the network line."""
    with (DriveProber if of_drive else Prober)(line, target) as prober:
        return [limit(prober, QUANTITIES[name], characters, seed) for name in quantities]
