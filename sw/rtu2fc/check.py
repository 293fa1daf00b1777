# SPDX-License-Identifier: Apache-2.0
"""`rtu2fc check`: a row for each promise of the documents, with a tick or a cross.

No row starts or stops a motor, unless --start PERCENT asks for it. The table of rows is check_rows.py; here
are those that measure, wait or need more than one address. At the end registers 40002 and 40003 get their
former values; the index and coil 65 become 0. With --drive yes coils 1-32 become 0; after --start the ramp
stop remains in them. An adapter may add 16 ms to each answer. It cannot see t1.5, DE or single bits. Rules:
those that the rows name with --rules.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import signal
from collections.abc import Callable

from . import switches
from .card import (
    DRIVE_TIMEOUT,
    EEPROM,
    NETWORK_TIMEOUT,
    NO_ANSWER_PAGE,
    RAMP_STOP,
    RUNNING,
    SILENT,
    START,
    Card,
    percent_word,
    status_in_words,
)
from .check_rows import ROWS, Ask, Row, Unexpected, done, echo, has_drive_timeout, refusal, registers, words
from .commands import STOP_S, TURN_S, agreed
from .crc16 import crc_good
from .dialects import DIALECTS
from .fc import percent
from .port import LONGEST_FRAME, SLACK_S
from .problem import DONE, FAILED, NoAnswer, Problem
from .rtu import build, parse, read_coils, read_registers, write_coils, write_register, write_registers
from .screen import CROSS, NOT_ASKED, TICK, Screen

LATE_S = 0.05  # adapter: 16 ms each way, and a computer that is not busy
READS = 50
TRIES = 3
BOOT_S = 120.0  # for a person to switch the card off and on
POWER_UP = (1000, 15)  # 40002 and 40003 (MAP-5)
PAGE_DIALECT = "docs/guide/dialects.md"
SPEAKS = "the card speaks this dialect"
OTHERS = "other addresses are silent"
# Rows that are no table: rule, title, method, and the option that they need.
OWN_ROWS = (
    ("PERF-1", "answers come after t3.5 and not late", "turnaround", ""),
    ("LINE-6", "no byte between the frames", "nothing_between", ""),
    ("BOOT-1", "off and on: the card starts, its values are those of power-up", "boot", "boot"),
    ("FC-5", "the motor turns", "motor_turns", "start"),
    ("FC-5", "the motor stops by its ramp", "motor_stops", "start"),
)
TAKES = {"": "", "boot": "takes --boot yes", "start": "takes --drive yes --start 10"}


def add_options(parser: argparse.ArgumentParser, number: Callable, yes_no: Callable) -> None:
    ask = {"type": yes_no, "default": False, "metavar": "yes"}
    parser.add_argument("--drive", dest="with_drive", **ask, help="a drive is connected and has power")
    parser.add_argument("--boot", **ask, help="asks a person to switch the card off and on")
    speed = number(1, 100, "the speed")
    parser.add_argument("--start", type=speed, default=0, help="START THE MOTOR at this percentage")
    parser.add_argument("--yes", action="store_true", help="no question")
    parser.add_argument("--row", type=in_titles, default="", help="only rows with this in their title")
    parser.add_argument(
        "--rules", action="store_true", help="the rule of each row (docs/reference/requirements.md)"
    )


def in_titles(text: str) -> str:
    titles = (OTHERS, *(title for _, title, *_ in OWN_ROWS), *(row.title for row in ROWS))
    if not any(text.lower() in title.lower() for title in titles):
        raise argparse.ArgumentTypeError(f"no row has '{text}' in its title")
    return text


class Check:
    """The rows, asked of one card."""

    def __init__(self, card: Card, args: argparse.Namespace, screen: Screen) -> None:
        self.card, self.line, self.args, self.screen = card, card.line, args, screen
        self.rows: list[dict] = []
        self.before: list[int] | None = None  # 40002 and 40003 as they were found
        self.may_have_written = False  # a row, into the card

    # ------------------------------------------------------------ one row

    def row(self, mark: str, rule: str, title: str, remark: str = "") -> None:
        named = f"{rule:<8} " if self.args.rules else ""
        self.screen.row(mark, f"{named}{title}{': ' if remark else ''}{remark}", indent=len(named) + 2)
        self.rows.append({"passed": {TICK: True, CROSS: False}.get(mark), "rule": rule, "title": title,
                          "remark": remark})  # fmt: skip

    def check(self, rule: str, title: str, ask: Callable[[], str]) -> bool:
        """`ask` returns a remark, or raises Unexpected or NoAnswer."""
        try:
            remark = ask()
        except (Unexpected, NoAnswer) as wrong:
            self.row(CROSS, rule, title, str(wrong))
            return False
        self.row(TICK, rule, title, remark)
        return True

    def count(self, passed: bool | None) -> int:
        return sum(row["passed"] is passed for row in self.rows)

    def summary(self) -> str:
        return f"{self.count(True)} passed, {self.count(False)} failed, {self.count(None)} not asked"

    def ask(self, ask: Ask, before: bytes = b"") -> tuple[bytes, str]:
        """The reply's PDU and a remark; Unexpected if it is not the promised one."""
        card, unit = self.card, self.card.unit
        pdu = ask.request if isinstance(ask.request, bytes) else ask.request(before)
        frame = build(0 if ask.to_all else unit, pdu)
        if ask.wrong_crc:
            frame = frame[:-1] + bytes([frame[-1] ^ 0x40])
        if ask.reply is None:
            never = ask.to_all or ask.wrong_crc or len(frame) > LONGEST_FRAME
            heard, _ = self.line.exchange(frame, card.silence_s if never else card.answer_s)
            if heard:
                raise Unexpected(f"{card.described(heard)} instead of silence")
            return b"", ""
        reply = card.reply(frame)
        got = card.described(build(unit, reply))
        wanted = echo(pdu) if ask.reply is echo else ask.reply
        if callable(wanted):
            if reply[0] != pdu[0]:
                raise Unexpected(got)
            return reply, wanted(reply)
        if not isinstance(wanted, bytes):
            wanted = refusal(pdu[0], wanted, card.dialect)
        if reply != wanted:
            raise Unexpected(f"{got} instead of {card.described(build(unit, wanted))}")
        return reply, got if reply[0] & 0x80 else ""

    def skip_late(self, wrong: Exception) -> None:
        """The next request must not get the late answer to this one. A stop does not wait for that."""
        if str(wrong) == SILENT:
            self.line.exchange(b"", self.card.answer_s)

    def table_row(self, row: Row) -> str:
        reply, remarks = b"", []
        for number, ask in enumerate(row.asks, 1):
            try:
                reply, remark = self.ask(ask, reply)
            except (Unexpected, NoAnswer) as wrong:
                self.skip_late(wrong)
                step = f"request {number} of {len(row.asks)}: " if len(row.asks) > 1 else ""
                hint = "; if a drive is connected, ask with --drive yes" if row.needs == "no drive" else ""
                raise Unexpected(f"{step}{wrong}{hint}") from None
            remarks.append(remark)
        return ", ".join(dict.fromkeys(filter(None, remarks)))

    # ------------------------------------------------------------ rows that are no table

    def hears_itself(self) -> bool:
        """A broadcast read has no answer (MAP-9), so any returned bytes are the adapter's echo."""
        frame = build(0, read_coils(0, 8))
        return self.line.exchange(frame, self.card.silence_s)[0] == frame

    def answers(self) -> str:
        """A second request if the first is lost: without this answer nothing else is asked."""
        ask, at = Ask(read_registers(NETWORK_TIMEOUT, 2), words_of_two), ""
        try:
            reply, _ = self.ask(ask)
        except (Unexpected, NoAnswer) as wrong:
            self.skip_late(wrong)
            at = f"; to the first request: {wrong}"
            reply, _ = self.ask(ask)
        self.before = words(reply)
        self.card.drive_timeout = self.before[1]
        return has_drive_timeout(registers(self.before[1])) + at

    def other_units(self) -> str:
        """The addresses that a stuck switch or a bad joint would make of this one (LINE-7).

        If this one is silent, also those of one switch alone, and of switches in the reverse order.
        """
        unit = self.card.unit
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
        try:
            spoken = self.card.spoken()
        except Problem as problem:
            raise Unexpected(str(problem)) from None
        if self.card.dialect not in ("auto", spoken):
            raise Unexpected(f"the card speaks {spoken}, not {self.card.dialect}")
        self.card.dialect = spoken
        return spoken

    def turnaround(self) -> str:
        """FRAME-8 within one character, PERF-1 within LATE_S: the adapter adds time."""
        line, lost, times = self.line, 0, []
        frame = build(self.card.unit, read_registers(DRIVE_TIMEOUT, 1))
        for _ in range(READS):
            heard, took = line.exchange(frame, line.t35_s + 12 * line.character_s + SLACK_S)
            if crc_good(heard) and heard[0] == frame[0]:
                times.append(took)
            else:
                lost += 1
        if lost:
            raise Unexpected(f"{lost} of {READS} answers are missing or damaged")
        median = sorted(times)[READS // 2]
        shown = f"{READS} answers, {median * 1e3:.1f} ms in the middle, {max(times) * 1e3:.1f} ms at most"
        limits = f"t3.5 is {line.t35_s * 1e3:.2f} ms"
        # The median: a computer that is interrupted measures a single answer too late or too soon.
        if median < line.t35_s - line.character_s:
            raise Unexpected(f"{shown}: too early, {limits}")
        if median > line.t35_s + LATE_S:
            raise Unexpected(f"{shown}: too late, {limits}")
        return f"{shown}; {limits}"

    def nothing_between(self) -> str:
        stray = self.line.stray + self.line.exchange(b"", SLACK_S)[0]
        if stray:
            raise Unexpected(f"{len(stray)} bytes: {stray[:8].hex(' ')}")
        return ""

    def boot(self) -> str:
        """Waits for the power-up values; 40002 has another one before."""
        self.ask(done(write_register(NETWORK_TIMEOUT, POWER_UP[0] + 1)))
        self.screen.say(
            f"    switch the card off and on (in a drive: the drive's line switch) within {BOOT_S:.0f} s"
        )
        frame = build(self.card.unit, read_registers(NETWORK_TIMEOUT, 2))
        last, end = self.line.at, self.line.at + BOOT_S
        while self.line.at < end:
            heard, _ = self.line.exchange(frame, self.card.silence_s)
            if not crc_good(heard) or heard[0] != frame[0]:
                continue
            silent, last = self.line.at - last, self.line.at
            if parse(heard).pdu == registers(*POWER_UP):
                self.before = list(POWER_UP)
                self.ask(Ask(read_coils(0, 128), bytes([1, 16]) + bytes(16)))
                return f"40002 = 1000, 40003 = 15, all coils 0; silent for {silent:.1f} s"
        raise Unexpected(f"40002 never was {POWER_UP[0]} again within {BOOT_S:.0f} s")

    # ------------------------------------------------------------ the motor

    def control(self, word: int, reference: int) -> tuple[int, int]:
        """Writes control word and reference; returns status word and output frequency after it."""
        bits = [bool((word | reference << 16) >> bit & 1) for bit in range(32)]
        self.ask(done(write_coils(0, bits)))
        reply, _ = self.ask(Ask(read_coils(32, 32), lambda reply: ""))
        return int.from_bytes(reply[2:4], "little"), int.from_bytes(reply[4:6], "little")

    def motor_turns(self) -> str:
        reference = percent_word(self.args.start)
        self.card.motor_may_turn = True
        end, status, frequency = self.line.at + TURN_S, 0, 0
        while self.line.at < end:
            status, frequency = self.control(START, reference)
        shown = status_in_words(status, self.card.drive)
        if not status & RUNNING or frequency == 0:
            raise Unexpected(f"{shown}, output frequency {frequency:04X}h")
        return f"{shown}, output frequency {percent(frequency)}"

    def motor_stops(self) -> str:
        began, shown = self.line.at, ""
        while self.line.at < began + STOP_S:
            status, frequency = self.control(RAMP_STOP, 0)
            shown = status_in_words(status, self.card.drive)
            if frequency == 0 and not status & RUNNING:
                self.card.motor_may_turn = False
                return f"{shown} after {self.line.at - began:.1f} s"
        raise Unexpected(f"{shown} after {STOP_S:.0f} s: use the drive's own stop")

    def stop_motor(self) -> str:
        """Stops the motor after a cross or Ctrl-C."""
        for _ in range(TRIES):
            with contextlib.suppress(Unexpected, Problem):
                self.control(RAMP_STOP, 0)
                self.card.motor_may_turn = False
                return "the motor's stop was sent and answered"
        return "THE MOTOR'S STOP WAS NOT ANSWERED: use the drive's own stop"

    # ------------------------------------------------------------ all rows

    def chosen(self, title: str) -> bool:
        return self.args.row.lower() in title.lower()

    def all_rows(self) -> None:
        self.line.echoes = self.hears_itself()
        if self.line.echoes:
            self.screen.say("  the adapter hears its own bytes; they are left out")
        answered = self.check("LINE-7", f"unit {self.card.unit} answers", self.answers)
        if not answered or self.chosen(OTHERS):
            self.check("LINE-7", OTHERS, self.other_units)
        if not answered or not self.check("DIALECT", SPEAKS, self.dialect):
            self.screen.say("  the other rows need an answer in this dialect; they were not asked")
            self.screen.say(f"  read: {PAGE_DIALECT if answered else NO_ANSWER_PAGE}")
            return
        self.may_have_written = True
        for row in ROWS:
            if self.card.dialect in row.dialects:
                wanted = not row.needs or (row.needs == "drive") == self.args.with_drive
                without = "for the bench, without a drive (--drive no)"
                how = "needs a drive (--drive yes)" if row.needs == "drive" else without
                self.asked_for(row.rule, row.title, wanted, how, functools.partial(self.table_row, row))
        for rule, title, ask, option in OWN_ROWS:
            wanted = not option or getattr(self.args, option)
            self.asked_for(rule, title, wanted, TAKES[option], getattr(self, ask))

    def asked_for(self, rule: str, title: str, wanted: object, how: str, ask: Callable[[], str]) -> None:
        if not self.chosen(title):
            return
        if wanted:
            self.check(rule, title, ask)
        else:
            self.row(NOT_ASKED, rule, title, how)

    def write_back(self) -> str:
        """Restores 40002 and 40003, clears index and coil 65; names what it could not write."""
        if self.before is None or not self.may_have_written:
            return ""
        left = {
            "40002 and 40003": write_registers(NETWORK_TIMEOUT, self.before),
            "the index": write_register(DIALECTS[self.card.dialect].index_register, 0),
            "coil 65": write_coils(EEPROM, [False]),
        }
        for _ in range(TRIES):
            for name, pdu in list(left.items()):
                with contextlib.suppress(Unexpected, Problem):
                    self.ask(done(pdu))
                    del left[name]
        return f"not written back: {', '.join(left)}" if left else ""


def words_of_two(reply: bytes) -> str:
    if len(words(reply)) != 2:
        raise Unexpected(f"{reply.hex(' ')} is no reply of two registers")
    return ""


def check(args: argparse.Namespace, screen: Screen, card: Card) -> int:
    if args.start and not args.with_drive:
        raise Problem(f"--start {args.start} turns the motor of a drive: add --drive yes")
    test = Check(card, args, screen)
    line = card.line
    positions = f"baud 1-5 {switches.BAUDS[line.baud]}{switches.FORMS[line.form]}"
    drive = "with" if args.with_drive else "without"
    screen.say(f"check: unit {card.unit} at {line.name}, {line.baud} {line.form}, {drive} a drive")
    screen.say(f"Switches for that, 1 = ON: {positions}, address 1-8 {switches.address(card.unit)}.")
    if args.start:
        screen.say(f"The motor will turn at {args.start} %. Ctrl-C stops it.")
        agreed(args, f"the motor of unit {card.unit} will turn at {args.start} %")
    else:
        screen.say("No row starts a motor.")
    ended: list[str] = []
    failure: BaseException | None = None
    try:
        test.all_rows()
    except (KeyboardInterrupt, Problem) as reason:
        failure = reason
        ended.append(str(reason))
    finally:
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):  # also after a cross: the stop must happen
            if hasattr(signal, name) and signal.getsignal(signal.SIGINT) not in (None, signal.SIG_DFL):
                signal.signal(getattr(signal, name), signal.SIG_IGN)
        if card.motor_may_turn:
            ended.append(test.stop_motor())
        ended += filter(None, [test.write_back()])
    said = f"{', '.join(ended)}: {test.summary()}" if ended else test.summary()
    screen.result |= {"dialect": card.dialect, "rows": test.rows, "passed": test.count(True),
                      "failed": test.count(False), "not_asked": test.count(None)}  # fmt: skip
    if failure:
        raise type(failure)(said) from None
    screen.say(said)
    return FAILED if test.count(False) else DONE
