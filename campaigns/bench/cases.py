# SPDX-License-Identifier: Apache-2.0
"""Measurements of the bench: turnaround case by case, random requests, faults of the drive, and the gate.

Limits: campaigns/bench/judge.py.

Functions here are top level and take and return plain data, so that processes can share the work.
"""

from __future__ import annotations

import random
from dataclasses import dataclass

from campaigns.bench.card import (
    BROADCAST_ADDRESS,
    CORRECT,
    EXTRA_SILENCE_BITS,
    MODBUS,
    STANDARD,
    UNIT_ADDRESS,
    Bench,
    Build,
    DriveAnswer,
    Talk,
)
from campaigns.bench.judge import Outcome, measure
from campaigns.bench.traffic import (
    FOREIGN,
    REFUSALS,
    REFUSED,
    TAKEN,
    TEXT_PNU,
    UNFIT,
    Request,
    example_drive,
    parameter,
    refusal,
    some_answers,
    some_requests,
)
from campaigns.bench.wave import t35
from sw.tools.stack import symbols
from tb.agents import rtu
from tb.model import card as card_model
from tb.model import fc_telegram
from tb.model.wire import LineFormat

# End of the power-up sequence of the LEDs (LED-1), with the time that the card needs before it.
SHOW_OVER_S = 2.1
TEXTS, LETTERS = range(1, 11), [0x4142 + 0x0202 * n for n in range(10)]
START_MOTOR = [bool(0x1999_047C >> i & 1) for i in range(32)]
NOISE_BITS = 6.5  # after t3.5 of a noise character: 45 bits up to 19200 bit/s


@dataclass(frozen=True)
class Case:
    name: str
    local: bool  # answered without the drive
    pdu: bytes
    before: bytes | None = None  # request that sets the case up
    after: bytes | None = None
    to_all: bool = False


def text(name: str, pdu: bytes, ind: int) -> Case:
    """An exchange with the index of texts in 40001."""
    return Case(name, False, pdu, before=rtu.write_register(0, ind), after=rtu.write_register(0, 0))


# Every kind of request that the firmware translates. The values of 40002 and 40003 are the defaults.
LOCAL_WORDS = (0, 1000, 15)
CASES = {
    case.name: case
    for case in (
        Case("read 16 coils", True, rtu.read_coils(32, 16)),
        Case("read 40001-40003", True, rtu.read_registers(0, 3)),
        Case("write 40002", True, rtu.write_register(1, LOCAL_WORDS[1])),
        Case("write 40001-40003", True, rtu.write_registers(0, LOCAL_WORDS)),
        Case("write coil 65", True, rtu.write_coil(card_model.EEPROM, False)),
        Case("exception 67", True, bytes([0x2B])),
        Case("start motor", False, rtu.write_coils(0, START_MOTOR)),
        Case("write coil 7", False, rtu.write_coil(6, True)),
        Case("write parameter", False, rtu.write_register(parameter(104), 60)),
        Case("write 2 words", False, rtu.write_registers(parameter(207), (0, 60))),
        Case("read parameter", False, rtu.read_registers(parameter(514), 2)),
        Case("read 1 word", False, rtu.read_registers(parameter(514), 1)),
        text("read 20 characters", rtu.read_registers(parameter(TEXT_PNU), 10), 0x0400),
        text("write 20 characters", rtu.write_registers(parameter(TEXT_PNU), LETTERS), 0x0500),
        Case("start motor, broadcast", False, rtu.write_coils(0, START_MOTOR), to_all=True),
        Case("write coil 7, broadcast", False, rtu.write_coil(6, True), to_all=True),
        Case("write 2 words, broadcast", False, rtu.write_registers(parameter(207), (0, 60)), to_all=True),
    )
}
# Those that take the firmware longest: a request, a drive's reply, a broadcast.
SLOWEST = ("write 20 characters", "read 20 characters", "write 2 words, broadcast")

# Every size of these requests.
SIZES = {
    case.name: case
    for case in (
        *(Case(f"read {n} coils", True, rtu.read_coils(128 - n, n)) for n in range(1, 129)),
        *(Case(f"write {n} coils", False, rtu.write_coils(32 - n, START_MOTOR[-n:])) for n in range(1, 33)),
        *(Case(f"read {n} of 40001-40003", True, rtu.read_registers(0, n)) for n in (1, 2, 3)),
        *(
            Case(f"write {n} of 40001-40003", True, rtu.write_registers(0, LOCAL_WORDS[:n]))
            for n in (1, 2, 3)
        ),
        Case("write 1 word", False, rtu.write_registers(parameter(207), (60,))),
        *(text(f"read {2 * n} letters", rtu.read_registers(parameter(TEXT_PNU), n), 0x0400) for n in TEXTS),
        *(
            text(f"write {2 * n} letters", rtu.write_registers(parameter(TEXT_PNU), LETTERS[:n]), 0x0500)
            for n in TEXTS
        ),
    )
}
# The smallest and the largest of each, as far as CASES has none of them.
EXTREMES = (
    *("read 1 coils", "read 128 coils", "write 1 coils", "write 32 coils", "write 1 word"),
    *("read 1 of 40001-40003", "write 1 of 40001-40003", "read 2 letters", "write 2 letters"),
)


