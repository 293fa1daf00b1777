# SPDX-License-Identifier: Apache-2.0
"""Modbus RTU frames in the card's terms: coils, registers and parameters (MAP-1 to MAP-9), exceptions."""

from __future__ import annotations

from . import fc
from .dialects import meaning
from .drives import DRIVES
from .rtu import EXCEPTION_BIT as EXCEPTION
from .rtu import READ_COILS, READ_REGISTERS, WRITE_COIL, WRITE_COILS, WRITE_REGISTER, WRITE_REGISTERS

EXCEPTION_BYTES, HEAD = 5, 6
LOCAL_REGISTERS = 9  # 40001-40009, in use or reserved
ITEMS = {1: 8, 2: 8, 3: 0.5, 4: 0.5}  # function: values that one byte of its reply holds
COILS = {(0, 16): "control word", (16, 16): "reference", (32, 16): "status word"}
COILS |= {(48, 16): "output frequency", (64, 1): "write to EEPROM"}


def is_reply(request: bytes, data: bytes) -> bool:
    """Whether a good frame fits the one before it as its reply. No slave can know it for certain."""
    code = request[1]
    if data[0] != request[0]:
        return False
    if data[1] == code | EXCEPTION and not code & EXCEPTION:
        return len(data) == EXCEPTION_BYTES
    if data[1] != code:
        return False
    if code in ITEMS and len(request) == 8:
        size = -(-int.from_bytes(request[4:6], "big") // ITEMS[code])
        return data[2] == size and len(data) == size + EXCEPTION_BYTES
    if code in (WRITE_COILS, WRITE_REGISTERS):
        return len(data) == HEAD + 2 < len(request) and data[:HEAD] == request[:HEAD]
    return code in (WRITE_COIL, WRITE_REGISTER) and data == request


class Words:
    """The frames of one line, one after the other: a reply is named by its request."""

    def __init__(self, drive: str, dialect: str) -> None:
        self.drive, self.dialect = DRIVES[drive], dialect
        self.request = b""

    def said(self, frame: bytes, reply: bool | None = None) -> tuple[bool, str]:
        """Whether a good frame is a reply, and its words. `reply`: known by its wire."""
        if reply is None:
            reply = bool(self.request) and is_reply(self.request, frame)
        unit = f"unit {frame[0]}: " if frame[0] else "to all: "
        if reply:
            return True, unit + self._replied(frame)
        self.request = frame
        return False, unit + self._asked(frame)

    def _asked(self, frame: bytes) -> str:
        if len(frame) < 8:
            return f"function {frame[1]:02X}h, {len(frame)} bytes"
        code, at, count = frame[1], fc.word_of(frame[2:4]), fc.word_of(frame[4:6])
        if code in (READ_COILS, READ_REGISTERS):
            return "read " + self._place(code, at, count)
        if code == WRITE_COIL:
            state = {0xFF00: "on", 0: "off"}.get(count, f"{count:04X}h")
            return f"write {self._place(READ_COILS, at, 1)} = {state}"
        if code == WRITE_REGISTER:
            return f"write {self._place(code, at, 1)} = {self._values(code, frame[4:6], at, 1)}"
        if code in (WRITE_COILS, WRITE_REGISTERS):
            kind = READ_COILS if code == WRITE_COILS else READ_REGISTERS
            return f"write {self._place(kind, at, count)} = {self._values(kind, frame[7:-2], at, count)}"
        return f"function {code:02X}h"

    def _replied(self, frame: bytes) -> str:
        code, asked = frame[1], self.request
        known = len(asked) >= 8 and asked[1] == code & ~EXCEPTION
        at, count = (fc.word_of(asked[2:4]), fc.word_of(asked[4:6])) if known else (0, 0)
        if code & EXCEPTION:
            of_drive = known and code & ~EXCEPTION in (3, 6, 16) and at >= LOCAL_REGISTERS
            return f"exception {frame[2]}: {meaning(frame[2], self.dialect, of_drive)}"
        if known and code in (READ_COILS, READ_REGISTERS):
            return f"{self._place(code, at, count)} = {self._values(code, frame[3:-2], at, count)}"
        writes = (WRITE_COIL, WRITE_REGISTER, WRITE_COILS, WRITE_REGISTERS)
        return "write done" if known and code in writes else f"reply to function {code:02X}h"

    def _place(self, code: int, at: int, count: int) -> str:
        """Registers by their address: 40001-40009 by number, others by parameter (PNU x 10 - 1).

        Too many registers for a number are counted: a master that merges reads.
        """
        if code == READ_COILS:
            name = COILS.get((at, count))
            return span("coil", at + 1, count) + (f" ({name})" if name else "")
        if at < LOCAL_REGISTERS:
            return span("register", 40001 + at, count)
        pnu, rest = divmod(at + 1, 10)
        if rest:
            return span("register", 40001 + at, count) + " (no parameter starts there)"
        known = self.drive["parameters"].get(pnu, ("", ""))
        many = count > 2 and known[1] != "text"
        return f"parameter {pnu}" + f" ({known[0]})" * bool(known[0]) + f", {count} registers" * many

    def _values(self, code: int, data: bytes, at: int, count: int) -> str:
        if code == READ_COILS:
            if count == 1:
                return "on" if data[:1] != b"\0" else "off"
            parts = [data[i : i + 2] for i in range(0, len(data), 2)]
            return " ".join(f"{int.from_bytes(part, 'little'):0{2 * len(part)}X}h" for part in parts)
        pnu, rest = divmod(at + 1, 10)
        if at < LOCAL_REGISTERS or rest:
            return " ".join(f"{fc.word_of(data[i : i + 2]):04X}h" for i in range(0, len(data), 2))
        if count > 2 or self.drive["parameters"].get(pnu, ("", ""))[1] == "text":
            return f"'{fc.latin1(data)}'"
        return fc.scaled(self.drive, pnu, fc.word_of(data))


def span(what: str, first: int, count: int) -> str:
    return f"{what} {first}" if count == 1 else f"{what}s {first}-{first + count - 1}"
