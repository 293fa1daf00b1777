# SPDX-License-Identifier: Apache-2.0
"""What the bench measures: turnaround case by case, random requests, and the honesty of the gate.

Latencies are counted from what the wire allows and in bits of the line they are on:
  local      reply's first start bit after t3.5 of the request                    PERF-1, FRAME-8
  telegram   telegram's first start bit after t3.5, or after the pause if that is later     PERF-2
  answer     reply's first start bit after the last stop bit of the drive's reply           PERF-3
The floor of a transaction is its characters alone: request, t3.5, and for an exchange the telegram, the
drive's own delay, the drive's reply; then the reply. t3.5 is 38.5 bits, above 19200 bit/s 1750 us.
Functions here are top level and take and return plain data, so that processes can share the work.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field

from sim.bench.card import (
    CLK_HZ,
    DRIVE_LINE,
    MODBUS,
    POLITE_BITS,
    UNIT_ADDRESS,
    Bench,
    Line,
    Talk,
)
from tb.model import card as card_model
from tb.model import fc_telegram, rtu
from tb.model.crc16 import crc_good
from tb.model.vlt_drive import VltDrive
from tools.stack import symbols

# Limits (PERF-1 to PERF-3): bits of the line, and the ratio to the floor.
LIMIT_BITS = 1.0
LIMIT_RATIO = 1.01
# A telegram may start as much before t3.5 as t3.5 itself may be early (FRAME-1), in network bits.
T35_ACCURACY_BITS = 0.25
PAUSE_ACCURACY_BITS = 1 / 16

TEXT = "TWENTY CHARACTERS OK"
TEXT_PNU = 533
START_MOTOR = [bool(0x1999_047C >> i & 1) for i in range(32)]
FOREIGN = UNIT_ADDRESS + 1


def parameter(pnu: int) -> int:
    """On-wire register of a parameter (MAP-6)."""
    return 10 * pnu - 1


@dataclass(frozen=True)
class Case:
    name: str
    local: bool
    pdu: bytes
    before: bytes | None = None  # requests that set it up and put it right
    after: bytes | None = None


CASES = {
    case.name: case
    for case in (
        Case("read 16 coils", True, rtu.read_coils(32, 16)),
        Case("read 40001-40003", True, rtu.read_registers(0, 3)),
        Case("exception 67", True, bytes([0x2B])),
        Case("start motor", False, rtu.write_coils(0, START_MOTOR)),
        Case("write parameter", False, rtu.write_register(parameter(104), 60)),
        Case("read parameter", False, rtu.read_registers(parameter(514), 2)),
        Case(
            "read 20 characters",
            False,
            rtu.read_registers(parameter(TEXT_PNU), 10),
            before=rtu.write_register(0, 0x0400),
            after=rtu.write_register(0, 0),
        ),
    )
}


@dataclass
class Sample:
    """One transaction, measured. Latencies in bits, times in s, clocks of the firmware."""

    case: str
    baud: int
    form: str
    local: float | None = None
    telegram: float | None = None
    telegram_before_t35: float = 0.0  # network bits
    telegram_before_pause: float = 0.0  # drive bits
    answer: float | None = None
    after_t35: float | None = None  # any reply, network bits
    total: float | None = None
    floor_parts: dict[str, float] = field(default_factory=dict)  # the least each part takes
    decode_clocks: int | None = None  # candidate -> reply or telegram queued
    answer_clocks: int | None = None  # drive's last data byte -> reply queued
    de_lead: float | None = None  # network line, bits
    de_lag: float | None = None

    @property
    def floor(self) -> float:
        return sum(self.floor_parts.values())

    @property
    def ratio(self) -> float | None:
        return self.total / self.floor if self.total is not None else None

    def faults(self) -> list[str]:
        """Limits that this one misses."""
        found = []
        where = f"{self.case} at {self.baud} {self.form}"
        if self.local is not None and self.local > LIMIT_BITS:
            found.append(f"{where}: reply {self.local:.3f} bits after t3.5 (PERF-1)")
        if self.telegram is not None and self.telegram > LIMIT_BITS:
            found.append(f"{where}: telegram {self.telegram:.3f} drive bits after t3.5 (PERF-2)")
        if self.telegram_before_t35 > T35_ACCURACY_BITS:
            found.append(f"{where}: telegram {self.telegram_before_t35:.3f} bits before t3.5 (FRAME-1)")
        if self.telegram_before_pause > PAUSE_ACCURACY_BITS:
            found.append(
                f"{where}: telegram {self.telegram_before_pause:.3f} drive bits into the pause (FC-8)"
            )
        if self.answer is not None and self.answer > LIMIT_BITS:
            found.append(f"{where}: reply {self.answer:.3f} bits after the drive's (PERF-3)")
        # The drive's last stop bit is judged in its middle, so the reply may start inside it, never before.
        if self.answer is not None and self.answer < -self.baud / DRIVE_LINE.baud:
            found.append(f"{where}: reply {-self.answer:.3f} bits before the drive's was over (FC-8)")
        if self.after_t35 is not None and self.after_t35 < 0:
            found.append(f"{where}: reply {-self.after_t35:.3f} bits before t3.5 (FRAME-8)")
        if self.ratio is not None and self.ratio > LIMIT_RATIO:
            found.append(f"{where}: {self.ratio:.4f} x the floor")
        return found


@dataclass
class Outcome:
    """What one piece of work brings home."""

    samples: list[Sample] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    checks: int = 0
    stack_bytes: int = 0  # of the firmware's stack, seen used
    simulated_s: float = 0.0
    rows: dict[str, str] = field(default_factory=dict)

    def add(self, sample: Sample) -> None:
        self.samples.append(sample)
        self.faults += sample.faults()

    def check(self, right: bool, what: str) -> None:
        self.checks += 1
        if not right:
            self.faults.append(what)

    def finish(self, bench: Bench) -> Outcome:
        self.simulated_s += bench.seconds
        bench.close()
        return self


def floor_of(line: Line, talk: Talk, delay_bits: float) -> dict[str, float]:
    """The least that the characters of a transaction take, part by part."""
    character = line.character_bits / line.baud
    drive_bit = 1 / DRIVE_LINE.baud
    parts = {"request": len(talk.request) * character, "t3.5": line.t35_bits / line.baud}
    if talk.telegrams:
        drive_character = DRIVE_LINE.character_bits * drive_bit
        parts["telegram"] = len(talk.telegram) * drive_character
        parts["drive's delay"] = delay_bits * drive_bit
        parts["drive's reply"] = len(talk.drive_replies[0][2]) * drive_character
    parts["reply"] = len(talk.reply) * character
    return parts


def measure(bench: Bench, talk: Talk, case: str) -> Sample:
    line = bench.line
    sample = Sample(case, line.baud, line.name)
    committed = talk.request_end + line.t35
    if talk.telegrams:
        sample.telegram = (talk.telegram_start - max(committed, talk.pause_over)) / DRIVE_LINE.bit
        sample.telegram_before_t35 = (committed - talk.telegram_start) / line.bit
        sample.telegram_before_pause = (talk.pause_over - talk.telegram_start) / DRIVE_LINE.bit
        sample.decode_clocks = talk.clocks("candidate", "queue_telegram")
    if talk.answers:
        sample.after_t35 = (talk.reply_start - committed) / line.bit
        if talk.telegrams:
            sample.answer_clocks = talk.clocks("drive_candidate", "queue_reply")
        else:
            sample.local = (talk.reply_start - committed) / line.bit
            sample.decode_clocks = talk.clocks("candidate", "queue_reply")
        if len(talk.telegrams) == len(talk.drive_replies) == 1:
            sample.answer = (talk.reply_start - talk.drive_replies[0][1]) / line.bit
        if len(talk.telegrams) == len(talk.drive_replies):
            sample.total = (talk.reply_end - talk.request_start) / CLK_HZ
            sample.floor_parts = floor_of(line, talk, bench.drive_delay_bits)
        on, off = talk.de["modbus_de"][0]
        sample.de_lead = (talk.reply_start - on) / line.bit
        sample.de_lag = (off - talk.reply_end) / line.bit
    return sample


def example_drive() -> VltDrive:
    drive = VltDrive(example=True)
    drive.set_text(TEXT_PNU, TEXT)
    return drive


# ---------------------------------------------------------------- turnaround, case by case


def turnaround(baud: int, form: str, early: bool, repeats: int, names: tuple[str, ...], seed: int) -> Outcome:
    """Every case a few times; what the card says is checked as well as when."""
    rng = random.Random(f"{seed}/{baud}/{form}")
    bench = Bench(Line.of(baud, form), early=early, drive=example_drive())
    outcome = Outcome()

    def ask(pdu: bytes, name: str) -> Talk:
        talk = bench.ask(rtu.build(UNIT_ADDRESS, pdu), start=bench.next_start(POLITE_BITS + rng.random() * 3))
        sample = measure(bench, talk, name)
        outcome.add(sample)
        figures = (sample.telegram, sample.answer) if talk.telegrams else (sample.local,)
        outcome.check(None not in (*figures, sample.ratio), f"{name} at {baud} {form}: not measured")
        right = talk.reply is not None and crc_good(talk.reply) and all(c.good for c in talk.answers[0])
        wrong = right and talk.reply[1] != pdu[0] and name != "exception 67"
        outcome.check(
            right and not wrong, f"{name} at {baud} {form}: reply {talk.reply and talk.reply.hex(' ')}"
        )
        return talk

    for name in names:
        case = CASES[name]
        if case.before:
            ask(case.before, "write 40001")
        for _ in range(repeats):
            talk = ask(case.pdu, name)
            outcome.check(case.local == (not talk.telegrams), f"{name}: telegrams {len(talk.telegrams)}")
        if case.after:
            ask(case.after, "write 40001")
    if not early:
        # Nothing to meet there: it is what the card is compared with.
        outcome.faults = [fault for fault in outcome.faults if "PERF" not in fault and "floor" not in fault]
    return outcome.finish(bench)


# ---------------------------------------------------------------- random requests

IND = 0
KNOWN_PNUS = (1, 2, 102, 104, 205, 206, 207, 514, 515, 520, TEXT_PNU, 534, 621, 622, 623, 700, 2047)
PERMITTED = {
    IND: (0, 0, 1, 3, 0x0400, 0x0400, 0x0500, 0x0401, 0xFFFF),
    card_model.NETWORK_TIMEOUT: (0, 1, 100, 1000, 65535),
    card_model.DRIVE_TIMEOUT: (0, 15, 20, 100, 65535),
}
LONGEST_SLOW, LONGEST = 30, 253  # bytes of a PDU
SLOW_BAUD = 9600


@dataclass(frozen=True)
class Request:
    address: int
    pdu: bytes
    bad_crc: bool = False
    bad_parity: int | None = None
    bad_stop: int | None = None

    @property
    def damaged(self) -> bool:
        return self.bad_crc or self.bad_parity is not None or self.bad_stop is not None

    def adu(self) -> bytes:
        adu = bytearray(rtu.build(self.address, self.pdu))
        adu[-1] ^= 0x10 if self.bad_crc else 0
        return bytes(adu)


def _some_write(rng: random.Random) -> bytes:
    kind = rng.randrange(6)
    if kind == 0:
        start = rng.choice((0, 0, 3, 16, 31, 40, 64))
        count = 1 if start == 64 else rng.randint(1, 32)
        return rtu.write_coils(start, [rng.random() < 0.5 for _ in range(count)])
    if kind == 1:
        return bytes(
            [rtu.WRITE_COIL, 0, rng.choice((0, 6, 10, 31, 32, 64, 65)), rng.choice((0, 0, 0xFF, 1)), 0]
        )
    if kind == 2:
        register = rng.randrange(4)
        return rtu.write_register(register, rng.choice(PERMITTED.get(register, (1,))))
    if kind == 3:
        values = [rng.choice(PERMITTED[register]) for register in range(3)]
        first = rng.randrange(3)
        return rtu.write_registers(first, values[first : first + rng.randint(1, 3)])
    pnu = rng.choice(KNOWN_PNUS)
    if kind == 4:
        return rtu.write_register(parameter(pnu), rng.choice((0, 1, 50, 300, 65535)))
    count = rng.choice((1, 2, 2, 3, 10))
    return rtu.write_registers(parameter(pnu), [rng.choice((0, 60, 0x4142, 0x2020)) for _ in range(count)])


def _some_read(rng: random.Random) -> bytes:
    kind = rng.randrange(5)
    if kind <= 1:
        return rtu.read_coils(
            rng.choice((0, 1, 32, 33, 63, 64, 100, 127)), rng.choice((1, 7, 8, 16, 32, 64, 128))
        )
    if kind == 2:
        return rtu.read_registers(rng.randrange(5), rng.randint(0, 4))
    pnu = rng.choice(KNOWN_PNUS)
    return rtu.read_registers(parameter(pnu) + (rng.random() < 0.1), rng.choice((1, 2, 2, 3, 10, 10, 11)))


def _any_pdu(rng: random.Random, longest: int) -> bytes:
    """Anything at all: unknown functions, wrong lengths, byte counts that do not fit."""
    pdu = bytearray(rng.choice((_some_read, _some_write))(rng))
    kind = rng.randrange(4)
    if kind == 0:
        return bytes([rng.randrange(256)]) + rng.randbytes(
            rng.randint(1, min(longest, rng.choice((4, 12, 252))))
        )
    if kind == 1:
        return bytes(pdu) + rng.randbytes(rng.randint(1, 4))
    if kind == 2:
        return bytes(pdu[: rng.randint(2, len(pdu))])
    pdu[rng.randrange(1, len(pdu))] = rng.randrange(256)
    return bytes(pdu)


def _may_shorten_the_wait(pdu: bytes) -> bool:
    """True if it could set register 40003 so low that the drive answers too late: another test's work."""
    trial = card_model.Card()
    trial.request(pdu)
    return trial.registers[card_model.DRIVE_TIMEOUT] < 15


