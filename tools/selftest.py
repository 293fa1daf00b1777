# SPDX-License-Identifier: Apache-2.0
"""Checks a real card over a serial adapter: a row for each promise of the documents, with a tick or a cross.

    python -m tools.selftest PORT [--unit 1] [--baud 9600] [--format 8N2] [--dialect card] [--drive yes]

No row starts or stops a motor, unless --start PERCENT asks for it. The table of rows is
tools/selftest_rows.py; here are those that measure, wait or need more than one address. At the end
registers 40002 and 40003 get their former values; the index and coil 65 become 0. With --drive yes coils 1-32
become 0; after --start the ramp stop remains in them. Times are in seconds, of the computer's clock. They
include the adapter, which may add 16 ms to each answer. An adapter cannot see t1.5, DE or single bits. Rules:
those that the rows name.

Exit 0: all rows passed, 1: a cross, 2: wrong options or no port, 130: Ctrl-C or another signal.
"""

from __future__ import annotations

import argparse
import contextlib
import select
import signal
import sys
import time
from dataclasses import dataclass
from types import FrameType

from rtl.command import Parser, stop_printing, version
from sim.harness.pins import BAUDS, FORMS
from sim.harness.serial_port import PortError, in_use, opened
from tb.agents.crc16 import crc_good
from tb.agents.rtu import PS_PER_S, build, parse, read_coils, read_registers, t35_ps, write_coils
from tb.model.card import DIALECTS
from tools.selftest_rows import (
    DRIVE_TIMEOUT,
    EEPROM,
    IND,
    INDEX,
    NETWORK_TIMEOUT,
    ROWS,
    UNKNOWN_FUNCTION,
    Ask,
    Row,
    Unexpected,
    done,
    echo,
    has_drive_timeout,
    refusal,
    registers,
    status_word,
    words,
    write_register,
    write_registers,
)

ANSWER_S = 1.0  # a reply is waited for so long at least
EXCHANGE_S = 0.3  # both frames and the computer, beside the waits for the drive
TICK_S = 0.01  # unit of 40003
SLACK_S = 0.15  # adapter and computer; silence is so much longer than the latest reply
LATE_S = 0.05  # adapter: 16 ms each way, and a computer that is not busy
READS = 50
TRIES = 3
BOOT_S = 120.0  # for a person to switch the card off and on
POWER_UP = (1000, 15)  # 40002 and 40003 (MAP-5)
START, RAMP_STOP = 0x047C, 0x043C  # control words of the manual's examples 1 and 2
RUNNING = 0x0800  # status word, bit 11
FULL_SPEED = 0x4000  # 100 %
TURN_S, RAMP_S = 3.0, 120.0
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
PAGE_NO_ANSWER = "docs/guide/bring-up.md, section 4, then docs/guide/debugging.md, No answer"
PAGE_DIALECT = "docs/guide/dialects.md"
TICK, CROSS, NOT_ASKED = "✓", "✗", "-"
MEANING = {255: " (no answer from the drive)"}


@dataclass(frozen=True)
class Options:
    port: str
    unit: int
    baud: int
    format: str
    dialect: str
    drive: bool
    boot: bool
    start: int
    row: str


# ---------------------------------------------------------------- the line