# ---------------------------------------------------------------- one request, byte for byte


@dataclass
class Due:
    """Required result of a request: the telegrams in turn and the reply."""

    telegrams: list[bytes]
    reply: bytes | None


class Model:
    """Runs the model of the card beside the bench: required results, from the drive's real replies."""

    def __init__(self) -> None:
        self.card = card_model.CardModel()

    @property
    def wait_s(self) -> float:
        return self.card.registers[card_model.DRIVE_TIMEOUT] / 100

    def ask(self, pdu: bytes, broadcast: bool = False) -> card_model.Step:
        return self.card.request(pdu, broadcast)

    def due(self, step: card_model.Step, talk: Talk) -> Due:
        """Repeats the telegram once after each invalid answer or silence, two telegrams in all (FC-9)."""
        if step.telegram is None:
            return Due([], self._reply(step))
        telegram = fc_telegram.build(step.telegram[1:], step.telegram[0])
        if fc_telegram.is_broadcast(step.telegram[0]):
            return Due([telegram], None)
        for number, exchange in enumerate(talk.exchanges[:2], 1):
            if exchange.answered:
                return Due(number * [telegram], self._reply(self.card.drive_reply(exchange.reply[2:-1])))
        return Due(2 * [telegram], self._reply(self.card.drive_silent()))

    @staticmethod
    def _reply(step: card_model.Step) -> bytes | None:
        return step.reply and rtu.build(UNIT_ADDRESS, step.reply)


# ---------------------------------------------------------------- turnaround, case by case


def turnaround(
    baud: int,
    form: str,
    repeats: int,
    names: tuple[str, ...],
    seed: int,
    settled: bool = False,
    build: Build = STANDARD,
) -> Outcome:
    """Runs every case a few times; checks the card's bytes and their times.

    settled: the power-up sequence of the LEDs is over.
    """
    rng = random.Random(f"{seed}/{baud}/{form}")
    bench = Bench(LineFormat(baud, form, build.clk_hz), build=build, drive=example_drive())
    if settled:
        bench.idle_until(SHOW_OVER_S * bench.clk_hz)
    model = Model()
    outcome = Outcome()

    def ask(case: Case) -> None:
        step = model.ask(case.pdu, case.to_all)
        start = bench.next_start(EXTRA_SILENCE_BITS + rng.random() * 3)
        address = BROADCAST_ADDRESS if case.to_all else UNIT_ADDRESS
        talk = bench.ask(rtu.build(address, case.pdu), start=start)
        sample = measure(bench, talk, case.name)
        where = f"{case.name} at {baud} {form}"
        outcome.add(sample, where)
        due = model.due(step, talk)
        outcome.compare(talk, due.telegrams, due.reply, where)
        outcome.check(len(due.telegrams) == (not case.local), f"{where}: {len(due.telegrams)} telegrams due")
        figures = [sample.local] if case.local else [sample.telegram]
        if not case.to_all:
            figures += [sample.ratio] if case.local else [sample.answer, sample.ratio]
        outcome.check(None not in figures, f"{where}: not measured")

    for name in names:
        case = (CASES | SIZES)[name]
        if case.before:
            ask(Case("write 40001", True, case.before))
        for _ in range(repeats):
            ask(case)
        if case.after:
            ask(Case("write 40001", True, case.after))
    return outcome.finish(bench)


# ---------------------------------------------------------------- random requests


def _say(bench: Bench, request: Request, start: float) -> Talk:
    """Plays a request with its disturbances; `start` is the earliest time."""
    line = bench.line
    if request.noise is not None:
        bench.idle_until(start)
        noise_over = bench.send(MODBUS, bytes([request.noise]), start)
        start = noise_over + t35(line) + NOISE_BITS * line.bit
    if request.glitch is not None:
        bench.idle_until(start)
        bench.play(MODBUS, [(start, 0), (start + 0.2 * line.bit, 1)])
        start += (0.2 + request.glitch) * line.bit
    adu = request.adu()
    bench.idle_until(start)
    gaps = dict([request.gap]) if request.gap else None
    end = bench.send(MODBUS, adu, start, gaps=gaps, bad_parity=request.bad_parity, bad_stop=request.bad_stop)
    until = 0.0
    if request.then:
        character, bits = request.then
        until = bench.send(MODBUS, bytes([character]), end + bits * line.bit) + t35(line) + 3 * line.bit
    return bench.follow(Talk(adu, start, end), until=until)


