# SPDX-License-Identifier: Apache-2.0
"""The rows of `rtu2fc check`: each asks a card what one of its documents promises.

A row is one declaration. Its asks run in order; the first unexpected answer makes the row a cross. Requests
are PDUs with on-wire numbers (coil 65 is 64, register 40003 is 2). `needs` names the row's other condition:

    ""          nothing
    "no drive"  no drive that answers
    "drive"     a drive; every telegram has control word 0, which commands nothing (FC-5)

No row here has the start bit or bit 10 of the control word = 1, so none starts or stops a motor.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

from .card import (
    DRIVE_TIMEOUT,
    EEPROM,
    IND,
    INDEX,
    NETWORK_TIMEOUT,
    TEXT_REGISTERS,
    UNKNOWN_FUNCTION,
    status_in_words,
)
from .dialects import DIALECTS, Dialect
from .drives import DRIVES
from .rtu import (
    exception,
    read_coils,
    read_registers,
    write_coil,
    write_coils,
    write_register,
    write_registers,
)

RESERVED = 3  # register 40004
LANGUAGE = 1  # parameter "language", in every drive of these documents
NO_PARAMETER = 2047  # in no drive of these documents
CARD = tuple(name for name, one in DIALECTS.items() if not one.text_by_size)
BUILT_IN = tuple(name for name in DIALECTS if name not in CARD)
DIAGNOSED = tuple(name for name, one in DIALECTS.items() if "DIAGNOSTICS" in one.options)
NOT_DIAGNOSED = tuple(name for name in DIALECTS if name not in DIAGNOSED)
VALUES = (0x04D2, 0x0010)  # written to 40002 and 40003 and taken back

# Takes the reply's PDU. Returns a remark to print, or raises Unexpected.
Check = Callable[[bytes], str]
Request = "bytes | Callable[[bytes], bytes]"  # made from the reply before, if that decides


class Unexpected(Exception):
    """The reply is not the promised one, in words."""


@dataclass(frozen=True)
class Ask:
    """A request and its promised reply.

    The reply is a PDU, `echo` of the request, an error of dialects.py by its name, a fault of the drive
    by its number, a check, or None for silence.
    """

    request: Request
    reply: bytes | str | int | Check | None
    to_all: bool = False
    wrong_crc: bool = False


@dataclass(frozen=True)
class Row:
    rule: str
    title: str
    asks: tuple[Ask, ...]
    needs: str = ""
    dialects: tuple[str, ...] = tuple(DIALECTS)


def parameter(number: int, count: int) -> bytes:
    """Reads the registers of a drive's parameter (MAP-6)."""
    return read_registers(10 * number - 1, count)


def echo(pdu: bytes) -> bytes:
    """The reply to a write (section 6 of the rules): its first five bytes."""
    return pdu[:5]


def done(pdu: bytes, **how: bool) -> Ask:
    """A write that is carried out."""
    return Ask(pdu, None if how.get("to_all") else echo(pdu), **how)


def registers(*values: int) -> bytes:
    return bytes([3, 2 * len(values)]) + b"".join(value.to_bytes(2, "big") for value in values)


def kept(first: int, *values: int) -> tuple[Ask, Ask]:
    """A write of registers that is carried out, by 06 if it is one; then they are read."""
    write = write_registers(first, list(values)) if len(values) > 1 else write_register(first, *values)
    return done(write), Ask(read_registers(first, len(values)), registers(*values))


def coil_65(on: bool) -> Ask:
    return Ask(read_coils(EEPROM, 1), bytes([1, 1, on]))


def words(reply: bytes) -> list[int]:
    """The registers of a reply to function 03."""
    if reply[0] != 3 or len(reply) != 2 + reply[1] or reply[1] % 2 or not reply[1]:
        raise Unexpected(f"{reply.hex(' ')} is no reply of registers")
    return [int.from_bytes(reply[i : i + 2], "big") for i in range(2, len(reply), 2)]


by_05 = functools.partial(write_coil, EEPROM)


def sets_and_clears(write: Callable[[bool], bytes], **how: bool) -> tuple[Ask, ...]:
    """Coil 65, by a write that is carried out."""
    return tuple(ask for on in (True, False) for ask in (done(write(on), **how), coil_65(on)))


# ---------------------------------------------------------------- checks


def has_drive_timeout(reply: bytes) -> str:
    values = words(reply)
    if len(values) != 1 or values == [0]:
        raise Unexpected("40003 = 0" if values == [0] else f"{reply.hex(' ')} is no reply of one register")
    return f"40003 = {values[0]}"


def has_128_coils(reply: bytes) -> str:
    if len(reply) != 18 or reply[:2] != bytes([1, 16]):
        raise Unexpected(f"{reply.hex(' ')} is no reply of 128 coils")
    if reply[10] & 0xFE or any(reply[11:]):
        raise Unexpected(f"a reserved coil of 66-128 is 1: {reply[10:].hex(' ')}")
    return f"control word {reply[3]:02X}{reply[2]:02X}h"


