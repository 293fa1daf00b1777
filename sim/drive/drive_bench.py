# SPDX-License-Identifier: Apache-2.0
"""Shared code for tests of the simulated drive: its table, a master's requests, a second opinion.

The tables are parsed here independently: the drive's C code and the table tool are compared with a reader
that shares only the CSV files with them. No cocotb inside.
"""

from __future__ import annotations

import csv
import functools
import re

from tb.model import fc_telegram as fc
from tb.model.vlt_drive import PROFILE_FOLDER, VltDrive

Row = dict[str, str]

START = 0x047C
RAMP_STOP = 0x043C
COAST = 0x0474
QUICK_STOP = 0x046C
DC_BRAKE = 0x0478
FREEZE = 0x045C
JOG = 0x057C
RESET = 0x0080
RAMP_2 = 0x0200
RELAY_1 = 0x0800
RELAY_2 = 0x1000
REVERSE = 0x8000

FULL_SPEED = 0x4000
SECOND = 1_000_000

NUMBERS = {"uint8": False, "int16": False, "uint16": False, "int32": True, "uint32": True}
ACCESS_FAULT = {"ro": 1, "local": 130, "fixed": 7, "denied": 11}


@functools.cache
def table(profile: str) -> tuple[Row, ...]:
    """The parameters of a profile, from the CSV file."""
    lines = (PROFILE_FOLDER / f"{profile}.csv").read_text().splitlines()
    return tuple(csv.DictReader(line for line in lines if not line.startswith("#")))


@functools.cache
def setting(profile: str, key: str, default: int) -> int:
    """A `#: key = number` line of a profile."""
    text = (PROFILE_FOLDER / f"{profile}.csv").read_text()
    match = re.search(rf"^#: {key} = (\w+)$", text, re.MULTILINE)
    return int(match[1], 0) if match else default


def first_index(profile: str, row: Row) -> int:
    """Index of the first value: arrays count from 1 or 0, other parameters have index 0."""
    return setting(profile, "index_first", 1) if row["array"] != "0" else 0


def by_role(profile: str, role: str) -> int:
    """Number of the parameter with this role."""
    (row,) = (row for row in table(profile) if row["role"] == role)
    return int(row["pnu"])


def is_double(row: Row) -> bool:
    return NUMBERS[row["type"]]


def write_command(row: Row) -> int:
    return fc.AK_WRITE_DOUBLE if is_double(row) else fc.AK_WRITE_WORD


def ask(drive: VltDrive, ak: int, pnu: int, pwe: int = 0, ind: int = 0) -> fc.Telegram:
    """Sends a parameter telegram without a process command; returns the reply."""
    reply = drive.telegram(fc.build_parameter(ak, pnu, ind, pwe))
    assert reply is not None
    return fc.parse(reply, reply=True)


def write_text(drive: VltDrive, pnu: int, text: bytes) -> fc.Telegram:
    return fc.parse(drive.telegram(fc.build_text(pnu, text)), reply=True)


def read_text(drive: VltDrive, pnu: int) -> bytes:
    """Reads a text over the bus; only LGE gives its length."""
    reply = drive.telegram(fc.build_text_read(pnu))
    parts = fc.parse(reply, reply=True)
    assert (parts.ak, parts.pnu, parts.ind) == (fc.AK_TEXT, pnu, 0x0400)
    assert reply[1] == 10 + len(parts.text)
    return parts.text


def control(drive: VltDrive, word: int, reference: int = 0) -> tuple[int, int]:
    """Sends a process telegram; returns status word and output frequency word of the reply."""
    reply = drive.telegram(fc.build_process(word, reference))
    assert reply is not None
    parts = fc.parse(reply, reply=True)
    assert parts.kind == "process"
    return parts.pcd1, parts.pcd2


def hertz(drive: VltDrive) -> float:
    return drive.frequency_mhz / 1000


def brought_to(frequency_hz: float, profile: str = "vlt6000") -> VltDrive:
    """A drive that has ramped up to `frequency_hz` (at most 50 Hz)."""
    drive = VltDrive(profile)
    control(drive, START, round(frequency_hz / 50 * FULL_SPEED))
    drive.step(10 * SECOND)
    assert abs(hertz(drive) - frequency_hz) < 0.01
    return drive


class Expected:
    """Python copy of the table: the second opinion on reads and writes of a stopped drive."""

    def __init__(self, profile: str):
        rows = table(profile)
        self.rows = {int(row["pnu"]): row for row in rows}
        self.written: dict[tuple[int, int], int] = {}  # by number and index
        self.texts = {pnu: row["default"].encode() for pnu, row in self.rows.items() if row["type"] == "text"}
        self.setup = by_role(profile, "active_setup")
        self.first = setting(profile, "index_first", 1)
        self.unknown_ak = setting(profile, "fault_unknown_ak", 130)

    def value(self, pnu: int, index: int = 0) -> int:
        return self.written.get((pnu, index), int(self.rows[pnu]["default"]))

    def reply(self, ak: int, pnu: int, ind: int, pwe: int, text: bytes) -> tuple[int, int | bytes]:
        """(AK, PWE or characters) of the expected answer."""
        row = self.rows.get(pnu)
        if ak == fc.AK_NONE:
            return 0, 0
        if row is None:
            return 7, 0
        if ak not in (1, 2, 3, 13, 14, 15):
            return 7, self.unknown_ak
        if (ak == 15) != (row["type"] == "text"):
            return 7, 5
        index, length = ind & 0xFF, int(row["array"])
        if length == 0 and index:
            return 7, 4
        if length and not self.first <= index < self.first + length:
            return 7, 3
        if ak == 15:
            return self.text_reply(row, pnu, ind >> 8, text)
        double = is_double(row)
        if ak != 1:
            fault = self.write(row, pnu, index, ak, pwe)
            if fault is not None:
                return 7, fault
        return (2 if double else 1), self.value(pnu, index) & (0xFFFFFFFF if double else 0xFFFF)

    def text_reply(self, row: Row, pnu: int, how: int, text: bytes) -> tuple[int, int | bytes]:
        if how == 5:
            if row["access"] == "ro":
                return 7, 1
            if self.value(self.setup) == 0:
                return 7, 131
            if len(text) > int(row["max"]):
                return 7, 2
            self.texts[pnu] = text
        elif how != 4:
            return 7, 3
        return 15, self.texts[pnu]

    def write(self, row: Row, pnu: int, index: int, ak: int, pwe: int) -> int | None:
        """Fault number, or None if the value is accepted."""
        double = is_double(row)
        if row["access"] in ACCESS_FAULT:
            return ACCESS_FAULT[row["access"]]
        if double != (ak in (3, 13)):
            return 5
        if self.value(self.setup) == 0 and pnu != self.setup:
            return 131
        width = 32 if double else 16
        value = pwe & ((1 << width) - 1)
        if row["type"].startswith("int") and value >> (width - 1):
            value -= 1 << width
        if row["access"] == "reset" and value:
            return 6
        if not int(row["min"]) <= value <= int(row["max"]):
            return 2
        self.written[pnu, index] = value
        return None
