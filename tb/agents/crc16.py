# SPDX-License-Identifier: Apache-2.0
"""CRC-16/MODBUS (FRAME-4): reflected polynomial A001h, start value FFFFh, low byte sent first."""

CHECK_INPUT = b"123456789"
CHECK_VALUE = 0x4B37


def crc16_step(crc: int, byte: int) -> int:
    """The CRC register after one more byte."""
    crc ^= byte
    for _ in range(8):
        crc = (crc >> 1) ^ (0xA001 if crc & 1 else 0)
    return crc


def crc16(data: bytes) -> int:
    """The CRC over `data`; 0 when `data` ends with its own CRC, low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc = crc16_step(crc, byte)
    return crc


def with_crc(data: bytes) -> bytes:
    """`data` and its CRC, as an ADU goes onto the line."""
    return bytes(data) + crc16(data).to_bytes(2, "little")


def crc_good(adu: bytes) -> bool:
    """True if `adu` has at least an address, a function code and a CRC, and the CRC is right."""
    return len(adu) >= 4 and crc16(adu) == 0