def has_language(reply: bytes) -> str:
    value = int.from_bytes(reply[2:], "big")
    words(reply)
    return f"language = {value}"


def has_text(reply: bytes) -> str:
    words(reply)
    text = reply[2:]
    if not text.isascii() or not text.strip() or not text.decode().isprintable():
        raise Unexpected(f"{text.hex(' ')} is no text")
    return f"'{text.decode().strip()}'"


def has_status(reply: bytes, dialect: str = "card") -> str:
    if reply[:2] != bytes([1, 4]) or len(reply) != 6:
        raise Unexpected(f"{reply.hex(' ')} is no reply of 32 coils")
    status, frequency = (int.from_bytes(reply[at : at + 2], "little") for at in (2, 4))
    if status == 0:
        raise Unexpected("the status word is 0000h")
    return f"{status_in_words(status, DIALECTS[dialect].drive)}, output frequency {frequency:04X}h"


def has_server_id(reply: bytes) -> str:
    text = reply[2:-1]
    if len(reply) != reply[1] + 2 or not text.startswith(b"rtu2fc ") or reply[-1] != 0xFF:
        raise Unexpected(f"{reply.hex(' ')} is not the id of a running rtu2fc")
    return text.decode("ascii", "replace")


def has_identification(reply: bytes) -> str:
    if reply[:7] != bytes.fromhex("2B 0E 01 81 00 00 03"):
        raise Unexpected(f"{reply.hex(' ')} is no list of three objects")
    objects, rest = [], reply[7:]
    while len(rest) > 1:
        objects.append(rest[2 : 2 + rest[1]].decode("ascii", "replace"))
        rest = rest[2 + rest[1] :]
    if len(objects) != 3 or objects[0] != "rtu2fc":
        raise Unexpected(f"the objects are {', '.join(objects)}")
    return ", ".join(objects)


# ---------------------------------------------------------------- rows
TEXT_READS = bytes.fromhex("10 0000 0001 02 0400")  # IND = 0400h: function 03 reads texts (MAP-8)
WRONG_COUNT, WRONG_COIL = bytes.fromhex("0F 0040 0001 02 0000"), bytes.fromhex("05 0040 1234")
IDENTIFICATION = bytes.fromhex("2B 0E 01 00")
ALL_COILS = "01 reads 128 coils, 66-128 are 0"
READ_LANGUAGE, READ_40003 = parameter(LANGUAGE, 1), Ask(read_registers(DRIVE_TIMEOUT, 1), has_drive_timeout)


def diagnostic(sub: int, value: int = 0) -> bytes:
    return bytes([8]) + sub.to_bytes(2, "big") + value.to_bytes(2, "big")


def refused(title: str, pdu: bytes, why: str | int, rule: str = "EXC", *then: Ask, needs: str = "") -> Row:
    """A request that gets an exception; `then` shows that it wrote nothing."""
    return Row(rule, title, (Ask(pdu, why), *then), needs)


def diagnosed(title: str, *asks: Ask) -> Row:
    return Row("MAP-10", title, asks, dialects=DIAGNOSED)


def index_row(at: int, dialects: tuple[str, ...]) -> Row:
    asks = (*kept(at, 7), done(write_register(at, 0)))
    return Row("MAP-5", f"{40001 + at} holds the index that is written", asks, "", dialects)


def text_row(name: str, dialect: Dialect) -> Row:
    known = DRIVES[dialect.drive]["parameters"].items()
    number = next(pnu for pnu, one in known if one[1] == "text" and one[0].endswith(" type"))
    ask = Ask(parameter(number, TEXT_REGISTERS), has_text)
    asks = (ask,) if dialect.text_by_size else (done(TEXT_READS), ask, done(write_register(IND, 0)))
    return Row("FC-7", "a text is read", asks, "drive", (name,))


def state_row(name: str) -> Row:
    """By dialect: two bits of the status word have another meaning in an FC drive."""
    title = "0F writes coils 1-32 = 0, no command; coils 33-64 show the drive's state"
    status = Ask(read_coils(32, 32), functools.partial(has_status, dialect=name))
    return Row("FC-6", title, (done(write_coils(0, [False] * 32)), status), "drive", (name,))