def random_requests(
    baud: int,
    form: str,
    count: int,
    seed: int,
    settled: bool = False,
    build: Build = STANDARD,
) -> Outcome:
    """Compares legal and illegal requests with the model: right bytes, right times, due silence."""
    rng = random.Random(f"random/{seed}/{baud}/{form}")
    line = LineFormat(baud, form, build.clk_hz)
    bench = Bench(line, build=build, drive=example_drive())
    if settled:
        bench.idle_until(SHOW_OVER_S * bench.clk_hz)
    model = Model()
    outcome = Outcome()
    for number, request in enumerate(some_requests(rng, line, count)):
        bench.drive_delay_bits = rng.choice((22, 22, 24, 30, 60, 190))
        bench.drive_wait_s = model.wait_s
        step = card_model.Step()
        if not request.harm and request.address in (UNIT_ADDRESS, BROADCAST_ADDRESS):
            step = model.ask(request.pdu, broadcast=request.address == 0)
        bench.drive_answers = []
        # The wait for a failing drive must not take minutes.
        if step.telegram and model.wait_s <= 0.2 and rng.random() < 0.25:
            bench.drive_answers = some_answers(rng, process=len(step.telegram) == 5)
        talk = _say(bench, request, bench.next_start(EXTRA_SILENCE_BITS + rng.random() * rng.choice((1, 40))))
        where = f"random request {number} at {baud} {form} (seed {seed}), {talk.request.hex(' ')}"
        outcome.add(measure(bench, talk, "random"), where)
        due = model.due(step, talk)
        outcome.compare(talk, due.telegrams, due.reply, where)
    outcome.stack_bytes = stack_used(bench, build)
    return outcome.finish(bench)