class Line:
    """The serial port: a frame goes out, an answer or silence comes back."""

    def __init__(self, options: Options) -> None:
        self.name = options.port
        bits = 9 + (options.format[1] != "N") + int(options.format[2])
        self.character_s = bits / options.baud
        self.t35_s = t35_ps(options.baud) / PS_PER_S
        self.echoes = False  # the adapter hears itself
        self.stray = b""  # bytes outside of an exchange
        self.quiet_at = 0.0
        self.port = opened(options.port, options.baud, options.format)

    def close(self) -> None:
        self.port.close()

    def exchange(self, frame: bytes, wait_s: float) -> tuple[bytes, float]:
        """The bytes within `wait_s` after the frame, with all that follow without a pause, and their time.

        The time is from the call to the last byte, less the characters on the line.
        """
        with in_use(self.name):
            return self._exchange(frame, wait_s)

    def _exchange(self, frame: bytes, wait_s: float) -> tuple[bytes, float]:
        time.sleep(max(0.0, self.quiet_at - time.monotonic()))
        self.stray += self.port.read(self.port.in_waiting)
        own = len(frame) if self.echoes else 0
        began = last = time.monotonic()
        self.port.write(frame)
        end = began + len(frame) * self.character_s + wait_s
        heard = b""
        while (left := end - time.monotonic()) > 0:
            if not select.select([self.port], [], [], left)[0]:
                break
            heard, last = heard + self.port.read(max(1, self.port.in_waiting)), time.monotonic()
            if len(heard) > own + 4 and crc_good(heard[own:]):
                break
            if len(heard) > own:
                end = last + SLACK_S + 4 * self.character_s
        self.quiet_at = time.monotonic() + self.t35_s + 2 * self.character_s
        # An echo that is not the frame stays in the answer: two senders, or a loose wire.
        answer = heard[own:] if heard[:own] == frame[:own] else heard
        return answer, last - began - (len(frame) + len(answer)) * self.character_s

    def stray_after(self, seconds: float) -> bytes:
        time.sleep(seconds)
        with in_use(self.name):
            self.stray += self.port.read(self.port.in_waiting)
        return self.stray


# ---------------------------------------------------------------- the card


class Card:
    """Asks the card and compares its answers."""

    def __init__(self, line: Line, options: Options) -> None:
        self.line, self.options = line, options
        self.silence_s = line.t35_s + 8 * line.character_s + SLACK_S
        self.drive_timeout = POWER_UP[1]  # 40003

    @property
    def answer_s(self) -> float:
        """The slowest answer is of an absent drive: 40003 is waited for twice (FC-9)."""
        return max(ANSWER_S, 2 * TICK_S * self.drive_timeout + EXCHANGE_S)

    def ask(self, ask: Ask, before: bytes = b"") -> tuple[bytes, str]:
        """The reply's PDU and a remark; Unexpected if it is not the promised one."""
        pdu = ask.request if isinstance(ask.request, bytes) else ask.request(before)
        frame = build(0 if ask.to_all else self.options.unit, pdu)
        if ask.wrong_crc:
            frame = frame[:-1] + bytes([frame[-1] ^ 0x40])
        if ask.reply is None:
            never = ask.to_all or ask.wrong_crc or len(frame) > 256
            heard, _ = self.line.exchange(frame, self.silence_s if never else self.answer_s)
            if heard:
                raise Unexpected(f"{self.described(heard)} instead of silence")
            return b"", ""
        reply = self.reply(frame)
        wanted = echo(pdu) if ask.reply is echo else ask.reply
        if callable(wanted):
            if reply[0] != pdu[0]:
                raise Unexpected(self.described(build(self.options.unit, reply)))
            return reply, wanted(reply)
        if not isinstance(wanted, bytes):
            wanted = refusal(pdu[0], wanted, self.options.dialect)
        if reply != wanted:
            unit = self.options.unit
            raise Unexpected(
                f"{self.described(build(unit, reply))} instead of {self.described(build(unit, wanted))}"
            )
        return reply, self.described(build(self.options.unit, reply)) if reply[0] & 0x80 else ""

    def reply(self, frame: bytes) -> bytes:
        """PDU of this unit's undamaged answer."""
        heard, _ = self.line.exchange(frame, self.answer_s)
        if not heard:
            raise Unexpected("no answer")
        if len(heard) < 5 or not crc_good(heard) or heard[0] != frame[0]:
            raise Unexpected(self.described(heard))
        return parse(heard).pdu

    def described(self, heard: bytes) -> str:
        if len(heard) < 5 or not crc_good(heard):
            return f"damaged answer {heard.hex(' ')}"
        adu = parse(heard)
        if adu.address != self.options.unit:
            return f"unit {adu.address} answers"
        if adu.is_exception:
            return f"exception {adu.exception_code}{MEANING.get(adu.exception_code, '')}"
        return adu.pdu.hex(" ")