def some_request(rng: random.Random, line: Line) -> Request:
    longest = LONGEST if line.baud > SLOW_BAUD else LONGEST_SLOW
    while True:
        roll = rng.random()
        pdu = _some_read(rng) if roll < 0.45 else _some_write(rng) if roll < 0.8 else _any_pdu(rng, longest)
        if not _may_shorten_the_wait(pdu):
            break
    address = rng.choices((UNIT_ADDRESS, 0, FOREIGN), (88, 7, 5))[0]
    size = len(pdu) + 3
    harm = rng.random()
    if harm < 0.02:
        return Request(address, pdu, bad_crc=True)
    if harm < 0.04 and line.parity != "none":
        return Request(address, pdu, bad_parity=rng.randrange(size))
    if harm < 0.05:
        return Request(address, pdu, bad_stop=rng.randrange(size))
    return Request(address, pdu)


def random_requests(baud: int, form: str, count: int, seed: int) -> Outcome:
    """Legal and illegal requests against the model of the card: right bytes, right times, due silence."""
    rng = random.Random(f"random/{seed}/{baud}/{form}")
    line = Line.of(baud, form)
    bench = Bench(line, drive=example_drive())
    model = card_model.Card()
    outcome = Outcome()
    for number in range(count):
        request = some_request(rng, line)
        bench.drive_delay_bits = rng.choice((22, 22, 24, 30, 60, 190))
        start = bench.next_start(POLITE_BITS + rng.random() * rng.choice((1, 40)))
        adu = request.adu()
        talk = bench.ask(adu, start=start, bad_parity=request.bad_parity, bad_stop=request.bad_stop)
        sample = measure(bench, talk, "random")
        outcome.samples.append(sample)
        where = f"random request {number} at {baud} {form} (seed {seed}), {adu.hex(' ')}"
        for fault in sample.faults():
            outcome.faults.append(f"{where}: {fault}")
        expected = card_model.Step()
        if not request.damaged and request.address != FOREIGN:
            expected = model.request(request.pdu, broadcast=request.address == 0)
        asked = expected.telegram
        telegram = asked and fc_telegram.build(asked[1:], asked[0])
        outcome.check(
            talk.telegram == telegram, f"{where}: telegram {talk.telegram and talk.telegram.hex(' ')}"
        )
        if asked and talk.drive_replies:
            expected = model.drive_reply(talk.drive_replies[0][2][2:-1])
        elif asked:
            expected = card_model.Step()
        reply = expected.reply and rtu.build(UNIT_ADDRESS, expected.reply)
        outcome.check(talk.reply == reply, f"{where}: reply {talk.reply and talk.reply.hex(' ')}")
    outcome.stack_bytes = stack_used(bench)
    return outcome.finish(bench)


