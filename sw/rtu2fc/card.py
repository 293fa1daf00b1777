# SPDX-License-Identifier: Apache-2.0
"""A card on a line: its map of coils, registers and parameters, and the drive's words.

On-wire numbers throughout: coil 65 is 64, register 40003 is 2.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation

from . import fc, tables
from .crc16 import crc_good
from .dialects import DIALECTS, meaning
from .drives import DRIVES
from .port import SLACK_S, Line
from .problem import NoAnswer, Problem, Refused, WrongDialect
from .rtu import (
    build,
    parse,
    read_coils,
    read_registers,
    write_coil,
    write_coils,
    write_register,
    write_registers,
)

EEPROM, IND, NETWORK_TIMEOUT, DRIVE_TIMEOUT, INDEX = 64, 0, 1, 2, 8
UNKNOWN_FUNCTION = 0x41
ANSWER_S = 1.5  # a reply is waited for so long at least
EXCHANGE_S = 0.3  # both frames and the computer, beside the waits for the drive
TICK_S = 0.01  # unit of 40003
# Control words: examples 1 and 2 of the manual; coast with start = 0; the change of bit 7 is the reset.
START, RAMP_STOP, COAST, RESET = 0x047C, 0x043C, 0x0434, 0x04BC
START_BIT, VALID_BIT, TRIP, RUNNING = 0x0040, 0x0400, 0x0008, 0x0800
TEXT_MOST, TEXT_REGISTERS = 20, 10
TYPE_MISMATCH = 5
MOST_NAMES = 12  # of an ambiguous one
SIZES = {"uint8": (0, 0xFF), "int16": (-0x8000, 0x7FFF), "uint16": (0, 0xFFFF)}
SIZES |= {"int32": (-0x80000000, 0x7FFFFFFF), "uint32": (0, 0xFFFFFFFF)}
SILENT, NO_ANSWER_PAGE = "no answer", "docs/guide/debugging.md, No answer"
# Printed when a drive is silent, and its owner may be about to open it.
OUTSIDE_ONLY = (
    "Swap A and B at the master. Inside a drive look at nothing until it has been off for 14 minutes."
)


@dataclass(frozen=True)
class Parameter:
    number: int
    name: str = "not in this drive's table"
    type: str = ""
    conversion: int = 0
    unit: str = ""
    index: int = 0

    def __str__(self) -> str:
        return f"{self.number}{f'[{self.index}]' if self.index else ''} {self.name}"


def parameters(drive: str) -> dict[int, Parameter]:
    return {pnu: Parameter(pnu, *row) for pnu, row in DRIVES[drive]["parameters"].items()}


def parameter(drive: str, word: str) -> Parameter:
    """By number or a part of its name; `615[2]` is an element of an array."""
    word, _, index = word.strip().removesuffix("]").partition("[")
    if index and not (index.isdecimal() and int(index) < 256):
        raise Problem(f"the index is 0 to 255, not '{index}'")
    known = parameters(drive)
    if word.isdecimal():
        number = int(word)
        most = DRIVES[drive]["pnu_mask"]
        if not 1 <= number <= most:
            raise Problem(f"a parameter of {drive} has a number from 1 to {most}, not {number}")
        found = known.get(number, Parameter(number))
    else:
        fits = [one for one in known.values() if word.lower() in one.name.lower()]
        exact = [one for one in fits if one.name.lower() == word.lower()]
        if len(exact or fits) != 1:
            names = [f"  {one}" for one in fits[:MOST_NAMES]]
            names += [f"  and {len(fits) - MOST_NAMES} more"] if len(fits) > MOST_NAMES else []
            raise Problem(f"{len(fits) or 'no'} parameters of {drive} have '{word}' in their name", *names)
        found = (exact or fits)[0]
    return Parameter(*(found.number, found.name, found.type, found.conversion, found.unit), int(index or 0))


def raw_of(one: Parameter, text: str) -> int:
    """The number on the wire for a value with decimals."""
    try:
        value = Decimal(text.replace(",", "."))
        raw = value.scaleb(-one.conversion) if -6 < one.conversion < 6 else value
        if not raw.is_finite():
            raise InvalidOperation
    except ArithmeticError:
        raise Problem(f"'{text}' is no number") from None
    if raw != raw.to_integral_value():
        raise Problem(f"{one} has steps of {Decimal(1).scaleb(one.conversion)} {one.unit}".rstrip())
    low, high = SIZES.get(one.type, (-0x80000000, 0xFFFFFFFF))
    if not low <= raw <= high:
        raise Problem(f"{text} is outside of what {one} can hold")
    return int(raw)


def percent_word(share: float) -> int:
    return int(fc.FULL_SCALE * share / 100) & 0xFFFF  # 40 % is 1999h, as in the manual's example 1


def control_in_words(word: int, drive: str) -> str:
    return f"control word {word:04X}h ({fc.bits_in_words(word, tables.CONTROL, DRIVES[drive])})"


def status_in_words(word: int, drive: str) -> str:
    return f"status word {word:04X}h ({fc.bits_in_words(word, tables.STATUS, DRIVES[drive])})"


def for_drive(pdu: bytes) -> bool:
    """Whether the request may need the drive's answer; a dialect without exception 255 is silent then."""
    first = int.from_bytes(pdu[1:3], "big")
    return first > INDEX if pdu[0] in (3, 6, 16) else first < EEPROM


