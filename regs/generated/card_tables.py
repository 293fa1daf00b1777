# SPDX-License-Identifier: Apache-2.0
# Generated from regs/card.toml by `make regs`; edit that file, not this one.
"""Rates, formats, silences by switches, first switch first, 1 = ON (LINE-2, LINE-3, FRAME-1)."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Rate:
    """baud in bit/s; ratio in base ticks per tick; t15, t35, half: in ticks of 1/16 bit.

    mask: count mask of baud_divider for the ratio; 0 for ratio 1.
    half_ticks: half a character of FRAME-1.
    half_uneven: the second, fourth ... half is a tick shorter.
    """

    baud: int
    ratio: int
    mask: int
    t15_ticks: int
    t35_ticks: int
    half_ticks: int
    half_uneven: bool


@dataclass(frozen=True)
class Format:
    parity: str
    stop_bits: int


BASE_HZ = 1843200
TICKS_PER_BIT = 16
CHARACTER_BITS = 11
DRIVE_BAUD = 9600
DRIVE_FORMAT = Format("even", 1)
DRIVE_PAUSE_TICKS = 352
SILENCE_START = 18

# switches 1, 2, 3
RATES = {
    "000": Rate(300, 384, 127, 264, 616, 88, False),
    "001": Rate(1200, 96, 31, 264, 616, 88, False),
    "010": Rate(2400, 48, 15, 264, 616, 88, False),
    "011": Rate(4800, 24, 7, 264, 616, 88, False),
    "111": Rate(9600, 12, 3, 264, 616, 88, False),
    "101": Rate(19200, 6, 1, 264, 616, 88, False),
    "100": Rate(38400, 3, 0, 461, 1076, 154, True),
    "110": Rate(115200, 1, 0, 1383, 3226, 461, True),
}

# switches 4, 5
FORMATS = {
    "00": Format("even", 1),
    "10": Format("none", 1),
    "01": Format("odd", 1),
    "11": Format("none", 2),
}