def stack_used(bench: Bench) -> int:
    """Bytes of the firmware's stack that are no longer as they were loaded, its high-water mark."""
    bottom, top = (symbols()[name] // 4 for name in ("_bss_end", "_stack_top"))
    words = bench.memory(range(bottom, top))
    return 4 * (len(words) - next((i for i, word in enumerate(words) if word), len(words)))


# ---------------------------------------------------------------- the gate


def _held_back(bench: Bench, outcome: Outcome, pdu: bytes, extra_bits: float) -> None:
    """A good frame, then one more character so many bits after it: nothing may come of it."""
    line = bench.line
    start = bench.next_start(POLITE_BITS)
    bench.forget()
    end = bench.send(MODBUS, rtu.build(UNIT_ADDRESS, pdu), start)
    last = bench.send(MODBUS, b"\x00", end + extra_bits * line.bit)
    talk = bench.follow(Talk(pdu, start, end), until=last + line.t35 + 3 * line.bit)
    where = f"{pdu.hex(' ')} at {line.baud} {line.name}, another character after {extra_bits:.1f} bits"
    outcome.check(not talk.answers and not talk.de["modbus_de"], f"{where}: answered")
    outcome.check(not talk.telegrams and not talk.de["drive_de"], f"{where}: sent a telegram")
    outcome.check(bool(talk.marks["candidate"]), f"{where}: was no candidate, so this shows nothing")
    outcome.check(not talk.marks["commit"], f"{where}: was committed")


def gate(baud: int, form: str, quick: bool) -> Outcome:
    """FRAME-6: a character between t1.5 and t3.5 takes everything back."""
    line = Line.of(baud, form)
    bench = Bench(line, drive=example_drive())
    outcome = Outcome()
    early, late = line.t15_bits + 0.5, line.t35_bits - 0.5
    start = rtu.write_coils(0, START_MOTOR)
    settings = rtu.write_registers(0, [0x0400, 7, 77])
    harmless = rtu.read_coils(0, 8)
    places = (
        [(start, late), (settings, early)]
        if quick
        else [
            (pdu, place) for pdu in (start, settings, harmless) for place in (early, (early + late) / 2, late)
        ]
    )
    if quick and baud < 1200:
        places = places[:1]
    for pdu, place in places:
        _held_back(bench, outcome, pdu, place)
    talk = bench.ask(rtu.build(UNIT_ADDRESS, rtu.read_coils(0, 32)))
    unchanged = rtu.build(UNIT_ADDRESS, bytes([1, 4, 0, 0, 0, 0]))
    outcome.check(talk.reply == unchanged, f"coils at {baud} {form}: {talk.reply and talk.reply.hex(' ')}")
    outcome.check(bench.drive.control_word == 0, f"the drive heard something at {baud} {form}")
    if not quick or baud >= 1200:
        talk = bench.ask(rtu.build(UNIT_ADDRESS, rtu.read_registers(0, 3)))
        unchanged = rtu.build(UNIT_ADDRESS, bytes.fromhex("0306 0000 03E8 000F"))
        outcome.check(
            talk.reply == unchanged, f"registers at {baud} {form}: {talk.reply and talk.reply.hex(' ')}"
        )
    return outcome.finish(bench)


def overtaken(baud: int, form: str, quick: bool) -> Outcome:
    """FRAME-7: another frame while the drive is still answering. The old reply is dropped, the exchange is
    finished, the newest request is served."""
    line = Line.of(baud, form)
    outcome = Outcome()
    newer = {
        "a foreign frame": rtu.build(FOREIGN, rtu.read_coils(0, 8)),
        "a local request": rtu.build(UNIT_ADDRESS, rtu.read_registers(0, 3)),
        "a request for the drive": rtu.build(UNIT_ADDRESS, rtu.read_registers(parameter(514), 2)),
    }
    for what, frame in newer.items():
        bench = Bench(line, drive=example_drive())
        first = bench.ask_and_leave(rtu.build(UNIT_ADDRESS, rtu.write_coils(0, START_MOTOR)))
        where = f"{what} at {baud} {form}"
        outcome.check(len(first.drive_replies) == 1, f"{where}: no exchange under way")
        # In the middle of the drive's reply.
        start = sum(first.drive_replies[0][:2]) / 2
        end = bench.send(MODBUS, frame, start)
        talk = bench.follow(Talk(frame, start, end))
        replies = [bytes(c.value for c in answer) for answer in talk.answers]
        committed = end + line.t35
        if what == "a foreign frame":
            outcome.check(not replies, f"{where}: the old reply came into it")
        else:
            outcome.check(len(replies) == 1 and replies[0][1] == 3, f"{where}: replies {replies}")
            outcome.check(
                bool(replies) and talk.reply_start >= committed, f"{where}: reply before its request was over"
            )
        if replies and what == "a local request":
            late = (talk.reply_start - committed) / line.bit
            outcome.check(late <= LIMIT_BITS, f"{where}: reply {late:.2f} bits after t3.5")
        outcome.check(bench.drive.control_word == 0x047C, f"{where}: the exchange was not carried out")
        if not quick or baud >= 9600:
            # The exchange was finished: its status and frequency words are in the image (FC-6).
            talk = bench.ask(rtu.build(UNIT_ADDRESS, rtu.read_coils(32, 32)))
            status = rtu.build(UNIT_ADDRESS, bytes.fromhex("0104 030F 0020"))
            outcome.check(talk.reply == status, f"{where}: image {talk.reply and talk.reply.hex(' ')}")
        outcome.finish(bench)
    return outcome
