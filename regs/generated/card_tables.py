# SPDX-License-Identifier: Apache-2.0
# Generated from regs/card.toml by `make regs`; edit that file, not this one.
"""Rates, formats, silences by switches, first switch first, 1 = ON (LINE-2, LINE-3, FRAME-1).

RATES, FORMATS: positions of the old card. EXTENDED_...: of a card with EXTENDED_SWITCHES = 1.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Rate:
    """baud in bit/s; ratio in base ticks per tick; mask of baud_divider, 0 for ratio 1."""

    baud: int
    ratio: int
    mask: int


@dataclass(frozen=True)
class Format:
    """character_bits: length of a character time."""

    parity: str
    stop_bits: int
    character_bits: int


@dataclass(frozen=True)
class Silences:
    """In ticks of 1/16 bit; half: half a character of FRAME-1.

    half_uneven: the second, fourth ... half is a tick shorter.
    """

    t15_ticks: int
    t35_ticks: int
    half_ticks: int
    half_uneven: bool


BASE_HZ = 1843200
TICKS_PER_BIT = 16
CHARACTER_BITS = 11
DRIVE_BAUD = 9600
DRIVE_FORMAT = Format("even", 1, 11)
DRIVE_PAUSE_TICKS = 352
SILENCE_START = 18

# switches 1, 2, 3
RATES = {
    "000": Rate(300, 384, 127),
    "001": Rate(1200, 96, 31),
    "010": Rate(2400, 48, 15),
    "011": Rate(4800, 24, 7),
    "100": Rate(9600, 12, 3),
    "110": Rate(9600, 12, 3),
    "111": Rate(9600, 12, 3),
    "101": Rate(19200, 6, 1),
}

# switches 1, 2, 3
EXTENDED_RATES = {
    "000": Rate(300, 384, 127),
    "001": Rate(1200, 96, 31),
    "010": Rate(2400, 48, 15),
    "011": Rate(4800, 24, 7),
    "111": Rate(9600, 12, 3),
    "101": Rate(19200, 6, 1),
    "100": Rate(38400, 3, 0),
    "110": Rate(115200, 1, 0),
}

# switches 4, 5
FORMATS = {
    "00": Format("even", 1, 11),
    "10": Format("none", 2, 11),
    "01": Format("odd", 1, 11),
    "11": Format("none", 2, 11),
}

# switches 4, 5
EXTENDED_FORMATS = {
    "00": Format("even", 1, 11),
    "10": Format("none", 1, 10),
    "01": Format("odd", 1, 11),
    "11": Format("none", 2, 11),
}

# bit/s, bits of a character time
SILENCES = {
    (300, 10): Silences(240, 560, 80, False),
    (300, 11): Silences(264, 616, 88, False),
    (1200, 10): Silences(240, 560, 80, False),
    (1200, 11): Silences(264, 616, 88, False),
    (2400, 10): Silences(240, 560, 80, False),
    (2400, 11): Silences(264, 616, 88, False),
    (4800, 10): Silences(240, 560, 80, False),
    (4800, 11): Silences(264, 616, 88, False),
    (9600, 10): Silences(240, 560, 80, False),
    (9600, 11): Silences(264, 616, 88, False),
    (19200, 10): Silences(240, 560, 80, False),
    (19200, 11): Silences(264, 616, 88, False),
    (38400, 10): Silences(461, 1076, 154, True),
    (38400, 11): Silences(461, 1076, 154, True),
    (115200, 10): Silences(1383, 3226, 461, True),
    (115200, 11): Silences(1383, 3226, 461, True),
}