def stack_used(bench: Bench, build: Build) -> int:
    """Bytes of the firmware's stack that differ from the loaded image: its high-water mark."""
    found = symbols(build.image_folder / "firmware.elf")
    bottom, top = (found[name] // 4 for name in ("_bss_end", "_stack_top"))
    words = bench.memory(range(bottom, top))
    return 4 * (len(words) - next((i for i, word in enumerate(words) if word), len(words)))


# ---------------------------------------------------------------- faults of the drive, one by one

ASKED = {"process": rtu.write_coils(0, START_MOTOR), "parameter": rtu.read_registers(parameter(514), 2)}
SHORT_WAIT = 4  # register 40003: just enough for the exchanges here


def drive_faults(baud: int, form: str, quick: bool, build: Build = STANDARD) -> Outcome:
    """FC-8, FC-9: each invalid answer gets one repeat; each slow answer within the rules is accepted.

    The second failure gives 255, and the drive's own fault numbers are passed on."""
    bench = Bench(LineFormat(baud, form, build.clk_hz), build=build, drive=example_drive())
    model = Model()
    outcome = Outcome()

    def ask(pdu: bytes, how: list[DriveAnswer], what: str) -> None:
        bench.drive_wait_s = model.wait_s
        bench.drive_answers = list(how)
        step = model.ask(pdu)
        talk = bench.ask(rtu.build(UNIT_ADDRESS, pdu))
        due = model.due(step, talk)
        where = f"{what}: {', '.join(m.name for m in how)} at {baud} {form}"
        outcome.add(measure(bench, talk, "drive_faults"), where)
        outcome.compare(talk, due.telegrams, due.reply, where)
        outcome.check(not bench.drive_answers, f"{where}: nothing came of it")

    ask(rtu.write_register(card_model.DRIVE_TIMEOUT, SHORT_WAIT), [], "wait")
    for what, pdu in ASKED.items():
        for one in TAKEN:
            ask(pdu, [one], what)
        unfit = (UNFIT,) if what == "parameter" else ()
        for one in (*REFUSED, *unfit):
            if not quick or (one.name in ("no answer", "too late", "wrong BCC")) or what == "parameter":
                ask(pdu, [one, CORRECT], what)
        for one, two in ((REFUSED[0], REFUSED[2]), (REFUSED[2], TAKEN[2]), (REFUSED[1], REFUSED[0])):
            if not quick or what == "process":
                ask(pdu, [one, two], what)
    for fault in REFUSALS[: 3 if quick else None]:
        ask(ASKED["parameter"], [refusal(fault)], "parameter")
    # Afterwards the card serves the next request as usual.
    ask(rtu.read_coils(32, 32), [], "the image")
    return outcome.finish(bench)


# ---------------------------------------------------------------- the commit gate


def _held_back(bench: Bench, outcome: Outcome, pdu: bytes, extra_bits: float) -> None:
    """A good frame, followed by one more character after so many bits: the card must not react."""
    line = bench.line
    request = Request(UNIT_ADDRESS, pdu, "another character", then=(0, extra_bits))
    talk = _say(bench, request, bench.next_start(EXTRA_SILENCE_BITS))
    where = f"{pdu.hex(' ')} at {line.baud} {line.form}, another character after {extra_bits:.1f} bits"
    outcome.add(measure(bench, talk, "gate"), where)
    outcome.compare(talk, [], None, where)
    outcome.check(bool(talk.marks["candidate"]), f"{where}: was no candidate, so this shows nothing")
    outcome.check(not talk.marks["commit"], f"{where}: was committed")


def gate(baud: int, form: str, quick: bool, build: Build = STANDARD) -> Outcome:
    """FRAME-6: a character between t1.5 and t3.5 revokes the frame."""
    line = LineFormat(baud, form, build.clk_hz)
    bench = Bench(line, build=build, drive=example_drive())
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
    unchanged = {"coils": rtu.read_coils(0, 32)}
    if not quick or baud >= 1200:
        unchanged["registers"] = rtu.read_registers(0, 3)
    for what, pdu in unchanged.items():
        talk = bench.ask(rtu.build(UNIT_ADDRESS, pdu))
        outcome.add(measure(bench, talk, "gate"), f"{what} at {baud} {form}")
        reply = rtu.build(UNIT_ADDRESS, card_model.CardModel().request(pdu).reply)
        outcome.compare(talk, [], reply, f"{what} at {baud} {form}")
    outcome.check(bench.drive.control_word == 0, f"the drive heard something at {baud} {form}")
    return outcome.finish(bench)


def overtaken(baud: int, form: str, quick: bool, build: Build = STANDARD) -> Outcome:
    """FRAME-7: another frame while the drive is still answering. The old reply is dropped, the exchange is
    completed, the newest request is served without delay."""
    line = LineFormat(baud, form, build.clk_hz)
    outcome = Outcome()
    newer = {
        "a foreign frame": (FOREIGN, rtu.read_coils(0, 8)),
        "a local request": (UNIT_ADDRESS, rtu.read_registers(0, 3)),
        "a request for the drive": (UNIT_ADDRESS, rtu.read_registers(parameter(514), 2)),
    }
    if quick and baud < 2400:
        newer = {"a foreign frame": newer["a foreign frame"]}
    for what, (address, pdu) in newer.items():
        bench = Bench(line, build=build, drive=example_drive())
        model = Model()
        start_motor = model.ask(rtu.write_coils(0, START_MOTOR))
        first = bench.ask_and_leave(rtu.build(UNIT_ADDRESS, rtu.write_coils(0, START_MOTOR)))
        where = f"{what} at {baud} {form}"
        due = model.due(start_motor, first)
        # Its telegram has been sent and its reply is dropped.
        outcome.compare(first, due.telegrams, None, where)
        outcome.check(first.exchanges[0].answered, f"{where}: no exchange under way")
        # In the middle of the drive's reply.
        start = (first.exchanges[0].start + first.exchanges[0].end) / 2
        frame = rtu.build(address, pdu)
        talk = Talk(frame, start, bench.send(MODBUS, frame, start))
        # An old reply would follow the drive's at once.
        bench.follow(talk, until=first.exchanges[0].end + 3 * line.bit)
        outcome.add(measure(bench, talk, what), where)
        due = model.due(model.ask(pdu) if address == UNIT_ADDRESS else card_model.Step(), talk)
        outcome.compare(talk, due.telegrams, due.reply, where)
        outcome.check(bench.drive.control_word == 0x047C, f"{where}: the exchange was not carried out")
        if not quick or baud >= 9600:
            # The exchange was completed: its status and frequency words are in the image (FC-6).
            pdu = rtu.read_coils(32, 32)
            talk = bench.ask(rtu.build(UNIT_ADDRESS, pdu))
            outcome.add(measure(bench, talk, what), where)
            due = model.due(model.ask(pdu), talk)
            outcome.compare(talk, due.telegrams, due.reply, f"{where}: image")
        outcome.finish(bench)
    return outcome
