# SPDX-License-Identifier: Apache-2.0
"""Shared code for tests of the simulated drive: its table, a master's requests.

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