ROWS: tuple[Row, ...] = (
    # With Modbus built in, a reading of coils 33-64 asks the drive first.
    Row("MAP-1", ALL_COILS, (Ask(read_coils(0, 128), has_128_coils),), "", CARD),
    Row("MAP-1", ALL_COILS, (Ask(read_coils(0, 128), has_128_coils),), "drive", BUILT_IN),
    # Functions, on what the card itself holds: no telegram goes to the drive.
    Row("MAP-2", "05 sets and clears coil 65", sets_and_clears(by_05)),
    Row("MAP-2", "0F sets and clears coil 65", sets_and_clears(lambda on: write_coils(EEPROM, [on]))),
    Row("MAP-5", "06 writes 40002, 03 reads it", kept(NETWORK_TIMEOUT, VALUES[0])),
    Row("MAP-5", "10 writes 40002 and 40003, 03 reads both", kept(NETWORK_TIMEOUT, *VALUES)),
    index_row(IND, CARD),
    index_row(INDEX, BUILT_IN),
    # Exceptions, in the order of their checks.
    refused("unknown function", bytes([UNKNOWN_FUNCTION]), "function"),
    refused("frame one byte too long", read_registers(DRIVE_TIMEOUT, 1) + b"\0", "length"),
    refused("129 coils", read_coils(0, 129), "quantity"),
    refused("0 registers", read_registers(DRIVE_TIMEOUT, 0), "quantity"),
    refused("byte count that does not match", WRONG_COUNT, "quantity", "EXC", coil_65(False)),
    refused("coils beyond 128", read_coils(100, 30), "address"),
    refused("write of coil 33, which is read-only", write_coil(32, False), "address", "MAP-2"),
    refused("reserved register 40004", read_registers(RESERVED, 1), "address"),
    refused("register 5141, where no parameter starts", read_registers(5140, 1), "address", "MAP-6"),
    refused("coil 65 = 1234h, neither on nor off", WRONG_COIL, "value", "EXC", coil_65(False)),
    refused("40003 = 0", write_register(DRIVE_TIMEOUT, 0), "value", "MAP-5"),
    # Silence. Each write sets coil 65, and the next ask reads whether it was carried out.
    Row(
        "FRAME-4",
        "a write with a wrong CRC: silence, and nothing is written",
        (Ask(write_coil(EEPROM, True), None, wrong_crc=True), coil_65(False)),
    ),
    Row("MAP-9", "a write to all: silence, and it is carried out", sets_and_clears(by_05, to_all=True)),
    Row("MAP-9", "a reading from all: silence", (Ask(read_coils(0, 8), None, to_all=True),)),
    Row(
        "FRAME-5",
        "a frame of 300 bytes: silence, and the next one is answered",
        (Ask(bytes([0x10]) + bytes(296), None), READ_40003),
    ),
    # Diagnostics. The counts are of the asks in this row, so a frame of somebody else's is a cross.
    diagnosed("08/0 returns its data", Ask(diagnostic(0, 0xA55A), diagnostic(0, 0xA55A))),
    diagnosed(
        "08/10 clears, 08/2 and 08/11-14 and 0B count exactly",
        Ask(diagnostic(10), diagnostic(10)),
        Ask(diagnostic(14), diagnostic(14, 1)),
        Ask(write_coil(EEPROM, True), None, wrong_crc=True),
        Ask(diagnostic(12), diagnostic(12, 1)),
        Ask(diagnostic(2), diagnostic(2, 1)),
        Ask(bytes([UNKNOWN_FUNCTION]), "function"),
        Ask(diagnostic(13), diagnostic(13, 1)),
        Ask(bytes([0x0B]), bytes.fromhex("0B 0000 0004")),
        Ask(diagnostic(11), diagnostic(11, 7)),
    ),
    diagnosed("08/99 is unknown", Ask(diagnostic(99), "function")),
    diagnosed("11 names the card and its version", Ask(bytes([0x11]), has_server_id)),
    diagnosed("2B/0E lists vendor, product, version", Ask(IDENTIFICATION, has_identification)),
    Row(
        "MAP-10",
        "08, 0B, 11 and 2B/0E are unknown in this dialect",
        tuple(Ask(pdu, "function") for pdu in (diagnostic(0), b"\x0b", b"\x11", IDENTIFICATION)),
        "",
        NOT_DIAGNOSED,
    ),
    # The drive.
    Row("FC-9", "exception 255 to a reading without a drive", (Ask(READ_LANGUAGE, 255),), "no drive", CARD),
    Row("FC-9", "silence to a reading without a drive", (Ask(READ_LANGUAGE, None),), "no drive", BUILT_IN),
    Row("SAFE-3", "a local request after it is answered", (READ_40003,), "no drive"),
    Row("MAP-7", "parameter 1 is read", (Ask(parameter(LANGUAGE, 2), has_language),), "drive"),
    refused("parameter 2047, in no drive, is refused", parameter(NO_PARAMETER, 1), 0, needs="drive"),
    *(text_row(*one) for one in DIALECTS.items()),
    Row(
        "FC-4",
        "parameter 1 is written with the value that it has",
        (
            Ask(READ_LANGUAGE, has_language),
            Ask(lambda reply: write_register(10 * LANGUAGE - 1, words(reply)[0]), echo),
        ),
        "drive",
    ),
    *map(state_row, DIALECTS),
)


def refusal(function: int, why: str | int, dialect: str) -> bytes:
    """The exception's PDU in a dialect; a number is what the drive says."""
    return exception(function, DIALECTS[dialect].code(why))
