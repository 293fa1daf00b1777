# SPDX-License-Identifier: Apache-2.0
"""What the documents say, typed from them with its page: a second witness for each table of regs/.

Pages are those of the card's manual, 23-6130-00, unless another document is named. The LEDs and pins of the
boards are in constraints/test_boards.py.
"""

from __future__ import annotations

import re
import tomllib

import pytest

from regs.dialects import DIALECTS
from regs.generated import card_tables
from sw.rtu2fc.drives import DRIVES
from sw.rtu2fc.fc import scaled
from tb.lib.runner import ROOT
from tools.handbook import rows

# Names of the bits 0 to 15, by the manuals of the card (23-6130-00 p17) and of the drives. Where the kinds of
# drive differ a bit has two names.
CONTROL = """Preset reference LSB, Preset reference MSB, DC brake, Coast stop, Quick stop, Freeze frequency,
Ramp stop / start, Reset, Jog, No function / Ramp, Data valid, Relay 1, Relay 2, Setup LSB, Setup MSB,
Reversing"""
STATUS = """Control ready, Drive ready, Stand by / Coasting, Trip, Not in use, Not in use,
Not in use / Trip lock, Warning, Speed = reference, Serial control, Frequency in range, Running, No function,
Voltage warning, Current limit, Thermal warning"""

# p23, and below it the numbers that MG.10.S2.02 p31 adds.
FAULTS = {
    **{0: "parameter does not exist", 1: "no write access", 2: "value exceeds limits"},
    **{3: "sub-index does not exist", 4: "parameter is no array", 5: "data type does not match"},
    **{17: "not possible in the present mode", 130: "no bus access", 131: "factory setup selected"},
    **{6: "can only be reset", 7: "cannot be changed", 11: "no right to write"},
    18: "other fault of the drive",
}
# Function, length, quantity, address and value; the drive's refusal and silence, 0 if they have no code.
EXCEPTIONS = [
    "67 65 66 64 2 0 255",  # p23
    "67 65 66 64 66 0 0",  # MG.10.S2.02 p31
    "1 3 3 2 3 4 0",  # MG.18.C2.02: those of the Modbus standard
]
# p17: conversion index and factor.
FACTORS = {74: "3.6", 2: "100.0", 1: "10.0", 0: "1.0", -1: "0.1", -2: "0.01", -3: "0.001", -4: "0.0001"}
# Parameters of the VLT 6000 and their index: p17, p21.
INDICES = {201: -1, 514: -2, 104: 0}


@pytest.mark.parametrize(
    ("word", "manual", "prefix"), [("control", CONTROL, "CTW"), ("status", STATUS, "STW")]
)
def test_words_of_the_fc_protocol_are_those_of_the_manuals(word, manual, prefix):
    """Each bit of regs/fc.toml; the simulated drive, written by hand, has its bits in the same places."""
    bits = tomllib.loads((ROOT / "regs/fc.toml").read_text())[word]
    named = [" / ".join(entry["name"] for entry in bits.values() if entry["bit"] == bit) for bit in range(16)]
    assert ", ".join(named) == manual.replace("\n", " ")
    drive = re.findall(rf"{prefix}_(\w+) = 1 << (\d+)", (ROOT / "sim/drive/vlt_drive.c").read_text())
    for name, bit in drive:
        assert bits[name.lower().removeprefix("no_").removesuffix("_2")]["bit"] == int(bit), name
    assert len(drive) > 8


def test_faults_of_the_drive_are_those_of_the_manuals():
    found = tomllib.loads((ROOT / "regs/fc.toml").read_text())["fault"]
    assert {int(number): text for number, text in found.items()} == FAULTS


@pytest.mark.rule("EXC")
def test_exception_codes_are_those_of_the_manuals():
    names = ("function", "length", "quantity", "address", "value")
    traits = [*(f"bad_{name}" for name in names), "drive_fault", "drive_silent"]
    found = [" ".join(str(one.traits[name]) for name in traits) for one in DIALECTS.values()]
    assert found[: len(EXCEPTIONS)] == EXCEPTIONS


def test_conversion_indices_are_those_of_the_manual():
    """In the handbook, in the command rtu2fc, and in the table of the manual's drive."""
    listed = rows("registers-and-parameters", "index")
    assert {int(row["index"].replace("\N{MINUS SIGN}", "-")): row["factor"] for row in listed} == FACTORS
    for index, factor in FACTORS.items():
        if index != 74:
            drive = {"parameters": {1: ("", "uint32", index, "")}}
            assert float(scaled(drive, 1, 300)) == pytest.approx(300 * float(factor))
    assert {pnu: DRIVES["vlt6000"]["parameters"][pnu][2] for pnu in INDICES} == INDICES


@pytest.mark.rule("LINE-2", "LINE-4")
def test_rates_of_the_manual_and_exact_division():
    """p7: the rates of LINE-2 by switch pattern; each divides the base exactly (LINE-4)."""
    manual = {"000": 300, "001": 1200, "010": 2400, "011": 4800, "111": 9600, "101": 19200}
    for table, more in (
        (card_tables.RATES, {"100": 9600, "110": 9600}),
        (card_tables.EXTENDED_RATES, {"100": 38400, "110": 115200}),
    ):
        assert {pattern: rate.baud for pattern, rate in table.items()} == manual | more
    for rate in card_tables.EXTENDED_RATES.values():
        assert rate.ratio * rate.baud * card_tables.TICKS_PER_BIT == card_tables.BASE_HZ
        assert rate.ratio in (1, 3 * (rate.mask + 1))
        assert rate.mask < 1 << 7


@pytest.mark.rule("LINE-3")
def test_formats_of_the_manual():
    """p7, and 11 bits in each of them."""
    manual = {"11": ("none", 2, 11), "01": ("odd", 1, 11), "00": ("even", 1, 11)}
    for table, more in (
        (card_tables.FORMATS, ("none", 2, 11)),
        (card_tables.EXTENDED_FORMATS, ("none", 1, 10)),
    ):
        found = {pattern: (f.parity, f.stop_bits, f.character_bits) for pattern, f in table.items()}
        assert found == manual | {"10": more}


@pytest.mark.rule("FC-1", "FC-8")
def test_drive_line_is_9600_8e1_with_a_pause_of_two_characters():
    assert (9600, card_tables.Format("even", 1, 11)) == (card_tables.DRIVE_BAUD, card_tables.DRIVE_FORMAT)
    assert card_tables.DRIVE_PAUSE_TICKS == 22 * 16
