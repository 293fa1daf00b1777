# SPDX-License-Identifier: Apache-2.0
"""Measured values of one transaction, and their limits.

Latencies start at the earliest moment that the wire allows, in bits of the line they are on:
  local      reply's first start bit after t3.5 of the request                    PERF-1, FRAME-8
  telegram   telegram's first start bit after t3.5, or after the pause if that is later     PERF-2
  answer     reply's first start bit after the last stop bit of the drive's reply           PERF-3
and in ms, from the end of the wait of register 40003 or of the pause, if that is later:
  repeat     repeated telegram                                                     FC-9
  gave_up    exception 255                                                         FC-9
The floor of a transaction is the time of its characters: request, t3.5, and for an exchange the telegram, the
drive's delay and reply; then the reply. t3.5 is 38.5 bits, above 19200 bit/s 1750 us.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from campaigns.bench.card import MARGIN_BITS, SHORTEST_DELAY_BITS, UNIT_ADDRESS, Bench, Talk
from campaigns.bench.wave import BAUD_ERROR, CLK_HZ, GRAIN, t35
from regs.generated.card_tables import DRIVE_BAUD
from tb.agents import rtu
from tb.model.lines import image_of
from tb.model.told import not_told
from tb.model.wire import LineFormat

# Limits (PERF-1 to PERF-3): bits of the line, and the ratio to the floor.
LIMIT_BITS = 1.0
LIMIT_RATIO = 1.01
DE_LIMIT_BITS = 1.0  # LINE-6, FC-10
# A telegram may start before t3.5 by the permitted error of t3.5 (FRAME-1), in network bits.
T35_ACCURACY_BITS = 0.25
# Accuracy of the silence timer: a tick. A telegram may not leave earlier, because FRAME-1 does not cover it.
TELEGRAM_EARLY_BITS = 1 / 16
SENDER_ERROR = 0.04  # LINE-5
PAUSE_ACCURACY_BITS = 1 / 16
# The firmware counts the wait in ticks of 1/1200 s: it ends one to two ticks and a round of the loop late.
WAIT_LIMIT_MS = 3.0


@dataclass
class Sample:
    """One measured transaction. Latencies in bits, times in s or as named, clocks of the firmware."""

    case: str
    baud: int
    form: str
    local: float | None = None
    telegram: float | None = None
    answer: float | None = None
    repeats: list[float] = field(default_factory=list)  # ms
    gave_up: float | None = None  # ms
    telegrams: int = 0
    replies: int = 0
    after_t35: list[float] = field(default_factory=list)  # every reply, network bits
    telegram_before_t35: float = 0.0  # network bits
    telegram_before_pause: float = 0.0  # drive bits, the greatest of all
    de_before_t35: float = 0.0  # network bits
    drift_bits: float = 0.0  # delay of the last character of a sender off its rate; < 0: early
    de_before_pause: float = 0.0  # drive bits
    de_lead: dict[str, list[float]] = field(default_factory=dict)  # by line, in its bits
    de_lag: dict[str, list[float]] = field(default_factory=dict)
    form_faults: list[str] = field(default_factory=list)
    total: float | None = None
    floor_parts: dict[str, float] = field(default_factory=dict)  # minimum time of each part
    decode_clocks: int | None = None  # candidate -> reply or telegram queued
    answer_clocks: int | None = None  # drive's last data byte -> reply queued

    @property
    def floor(self) -> float:
        return sum(self.floor_parts.values())

    @property
    def ratio(self) -> float | None:
        return self.total / self.floor if self.total is not None else None

    def faults(self) -> list[str]:
        """Violated limits."""
        found = list(self.form_faults)
        if self.replies > 1:
            found.append(f"{self.replies} replies")
        if self.telegrams > 2:
            found.append(f"{self.telegrams} telegrams (FC-9)")
        # The card counts by its own rate: an early last stop bit of the sender is added.
        if self.local is not None and self.local > LIMIT_BITS + max(0.0, -self.drift_bits):
            found.append(f"reply {self.local:.3f} bits after t3.5 (PERF-1)")
        if self.telegram is not None and self.telegram > LIMIT_BITS:
            found.append(f"telegram {self.telegram:.3f} drive bits after t3.5 (PERF-2)")
        if self.telegram_before_t35 > TELEGRAM_EARLY_BITS + de_grain(self.baud):
            found.append(f"telegram {self.telegram_before_t35:.3f} bits before t3.5 (FRAME-1)")
        if self.telegram_before_pause > PAUSE_ACCURACY_BITS:
            found.append(f"telegram {self.telegram_before_pause:.3f} drive bits into the pause (FC-8)")
        if self.answer is not None and self.answer > LIMIT_BITS:
            found.append(f"reply {self.answer:.3f} bits after the drive's (PERF-3)")
        # The drive's last stop bit is sampled in its middle, so the reply may start inside it, never before.
        if self.answer is not None and self.answer < -self.baud / DRIVE_BAUD:
            found.append(f"reply {-self.answer:.3f} bits before the drive's was over (FC-8)")
        for late, what in [(late, "repeat") for late in self.repeats] + [(self.gave_up, "reply")]:
            if late is not None and not 0 <= late <= WAIT_LIMIT_MS:
                found.append(f"{what} {late:.3f} ms after the wait (FC-9)")
        for after in self.after_t35:
            if after < 0:
                found.append(f"reply {-after:.3f} bits before t3.5 (FRAME-8)")
        # A late sender allows an early DE; the reply itself may not be early.
        if self.de_before_t35 > T35_ACCURACY_BITS + max(0.0, self.drift_bits):
            found.append(f"DE {self.de_before_t35:.3f} bits before t3.5 (SAFE-2)")
        if self.de_before_pause > PAUSE_ACCURACY_BITS:
            found.append(f"drive DE {self.de_before_pause:.3f} drive bits into the pause (SAFE-2)")
        for name, baud in (("modbus", self.baud), ("drive", DRIVE_BAUD)):
            # The last stop bit has no edge at its end: rate and clock grain determine it.
            early = -de_grain(baud)
            for lead in self.de_lead.get(name, []):
                if not 0 <= lead <= DE_LIMIT_BITS:
                    found.append(f"{name} DE rises {lead:.3f} bits before the first bit (LINE-6)")
            for lag in self.de_lag.get(name, []):
                if not early <= lag <= DE_LIMIT_BITS:
                    found.append(f"{name} DE falls {lag:.3f} bits after the last bit (LINE-6)")
        if self.ratio is not None and self.ratio > LIMIT_RATIO:
            found.append(f"{self.ratio:.4f} x the floor")
        return found


def de_grain(baud: int) -> float:
    """Uncertainty of the end of a character, in bits."""
    line = LineFormat(baud, "8E1", CLK_HZ)
    return GRAIN / line.bit + BAUD_ERROR * line.character_bits


@dataclass
class Outcome:
    """Result of one piece of work."""

    samples: list[Sample] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    checks: int = 0
    stack_bytes: int = 0  # used part of the firmware's stack
    simulated_s: float = 0.0
    rows: dict[str, str] = field(default_factory=dict)

    def row(self) -> dict[str, Any]:
        """For the store (campaigns/engine.py)."""
        return {**vars(self), "samples": [asdict(sample) for sample in self.samples]}

    @classmethod
    def of(cls, row: dict[str, Any]) -> Outcome:
        return cls(**row | {"samples": [Sample(**each) for each in row["samples"]]})

    def add(self, sample: Sample, where: str) -> None:
        self.samples.append(sample)
        self.checks += 1
        self.faults += [f"{where}: {fault}" for fault in sample.faults()]

    def check(self, right: bool, what: str) -> None:
        self.checks += 1
        if not right:
            self.faults.append(what)

    def compare(self, talk: Talk, telegrams: list[bytes], reply: bytes | None, where: str) -> None:
        """Requires the exact bytes on both lines and no others; an idle line must not be driven."""
        replies = [] if reply is None else [reply]
        for what, got, due, name in (
            ("telegrams", talk.sent, telegrams, "drive_de"),
            ("replies", talk.replies, replies, "modbus_de"),
        ):
            heard = ", ".join(data.hex(" ") for data in got) or "none"
            self.check(got == due, f"{where}: {what} {heard}")
            driven = len(talk.de[name])
            self.check(driven == len(due), f"{where}: {name} rises {driven} times instead of {len(due)}")

    def finish(self, bench: Bench) -> Outcome:
        """Checks at the end that the card sends nothing more, and what the image shows (SAFE-8)."""
        bench.idle_until(bench.next_start() + t35(bench.line) + MARGIN_BITS * bench.line.bit)
        self.check(not bench.unasked, "; ".join(bench.unasked))
        shown = bench.ask(rtu.build(UNIT_ADDRESS, rtu.read_coils(0, 32))).reply if bench.told else None
        wrong = not_told(bench.told, image_of(shown)) if shown else ""
        self.check(not wrong, wrong)
        self.simulated_s += bench.seconds
        bench.close()
        return self


def floor_of(bench: Bench, talk: Talk) -> dict[str, float]:
    """Minimum time of the characters of a transaction, part by part; the pauses of master and drive are
    included as they were."""
    line, drive_line = bench.line, bench.drive_line
    character = line.character_bits / line.baud
    parts = {
        "request": (talk.request_end - talk.request_start) / bench.clk_hz,
        "t3.5": line.t35_bits / line.baud,
    }
    for exchange in talk.exchanges:
        parts["telegram"] = len(exchange.telegram) * drive_line.character_bits / drive_line.baud
        parts["drive's delay"] = (exchange.start - exchange.telegram_end) / bench.clk_hz
        parts["drive's reply"] = (exchange.end - exchange.start) / bench.clk_hz
    parts["reply"] = len(talk.reply) * character
    return parts


def measure(bench: Bench, talk: Talk, case: str, error: float = 0.0) -> Sample:
    """error: error of the sender's rate, -0.04 is 4 % too slow."""
    line, drive_line = bench.line, bench.drive_line
    sample = Sample(case, line.baud, line.form, form_faults=list(talk.form))
    sample.drift_bits = line.character_bits * (1 / (1 + error) - 1)
    sample.telegrams, sample.replies = len(talk.telegrams), len(talk.answers)
    # A sender slower than LINE-5 allows is not the card's fault.
    slowest = line.character_bits * (1 / (1 - SENDER_ERROR) - 1)
    committed = talk.request_end + t35(line) - max(0.0, sample.drift_bits - slowest) * line.bit
    pause = SHORTEST_DELAY_BITS * drive_line.bit
    milliseconds = 1000 / bench.clk_hz

    if sample.telegrams != len(talk.exchanges):
        sample.form_faults.append(
            f"{sample.telegrams} telegrams, the drive was asked {len(talk.exchanges)} times"
        )
    due, quiet_since = committed, talk.quiet_since
    for number, (telegram, exchange) in enumerate(zip(talk.telegrams, talk.exchanges, strict=False)):
        start, end = telegram[0].start, telegram[-1].end
        on = next(on for on, off in talk.de["drive_de"] if on <= start <= off)
        pause_over = quiet_since + pause
        if number == 0:
            sample.telegram = (start - max(due, pause_over)) / drive_line.bit
            sample.telegram_before_t35 = (committed - start) / line.bit
        else:
            sample.repeats.append((start - max(due, pause_over)) * milliseconds)
        sample.telegram_before_pause = max(
            sample.telegram_before_pause, (pause_over - start) / drive_line.bit
        )
        sample.de_before_pause = max(sample.de_before_pause, (pause_over - on) / drive_line.bit)
        due, quiet_since = end + talk.wait, max(end, exchange.end)

    last = talk.exchanges[-1] if talk.exchanges else None
    sample.after_t35 = [(answer[0].start - committed) / line.bit for answer in talk.answers]
    sample.de_before_t35 = max(((committed - on) / line.bit for on, _ in talk.de["modbus_de"]), default=0.0)
    if talk.answers and last is None:
        sample.local = sample.after_t35[0]
    elif talk.answers and last.answered:
        sample.answer = (talk.reply_start - last.end) / line.bit
        sample.answer_clocks = talk.clocks("drive_candidate", "order_reply") if not sample.repeats else None
    elif talk.answers:
        sample.gave_up = (talk.reply_start - due) * milliseconds
    # A telegram that was never sent was revoked, so its queueing has no limit.
    if last is not None or talk.answers:
        sample.decode_clocks = talk.clocks("candidate", "order_reply" if last is None else "order_telegram")
    held_up = last is not None and talk.quiet_since + pause > committed
    if talk.answers and not sample.repeats and not held_up and (last is None or last.answered):
        sample.total = (talk.reply_end - talk.request_start) / bench.clk_hz
        sample.floor_parts = floor_of(bench, talk)

    for name, bursts, of in (("modbus", talk.answers, line), ("drive", talk.telegrams, drive_line)):
        for burst in bursts:
            on, off = next(span for span in talk.de[f"{name}_de"] if span[0] <= burst[0].start <= span[1])
            sample.de_lead.setdefault(name, []).append((burst[0].start - on) / of.bit)
            sample.de_lag.setdefault(name, []).append((off - burst[-1].end) / of.bit)
    return sample