def drive_silent() -> NoAnswer:
    return NoAnswer(
        "the card answers, but its drive does not",
        "Check that the drive has power, and its bus settings: 9600 bit/s, address 1.",
        "Read: docs/guide/debugging.md, Exception 255",
    )


class Card:
    """Asks one unit. `hello` finds the dialect and the times before anything else."""

    def __init__(self, line: Line, unit: int, dialect: str = "auto", drive: str = "auto") -> None:
        self.line, self.unit, self.dialect, self._drive = line, unit, dialect, drive
        self.silence_s = line.t35_s + 8 * line.character_s + SLACK_S
        self.drive_timeout = 15  # 40003
        self.motor_may_turn = False
        self._index: int | None = None  # as it was found

    @property
    def drive(self) -> str:
        if self._drive == "auto":
            return DIALECTS[self.dialect].drive if self.dialect in DIALECTS else "vlt6000"
        return self._drive

    @property
    def answer_s(self) -> float:
        """The slowest answer is of an absent drive: 40003 is waited for twice (FC-9)."""
        return max(ANSWER_S, 2 * TICK_S * self.drive_timeout + EXCHANGE_S)

    # ------------------------------------------------------------ frames

    def described(self, heard: bytes) -> str:
        if len(heard) < 5 or not crc_good(heard):
            return f"damaged answer {heard.hex(' ')}"
        adu = parse(heard)
        if adu.address != self.unit:
            return f"unit {adu.address} answers"
        if adu.is_exception:
            silent = " (no answer from the drive)" if adu.exception_code == 255 else ""
            return f"exception {adu.exception_code}{silent}"
        return adu.pdu.hex(" ")

    def reply(self, frame: bytes) -> bytes:
        """PDU of this unit's undamaged answer."""
        heard, _ = self.line.exchange(frame, self.answer_s)
        if not heard:
            raise NoAnswer(SILENT, *self.advice())
        if len(heard) < 5 or not crc_good(heard) or heard[0] != frame[0]:
            raise NoAnswer(self.described(heard), *self.advice())
        return parse(heard).pdu

    def advice(self) -> list[str]:
        line = self.line
        return [
            f"Tried: unit {self.unit} at {line.baud} {line.form} on {line.name}, {self.answer_s:.1f} s.",
            OUTSIDE_ONLY,
            f"Compare the switches: rtu2fc switches {line.baud} {line.form} {self.unit}",
            f"Rate, format or unit not known: rtu2fc scan {line.name}",
            f"Read: {NO_ANSWER_PAGE}",
        ]

    def ask(self, pdu: bytes, tries: int = 1) -> bytes:
        """The reply's PDU. An exception is Refused; a reading may be asked again."""
        frame, silent = build(self.unit, pdu), False
        while True:
            tries -= 1
            try:
                reply = self.reply(frame)
                break
            except NoAnswer as lost:
                silent |= str(lost) == SILENT
                if tries < 1:
                    if silent and for_drive(pdu) and self.is_there():
                        raise drive_silent() from None
                    raise
        # This may be the late reply to the first request: the next question must not get the second one.
        if silent:
            self.line.exchange(b"", 2 * self.answer_s)
        if reply[0] == pdu[0]:
            return reply
        if len(reply) != 2 or reply[0] != pdu[0] | 0x80:
            raise NoAnswer(f"{reply.hex(' ')} is no answer to {pdu.hex(' ')}")
        dialect = self.dialect if self.dialect in DIALECTS else "card"
        if reply[1] == DIALECTS[dialect].codes.get("silent"):
            raise drive_silent()
        of_drive = for_drive(pdu) and pdu[0] in (3, 6, 16)
        raise Refused(f"exception {reply[1]}: {meaning(reply[1], dialect, of_drive)}", reply[1])

    def is_there(self) -> bool:
        """Whether the card answers a question that needs no drive. A late reply is another sign of it."""
        late, _ = self.line.exchange(b"", self.answer_s)
        heard, _ = self.line.exchange(build(self.unit, read_registers(DRIVE_TIMEOUT, 1)), self.answer_s)
        return any(answer[:1] == bytes([self.unit]) and crc_good(answer) for answer in (late, heard))

    def hello(self) -> None:
        """Whether the unit answers; then its times and its dialect."""
        try:
            reply = self.ask(read_registers(DRIVE_TIMEOUT, 1), tries=2)
            self.drive_timeout = int.from_bytes(reply[2:4], "big")
        except Refused:
            pass  # another maker's card may not have it
        try:
            spoken = self.spoken()
        except (NoAnswer, WrongDialect) as problem:
            if self.dialect != "auto":
                return  # another maker's card, whose dialect the user knows
            if isinstance(problem, WrongDialect):
                raise
            names = f"If another maker's slave has none: --dialect {', '.join(DIALECTS)}"
            raise NoAnswer(f"{problem} to an unknown function", *problem.advice, names) from None
        if self.dialect not in ("auto", spoken):
            advice = f"Leave --dialect out, or say --dialect {spoken}."
            raise WrongDialect(f"the card speaks {spoken}, not {self.dialect}", advice)
        self.dialect = spoken

    def spoken(self) -> str:
        """The dialect, from the exception to an unknown function and the place of the index."""
        code = self.reply(build(self.unit, bytes([UNKNOWN_FUNCTION])))[1]
        fits = [name for name in DIALECTS if DIALECTS[name].codes["function"] == code]
        has_ind = self.reply(build(self.unit, read_registers(IND, 1)))[0] == 3
        fits = [name for name in fits if (DIALECTS[name].index_register == IND) == has_ind]
        if not fits:
            raise WrongDialect(
                f"exception {code} to an unknown function is of no dialect",
                f"Name the dialect all the same: --dialect {', '.join(DIALECTS)}",
            )
        # One that differs in neither is as good as the first.
        return self.dialect if self.dialect in fits else fits[0]

    # ------------------------------------------------------------ coils and registers

    def coils(self, first: int, count: int) -> int:
        """The coils as one number, the first one its lowest bit."""
        reply = self.ask(read_coils(first, count), tries=2)
        if len(reply) != 2 + (count + 7) // 8:
            raise NoAnswer(f"{reply.hex(' ')} is no reply of {count} coils")
        return int.from_bytes(reply[2:], "little")

    def registers(self, first: int, count: int) -> bytes:
        reply = self.ask(read_registers(first, count), tries=2)
        if reply[1] != 2 * count or len(reply) != 2 + reply[1]:
            raise NoAnswer(f"{reply.hex(' ')} is no reply of {count} registers")
        return reply[2:]

    # ------------------------------------------------------------ the motor

    def control(self, word: int, reference: int | None = None) -> None:
        """Writes the control word, and the reference too if it is given, in one telegram."""
        self.motor_may_turn = True  # until the answer: a stop may be lost
        count, value = (16, word) if reference is None else (32, word | reference << 16)
        self.ask(write_coils(0, [bool(value >> bit & 1) for bit in range(count)]))
        self.motor_may_turn = bool(word & START_BIT)

    def process_words(self) -> tuple[int, int]:
        """Status word and output frequency. With some firmware the read itself asks the drive (MAP-1)."""
        both = self.coils(32, 32)
        return both & 0xFFFF, both >> 16

    # ------------------------------------------------------------ parameters

    @contextlib.contextmanager
    def _indexed(self, value: int) -> Iterator[None]:
        """The index register holds `value` meanwhile, and its former value after it."""
        register = DIALECTS[self.dialect].index_register
        if self._index is None:  # nobody else writes it: no other master is on the bus
            self._index = int.from_bytes(self.registers(register, 1), "big")
        if self._index == value:
            yield
            return
        self.ask(write_register(register, value))
        try:
            yield
        finally:
            self.ask(write_register(register, self._index), tries=2)

    def read(self, one: Parameter) -> int | str:
        """The raw number, or the text."""
        if one.type == "text":
            return self._read_text(one)
        try:
            with self._indexed(one.index):
                raw = int.from_bytes(self.registers(10 * one.number - 1, 2), "big")
        except Refused as refused:
            if refused.number == TYPE_MISMATCH and not one.type:
                return self._read_text(one)
            raise
        return fc.signed(one.type, raw)

    def _read_text(self, one: Parameter) -> str:
        by_size = DIALECTS[self.dialect].text_by_size
        with self._indexed(one.index if by_size else 0x0400 | one.index):
            return fc.latin1(self.registers(10 * one.number - 1, TEXT_REGISTERS)).rstrip()

    def write(self, one: Parameter, text: str) -> None:
        """As coil 65 says: into RAM, or into the EEPROM too."""
        register, by_size = 10 * one.number - 1, DIALECTS[self.dialect].text_by_size
        if one.type == "text":
            data = text.encode("latin-1", "replace")
            if len(data) > TEXT_MOST:
                raise Problem(f"a text has {TEXT_MOST} characters at most, not {len(data)}")
            data = data.ljust(6 if by_size else 2).ljust(len(data) + len(data) % 2)
            values = [int.from_bytes(data[i : i + 2], "big") for i in range(0, len(data), 2)]
            with self._indexed(one.index if by_size else 0x0500 | one.index):
                self.ask(write_registers(register, values))
            return
        raw = raw_of(one, text)
        double = one.type in ("int32", "uint32") or not -0x8000 <= raw <= 0xFFFF
        with self._indexed(one.index):
            self.ask(write_registers(register, [raw >> 16, raw]) if double else write_register(register, raw))

    @contextlib.contextmanager
    def storing(self) -> Iterator[None]:
        """Coil 65 is on meanwhile: writes go into the drive's EEPROM."""
        was = self.coils(EEPROM, 1)
        self.ask(write_coil(EEPROM, True))
        try:
            yield
        finally:
            self.ask(write_coil(EEPROM, bool(was)), tries=2)

    def shown(self, one: Parameter, value: int | str) -> str:
        """A value with decimals and unit."""
        if isinstance(value, str):
            return f"'{value}'"
        return fc.scaled(DRIVES[self.drive], one.number, value & 0xFFFFFFFF)
