# SPDX-License-Identifier: Apache-2.0
"""Modbus RTU in plain Python: ADUs, PDUs of the six functions, and the times of FRAME-1.

Times are in picoseconds (ps), as in the simulators. Addresses are on-wire (0-based).
"""

from __future__ import annotations

from dataclasses import dataclass

from .crc16 import crc_good, with_crc

PS_PER_S = 1_000_000_000_000
CHARACTER_BITS = 11
READ_COILS, READ_REGISTERS, WRITE_COIL, WRITE_REGISTER = 0x01, 0x03, 0x05, 0x06
WRITE_COILS, WRITE_REGISTERS = 0x0F, 0x10
EXCEPTION_BIT = 0x80


def bit_ps(baud: int) -> float:
    """Length of one bit."""
    return PS_PER_S / baud


def t15_ps(baud: int, character_bits: int = CHARACTER_BITS) -> float:
    """Longest silence inside a frame: 1.5 characters, 750 us above 19200 baud (FRAME-1)."""
    return 750e6 if baud > 19200 else 1.5 * character_bits * bit_ps(baud)


def t35_ps(baud: int, character_bits: int = CHARACTER_BITS) -> float:
    """Shortest silence between frames: 3.5 characters, 1750 us above 19200 baud (FRAME-1)."""
    return 1750e6 if baud > 19200 else 3.5 * character_bits * bit_ps(baud)


@dataclass(frozen=True)
class Adu:
    """Address and PDU of a frame."""

    address: int
    pdu: bytes

    @property
    def function(self) -> int:
        return self.pdu[0]

    @property
    def is_exception(self) -> bool:
        return bool(self.pdu[0] & EXCEPTION_BIT)

    @property
    def exception_code(self) -> int | None:
        return self.pdu[1] if self.is_exception else None


def build(address: int, pdu: bytes) -> bytes:
    """Address, PDU and CRC."""
    return with_crc(bytes([address]) + bytes(pdu))


def parse(adu: bytes) -> Adu:
    """Parses an ADU; ValueError if its CRC is wrong or it is too short."""
    if not crc_good(adu):
        raise ValueError(f"no good CRC in {adu.hex(' ')}")
    return Adu(adu[0], bytes(adu[1:-2]))


def _words(*values: int) -> bytes:
    return b"".join((value & 0xFFFF).to_bytes(2, "big") for value in values)


def read_coils(start: int, count: int) -> bytes:
    return bytes([READ_COILS]) + _words(start, count)


def read_registers(start: int, count: int) -> bytes:
    return bytes([READ_REGISTERS]) + _words(start, count)


def write_coil(coil: int, on: bool) -> bytes:
    return bytes([WRITE_COIL]) + _words(coil, 0xFF00 if on else 0)


def write_register(register: int, value: int) -> bytes:
    return bytes([WRITE_REGISTER]) + _words(register, value)


def write_coils(start: int, bits: list[bool]) -> bytes:
    """Coils from `start` on; the first coil is bit 0 of the first byte."""
    packed = sum(bool(bit) << i for i, bit in enumerate(bits))
    size = (len(bits) + 7) // 8
    return bytes([WRITE_COILS]) + _words(start, len(bits)) + bytes([size]) + packed.to_bytes(size, "little")


def write_registers(start: int, values: list[int]) -> bytes:
    data = _words(*values)
    return bytes([WRITE_REGISTERS]) + _words(start, len(values)) + bytes([len(data)]) + data


def exception(function: int, code: int) -> bytes:
    return bytes([function | EXCEPTION_BIT, code])
