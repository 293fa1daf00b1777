# SPDX-License-Identifier: Apache-2.0
# Generated from regs/mailbox.rdl by `make regs`; edit that file, not this one.
"""The mailbox map: byte offsets from BASE, field positions, frame-memory indices."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Field:
    """One field; reset is None where it shows switches or build parameters."""

    bit: int
    width: int
    access: str
    reset: int | None

    def get(self, word: int) -> int:
        """The field's value inside a register word."""
        return (word >> self.bit) & ((1 << self.width) - 1)

    def put(self, value: int) -> int:
        """A register word with this field set and all others 0."""
        assert 0 <= value < 1 << self.width
        return value << self.bit


@dataclass(frozen=True)
class Register:
    offset: int
    fields: dict[str, Field]

    def unpack(self, word: int) -> dict[str, int]:
        return {name: field.get(word) for name, field in self.fields.items()}

    def pack(self, **values: int) -> int:
        return sum(self.fields[name].put(value) for name, value in values.items())


@dataclass(frozen=True)
class Area:
    """A part of the frame memory: `index` in bytes of the memory, one byte a word."""

    offset: int
    index: int
    length: int


BASE = 0xFFFFF800
FRAME_MEMORY = 0x400

REGISTERS = {
    "ID": Register(
        0x00,
        {
            "id": Field(0, 16, "ro", 0x2FC1),
        },
    ),
    "VERSION": Register(
        0x04,
        {
            "minor": Field(0, 8, "ro", 0x0),
            "major": Field(8, 8, "ro", 0x1),
        },
    ),
    "BUILD": Register(
        0x08,
        {
            "strict_t15": Field(0, 1, "ro", None),
            "prepare_early": Field(1, 1, "ro", None),
            "soft_core": Field(2, 2, "ro", None),
            "clk_mhz": Field(8, 8, "ro", None),
        },
    ),
    "SW_BAUD": Register(
        0x0C,
        {
            "switches": Field(0, 9, "ro", None),
        },
    ),
    "SW_ADDR": Register(
        0x10,
        {
            "switches": Field(0, 8, "ro", None),
        },
    ),
    "TIME": Register(
        0x14,
        {
            "ms": Field(0, 16, "ro", 0x0),
        },
    ),
    "LED": Register(
        0x18,
        {
            "modbus_red": Field(0, 1, "rw", 0x0),
            "modbus_green": Field(1, 1, "rw", 0x0),
            "drive_red": Field(2, 1, "rw", 0x0),
            "drive_green": Field(3, 1, "rw", 0x0),
        },
    ),
    "WATCHDOG": Register(
        0x1C,
        {
            "key": Field(0, 8, "wo", 0xA5),
        },
    ),
    "REQUEST": Register(
        0x20,
        {
            "ticket": Field(0, 4, "ro", 0x0),
            "candidate": Field(4, 1, "ro", 0x0),
            "committed": Field(5, 1, "ro", 0x0),
            "broadcast": Field(6, 1, "ro", 0x0),
            "bank": Field(7, 1, "ro", 0x0),
        },
    ),
    "REQUEST_LENGTH": Register(
        0x24,
        {
            "bytes": Field(0, 9, "ro", 0x0),
        },
    ),
    "REPLY": Register(
        0x28,
        {
            "length": Field(0, 5, "wo", None),
            "after_drive": Field(5, 1, "wo", None),
            "ticket": Field(8, 4, "wo", None),
            "queued": Field(12, 1, "ro", 0x0),
            "sending": Field(13, 1, "ro", 0x0),
        },
    ),
    "TELEGRAM": Register(
        0x2C,
        {
            "length": Field(0, 5, "wo", None),
            "no_reply": Field(5, 1, "wo", None),
            "repeat": Field(6, 1, "wo", None),
            "ticket": Field(8, 4, "wo", None),
        },
    ),
    "EXCHANGE": Register(
        0x30,
        {
            "queued": Field(0, 1, "ro", 0x0),
            "sending": Field(1, 1, "ro", 0x0),
            "started": Field(2, 1, "ro", 0x0),
            "listening": Field(3, 1, "ro", 0x0),
            "candidate": Field(4, 1, "ro", 0x0),
            "good": Field(5, 1, "ro", 0x0),
            "lge": Field(8, 8, "ro", 0x0),
        },
    ),
    "LISTEN": Register(
        0x34,
        {
            "on": Field(0, 1, "wo", None),
        },
    ),
    "SUPERVISOR": Register(
        0x38,
        {
            "halt": Field(0, 1, "rw", None),
            "loopback": Field(1, 1, "rw", None),
            "bites": Field(4, 2, "ro", None),
        },
    ),
}

AREAS = {
    "REQUEST_FRAME_0": Area(0x400, 0x00, 32),
    "REQUEST_FRAME_1": Area(0x480, 0x20, 32),
    "REPLY_FRAME": Area(0x500, 0x40, 32),
    "TELEGRAM_FRAME": Area(0x580, 0x60, 32),
    "DRIVE_FRAME": Area(0x600, 0x80, 32),
    "COUNT_CRC": Area(0x680, 0xA0, 2),
    "COUNT_PARITY": Area(0x688, 0xA2, 2),
    "COUNT_FRAMING": Area(0x690, 0xA4, 2),
    "COUNT_T15": Area(0x698, 0xA6, 2),
    "COUNT_OVERRUN": Area(0x6A0, 0xA8, 2),
    "COUNT_REVOKED": Area(0x6A8, 0xAA, 2),
    "COUNT_DRIVE_BAD": Area(0x6B0, 0xAC, 2),
    "COUNT_DRIVE_NO_REPLY": Area(0x6B8, 0xAE, 2),
    "COUNT_DRIVE_REPEAT": Area(0x6C0, 0xB0, 2),
}