class Report:
    """Prints the rows and counts them."""

    def __init__(self) -> None:
        self.passed = self.failed = self.left = 0

    def row(self, mark: str, rule: str, title: str, remark: str = "") -> None:
        print(f"  {mark} {rule:<8} {title}{': ' if remark else ''}{remark}", flush=True)
        self.passed += mark == TICK
        self.failed += mark == CROSS
        self.left += mark == NOT_ASKED

    def check(self, rule: str, title: str, ask: object) -> bool:
        """One row: `ask` returns a remark or raises Unexpected."""
        try:
            remark = ask()
        except Unexpected as unexpected:
            self.row(CROSS, rule, title, str(unexpected))
            return False
        self.row(TICK, rule, title, remark)
        return True

    def summary(self) -> str:
        return f"{self.passed} passed, {self.failed} failed, {self.left} not asked"


class Selftest:
    def __init__(self, card: Card) -> None:
        self.card, self.options, self.line = card, card.options, card.line
        self.report = Report()
        self.before: list[int] | None = None  # 40002 and 40003 as they were found
        self.may_have_written = False  # a row, into the card
        self.motor_may_turn = False

    # ------------------------------------------------------------ rows that are no table

    def answers(self) -> str:
        """A second request if the first is lost: without this answer nothing else is asked."""
        ask, at = Ask(read_registers(NETWORK_TIMEOUT, 2), words_of_two), ""
        try:
            reply, _ = self.card.ask(ask)
        except Unexpected as unexpected:
            at = f"; to the first request: {unexpected}"
            reply, _ = self.card.ask(ask)
        self.before = words(reply)
        self.card.drive_timeout = self.before[1]
        return has_drive_timeout(registers(self.before[1])) + at

    def other_units(self) -> str:
        """The addresses that a stuck switch or a bad joint would make of this one (LINE-7).

        If this one is silent, also those of one switch alone, and of switches in the reverse order.
        """
        unit = self.options.unit
        others = {unit ^ 1 << bit for bit in range(8)}
        if self.before is None:
            others |= {1 << bit for bit in range(8)} | {int(f"{unit:08b}"[::-1], 2)}
        others -= {0, unit}
        for other in sorted(others):
            heard, _ = self.line.exchange(build(other, read_registers(DRIVE_TIMEOUT, 1)), self.card.silence_s)
            if heard:
                raise Unexpected(self.card.described(heard))
        return ", ".join(map(str, sorted(others)))

    def dialect(self) -> str:
        unit, wanted = self.options.unit, self.options.dialect
        code = self.card.reply(build(unit, bytes([UNKNOWN_FUNCTION])))[1]
        fits = [name for name in DIALECTS if DIALECTS[name].codes["function"] == code]
        has_ind = self.card.reply(build(unit, read_registers(IND, 1)))[0] == 3
        fits = [name for name in fits if (DIALECTS[name].index_register == IND) == has_ind]
        if not fits:
            raise Unexpected(f"exception {code} to an unknown function is of no dialect")
        if wanted not in fits:
            raise Unexpected(
                f"the card speaks {fits[0]}, not {wanted}: run make selftest with DIALECT={fits[0]}"
            )
        return wanted

    def turnaround(self) -> str:
        """FRAME-8 within one character, PERF-1 within LATE_S: the adapter adds time."""
        frame = build(self.options.unit, read_registers(DRIVE_TIMEOUT, 1))
        lost, times = 0, []
        for _ in range(READS):
            heard, took = self.line.exchange(frame, self.line.t35_s + 12 * self.line.character_s + SLACK_S)
            if crc_good(heard) and heard[0] == frame[0]:
                times.append(took)
            else:
                lost += 1
        if lost:
            raise Unexpected(f"{lost} of {READS} answers are missing or damaged")
        median = sorted(times)[READS // 2]
        shown = f"{READS} answers, {median * 1e3:.1f} ms in the middle, {max(times) * 1e3:.1f} ms at most"
        limits = f"t3.5 is {self.line.t35_s * 1e3:.2f} ms"
        # The median: a computer that is interrupted measures a single answer too late or too soon.
        if median < self.line.t35_s - self.line.character_s:
            raise Unexpected(f"{shown}: too early, {limits}")
        if median > self.line.t35_s + LATE_S:
            raise Unexpected(f"{shown}: too late, {limits}")
        return f"{shown}; {limits}"

    def nothing_between(self) -> str:
        stray = self.line.stray_after(SLACK_S)
        if stray:
            raise Unexpected(f"{len(stray)} bytes: {stray[:8].hex(' ')}")
        return ""

    def boot(self) -> str:
        """Waits for the power-up values; 40002 has another one before."""
        self.card.ask(done(write_register(NETWORK_TIMEOUT, POWER_UP[0] + 1)))
        print(f"    switch the card off and on within {BOOT_S:.0f} s", flush=True)
        frame = build(self.options.unit, read_registers(NETWORK_TIMEOUT, 2))
        last, end = time.monotonic(), time.monotonic() + BOOT_S
        while time.monotonic() < end:
            heard, _ = self.line.exchange(frame, self.card.silence_s)
            if not crc_good(heard) or heard[0] != frame[0]:
                continue
            silent, last = time.monotonic() - last, time.monotonic()
            if parse(heard).pdu == registers(*POWER_UP):
                self.before = list(POWER_UP)
                self.card.ask(Ask(read_coils(0, 128), bytes([1, 16]) + bytes(16)))
                return f"40002 = 1000, 40003 = 15, all coils 0; silent for {silent:.1f} s"
        raise Unexpected(f"40002 never was {POWER_UP[0]} again within {BOOT_S:.0f} s")

    # ------------------------------------------------------------ the motor

    def control(self, word: int, reference: int) -> tuple[int, int]:
        """Writes control word and reference; returns status word and output frequency after it."""
        bits = [bool((word | reference << 16) >> bit & 1) for bit in range(32)]
        self.card.ask(done(write_coils(0, bits)))
        reply, _ = self.card.ask(Ask(read_coils(32, 32), lambda reply: ""))
        return int.from_bytes(reply[2:4], "little"), int.from_bytes(reply[4:6], "little")

    def shown(self, status: int) -> str:
        return status_word(status, self.options.dialect)

    def motor_turns(self) -> str:
        reference = FULL_SPEED * self.options.start // 100
        self.motor_may_turn = True
        end, status, frequency = time.monotonic() + TURN_S, 0, 0
        while time.monotonic() < end:
            status, frequency = self.control(START, reference)
        if not status & RUNNING or frequency == 0:
            raise Unexpected(f"{self.shown(status)}, output frequency {frequency:04X}h")
        return f"{self.shown(status)}, output frequency {100 * frequency / FULL_SPEED:.1f} %"

    def motor_stops(self) -> str:
        began = time.monotonic()
        while time.monotonic() < began + RAMP_S:
            status, frequency = self.control(RAMP_STOP, 0)
            if frequency == 0 and not status & RUNNING:
                self.motor_may_turn = False
                return f"{self.shown(status)} after {time.monotonic() - began:.1f} s"
        raise Unexpected(f"{self.shown(status)} after {RAMP_S:.0f} s: use the drive's own stop")

    def stop_motor(self) -> str:
        """Stops the motor after a cross or Ctrl-C."""
        for _ in range(TRIES):
            with contextlib.suppress(Unexpected, PortError):
                self.control(RAMP_STOP, 0)
                self.motor_may_turn = False
                return "the motor's stop was sent and answered"
        return "THE MOTOR'S STOP WAS NOT ANSWERED: use the drive's own stop"

    # ------------------------------------------------------------ all rows

    def table_row(self, row: Row) -> str:
        reply, remarks = b"", []
        for number, ask in enumerate(row.asks, 1):
            try:
                reply, remark = self.card.ask(ask, reply)
            except Unexpected as unexpected:
                step = f"request {number} of {len(row.asks)}: " if len(row.asks) > 1 else ""
                hint = "; if a drive is connected, ask with DRIVE=yes" if row.needs == "no drive" else ""
                raise Unexpected(f"{step}{unexpected}{hint}") from None
            remarks.append(remark)
        return ", ".join(dict.fromkeys(filter(None, remarks)))

    def chosen(self, title: str) -> bool:
        return self.options.row.lower() in title.lower()

    def needed(self, row: Row) -> str:
        """Why the row is not asked, or nothing."""
        if row.needs == "drive" and not self.options.drive:
            return "needs a drive (DRIVE=yes)"
        if row.needs == "no drive" and self.options.drive:
            return "needs the drive's wires off (DRIVE=no)"
        return ""

    def rows(self) -> None:
        check, report = self.report.check, self.report
        self.line.echoes = self.hears_itself()
        if self.line.echoes:
            print("  the adapter hears its own bytes; they are left out")
        answered = check("LINE-7", f"unit {self.options.unit} answers", self.answers)
        if not answered or self.chosen(OTHERS):
            check("LINE-7", OTHERS, self.other_units)
        if not answered or not check("DIALECT", SPEAKS, self.dialect):
            print("  the other rows need an answer in this dialect; they were not asked", flush=True)
            print(f"  read: {PAGE_DIALECT if answered else PAGE_NO_ANSWER}", flush=True)
            return
        self.may_have_written = True
        for row in ROWS:
            if self.options.dialect not in row.dialects or not self.chosen(row.title):
                continue
            missing = self.needed(row)
            if missing:
                report.row(NOT_ASKED, row.rule, row.title, missing)
            else:
                check(row.rule, row.title, lambda row=row: self.table_row(row))
        for rule, title, ask in ((*TIMES[0], self.turnaround), (*TIMES[1], self.nothing_between)):
            if self.chosen(title):
                check(rule, title, ask)
        self.asked_for(BOOT, self.options.boot, "BOOT=yes", self.boot)
        self.asked_for(MOTOR[0], self.options.start, "DRIVE=yes START=10", self.motor_turns)
        self.asked_for(MOTOR[1], self.options.start, "DRIVE=yes START=10", self.motor_stops)

    def asked_for(self, row: tuple[str, str], wanted: object, how: str, ask: object) -> None:
        if not self.chosen(row[1]):
            return
        if wanted:
            self.report.check(*row, ask)
        else:
            self.report.row(NOT_ASKED, *row, f"takes {how}")

    def hears_itself(self) -> bool:
        """A broadcast read has no answer (MAP-9), so any returned bytes are the adapter's echo."""
        frame = build(0, read_coils(0, 8))
        return self.line.exchange(frame, self.card.silence_s)[0] == frame

    def write_back(self) -> str:
        """Restores 40002 and 40003, clears index and coil 65; returns a line for each failed write."""
        if self.before is None or not self.may_have_written:
            return ""
        index = IND if DIALECTS[self.options.dialect].index_register == IND else INDEX
        left = {
            "40002 and 40003": write_registers(NETWORK_TIMEOUT, self.before),
            "the index": write_register(index, 0),
            "coil 65": write_coils(EEPROM, [False]),
        }
        for _ in range(TRIES):
            for name, pdu in list(left.items()):
                with contextlib.suppress(Unexpected, PortError):
                    self.card.ask(done(pdu))
                    del left[name]
        return f"not written back: {', '.join(left)}" if left else ""


SPEAKS = "the card speaks this dialect"
OTHERS = "other addresses are silent"
TIMES = (("PERF-1", "answers come after t3.5 and not late"), ("LINE-6", "no byte between the frames"))
BOOT = ("BOOT-1", "off and on: the card starts, its values are those of power-up")
MOTOR = (("FC-5", "the motor turns"), ("FC-5", "the motor stops by its ramp"))


def words_of_two(reply: bytes) -> str:
    if len(words(reply)) != 2:
        raise Unexpected(f"{reply.hex(' ')} is no reply of two registers")
    return ""


# ---------------------------------------------------------------- command line


def number(low: int, high: int, what: str):
    def read(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f"{what} is {low} to {high}, not '{text}'")
        return int(text)

    return read


def one_of(values: tuple, what: str):
    def read(text: str) -> str:
        found = {str(value).lower(): value for value in values}.get(text.lower())
        if found is None:
            raise argparse.ArgumentTypeError(f"{what} is {', '.join(map(str, values))}, not '{text}'")
        return found

    return read


def options_of(arguments: list[str]) -> Options:
    parser = Parser(
        prog="selftest", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--version", action="version", version=version("selftest"))
    parser.add_argument("port", help="serial port of the EIA-485 adapter, for example /dev/ttyUSB0")
    parser.add_argument("--unit", type=number(1, 247, "the unit"), default=1, help="address switches")
    parser.add_argument(
        "--baud", type=one_of(tuple(BAUDS), "the rate"), default=9600, help="baud switches 1-3"
    )
    parser.add_argument(
        "--format", type=one_of(tuple(FORMS), "the format"), default="8N2", help="baud switches 4-5"
    )
    parser.add_argument("--dialect", type=one_of(tuple(DIALECTS), "the dialect"), default="card")
    parser.add_argument("--drive", default="no", help="a drive is connected and has power")
    parser.add_argument("--boot", default="no", help="asks a person to switch the card off and on")
    parser.add_argument(
        "--start", type=number(1, 100, "the speed"), default=0, help="START THE MOTOR at this percentage"
    )
    parser.add_argument("--row", default="", help="only rows with this in their title")
    parsed = vars(parser.parse_args(arguments))
    yes = {name: parsed.pop(name).lower() for name in ("drive", "boot")}
    for name, word in yes.items():
        if word not in ("yes", "no"):
            parser.error(f"--{name} is yes or no, not '{word}'")
        yes[name] = word == "yes"
    if parsed["start"] and not yes["drive"]:
        parser.error(f"START={parsed['start']} turns the motor of a drive: add DRIVE=yes (--drive yes)")
    return Options(**parsed, **yes)


def ignore_signals() -> None:
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def stop_by_signal(number: int, frame: FrameType | None) -> None:
    """The first signal ends the rows; the stop of the motor after it takes seconds and must happen."""
    ignore_signals()
    raise KeyboardInterrupt("stopped by Ctrl-C" if number == signal.SIGINT else "stopped by a signal")


def run(options: Options) -> int:
    line = Line(options)
    test = Selftest(Card(line, options))
    rate = BAUDS[options.baud] + FORMS[options.format]
    address = f"{options.unit:08b}"[::-1]
    print(
        f"selftest: unit {options.unit} at {options.port}, {options.baud} {options.format}, dialect"
        f" {options.dialect}, {'with' if options.drive else 'without'} a drive"
    )
    print(f"Switches for that, 1 = ON: baud 1-5 {rate}, address 1-8 {address}.")
    motor = (
        f"The motor will turn at {options.start} %. Ctrl-C stops it."
        if options.start
        else "No row starts a motor."
    )
    print(motor, flush=True)
    ended, code = [], 0
    try:
        test.rows()
    except KeyboardInterrupt as stop:
        ended, code = [str(stop)], 130
    except PortError as error:
        ended, code = [str(error)], 2
    finally:
        ignore_signals()  # also after a cross
        if test.motor_may_turn:
            ended.append(test.stop_motor())
        ended += filter(None, [test.write_back()])
        line.close()
    report = f"{', '.join(ended)}: {test.report.summary()}" if ended else test.report.summary()
    print(report, file=sys.stderr if code == 2 else sys.stdout, flush=True)
    return code or (1 if test.report.failed else 0)


def main(arguments: list[str]) -> int:
    for number in SIGNALS:
        signal.signal(number, stop_by_signal)
    try:
        return run(options_of(arguments))
    except PortError as error:
        print(f"selftest: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as stop:
        print(f"selftest: {stop}", file=sys.stderr)
        return 130
    except BrokenPipeError:
        stop_printing()
        return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
