#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Turn the parameter table of a simulated drive (sim/drive/NAME.csv) into a C header.

    tools/drive_table.py sim/drive/vlt6000.csv build/sim/vlt6000_table.h

The header holds one `static const drive_profile_t drive_profile_NAME` and is included by
sim/drive/vlt_drive.c alone. Every malformed row is told as `file:line: message`; exit 1 after them.

A profile is a CSV file: `#` lines are comments, `#: key = value` lines are settings (pnu_bits,
relay_running, relay_alarm, relay_bus), the first other line names the columns. Values are raw. Roles,
types and capacities are read from sim/drive/vlt_drive.h, so they are written in one place.
"""

from __future__ import annotations

import argparse
import csv
import re
import sys
from dataclasses import dataclass
from pathlib import Path

HEADER = Path(__file__).resolve().parent.parent / "sim" / "drive" / "vlt_drive.h"
COLUMNS = [
    *("pnu", "name", "type", "conversion", "min", "max", "default"),
    *("array", "access", "while_running", "unit", "role"),
]
SETTINGS = {"pnu_bits": (11, 12), "relay_running": (0, 255), "relay_alarm": (0, 255), "relay_bus": (0, 255)}
RANGES = {
    "uint8": (0, 0xFF),
    "int16": (-0x8000, 0x7FFF),
    "uint16": (0, 0xFFFF),
    "int32": (-0x80000000, 0x7FFFFFFF),
    "uint32": (0, 0xFFFFFFFF),
}
ACCESS = {"rw": "DRIVE_READ_WRITE", "ro": "DRIVE_READ_ONLY", "local": "DRIVE_LOCAL"}
CONVERSIONS = [*range(-4, 4), 74]
ROLE_NONE = 0xFFFF


class TableError(ValueError):
    """A row that cannot be used; the text says why."""


@dataclass
class Parameter:
    """One row, numbers raw."""

    pnu: int
    name: str
    type: str
    conversion: int
    min: int
    max: int
    initial: int
    text: str
    array: int
    access: str
    while_running: bool
    unit: str
    role: str
    slot: int = 0


@dataclass
class Capacity:
    """What sim/drive/vlt_drive.h has room for."""

    parameters: int
    slots: int
    texts: int
    text_max: int
    roles: list[str]


def read_capacity(header: Path = HEADER) -> Capacity:
    """Roles and array sizes out of the C header."""
    source = header.read_text()

    def number(name: str) -> int:
        return int(re.search(rf"#define {name} (\d+)", source).group(1))

    roles = re.findall(r"^  DRIVE_ROLE_(\w+)", source, re.MULTILINE)
    return Capacity(
        number("DRIVE_PARAMETERS_MAX"),
        number("DRIVE_SLOTS_MAX"),
        number("DRIVE_TEXTS_MAX"),
        number("DRIVE_TEXT_MAX"),
        [role.lower() for role in roles if role not in ("NONE", "COUNT")],
    )


def integer(row: dict[str, str], column: str, low: int, high: int) -> int:
    try:
        value = int(row[column], 10)
    except ValueError:
        raise TableError(f"{column} '{row[column]}' is not a whole number") from None
    if not low <= value <= high:
        raise TableError(f"{column} {value} is outside {low} to {high}")
    return value


def choice(row: dict[str, str], column: str, allowed: list[str]) -> str:
    if row[column] not in allowed:
        raise TableError(f"{column} '{row[column]}' is none of {', '.join(allowed)}")
    return row[column]


def parse_row(fields: list[str], settings: dict[str, int], capacity: Capacity) -> Parameter:
    """One row as a Parameter; TableError when it makes no sense by itself."""
    if len(fields) != len(COLUMNS):
        raise TableError(f"{len(fields)} columns instead of {len(COLUMNS)}")
    row = dict(zip(COLUMNS, fields, strict=True))
    if not all(" " <= character <= "~" for field in fields for character in field):
        raise TableError("only printable ASCII characters are allowed")
    pnu = integer(row, "pnu", 1, (1 << settings.get("pnu_bits", 11)) - 1)
    if not row["name"]:
        raise TableError("name is empty")
    kind = choice(row, "type", [*RANGES, "text"])
    conversion = integer(row, "conversion", min(CONVERSIONS), max(CONVERSIONS))
    if conversion not in CONVERSIONS:
        raise TableError(f"conversion {conversion} is none of {CONVERSIONS}")
    low, high = RANGES.get(kind, (0, capacity.text_max))
    minimum = integer(row, "min", low, high)
    maximum = integer(row, "max", minimum, high)
    array = integer(row, "array", 0, 255)
    if kind == "text":
        initial, text = 0, row["default"]
        if array:
            raise TableError("a text cannot be an array")
        if not minimum <= len(text) <= maximum:
            raise TableError(f"default has {len(text)} characters, not {minimum} to {maximum}")
    else:
        initial, text = integer(row, "default", minimum, maximum), ""
    role = choice(row, "role", ["", *capacity.roles])
    if role and kind == "text":
        raise TableError("a text cannot have a role")
    if array and role and not role.startswith("fault_"):
        raise TableError(f"an array cannot have role {role}")
    if role.startswith("fault_") and not array:
        raise TableError(f"role {role} needs an array")
    return Parameter(
        pnu,
        row["name"],
        kind,
        conversion,
        minimum,
        maximum,
        initial,
        text,
        array,
        choice(row, "access", list(ACCESS)),
        choice(row, "while_running", ["0", "1"]) == "1",
        row["unit"],
        role,
    )


def parse_setting(line: str, settings: dict[str, int]) -> None:
    match = re.fullmatch(r"#:\s*(\w+)\s*=\s*(-?\d+)\s*", line)
    if not match or match[1] not in SETTINGS:
        raise TableError(f"setting must be one of {', '.join(SETTINGS)} = NUMBER")
    if match[1] in settings:
        raise TableError(f"{match[1]} is set twice")
    settings[match[1]] = integer({match[1]: match[2]}, match[1], *SETTINGS[match[1]])


def read_profile(path: Path, capacity: Capacity) -> tuple[list[Parameter], dict[str, int], list[str]]:
    """(parameters, settings, errors); each error is `file:line: message`."""
    parameters: list[Parameter] = []
    settings: dict[str, int] = {}
    errors: list[str] = []
    header_seen = False
    slots = texts = 0
    number = 0
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        try:
            if line.startswith("#:"):
                parse_setting(line, settings)
                continue
            if not line.strip() or line.startswith("#"):
                continue
            fields = next(csv.reader([line], strict=True))
            if not header_seen:
                header_seen = True
                if fields != COLUMNS:
                    raise TableError(f"columns must be {','.join(COLUMNS)}")
                continue
            parameter = parse_row(fields, settings, capacity)
            if parameters and parameter.pnu <= parameters[-1].pnu:
                raise TableError(f"pnu {parameter.pnu} does not follow {parameters[-1].pnu}")
            if parameter.role and any(parameter.role == other.role for other in parameters):
                raise TableError(f"role {parameter.role} is given twice")
            if parameter.type == "text":
                parameter.slot, texts = texts, texts + 1
            else:
                parameter.slot, slots = slots, slots + max(parameter.array, 1)
            parameters.append(parameter)
        except (TableError, csv.Error) as error:
            errors.append(f"{path}:{number}: {error}")
    for what, have, room in (
        ("parameters", len(parameters), capacity.parameters),
        ("values", slots, capacity.slots),
        ("texts", texts, capacity.texts),
    ):
        if have > room:
            errors.append(f"{path}:{number}: {have} {what}, vlt_drive.h has room for {room}")
    if not parameters and not errors:
        errors.append(f"{path}:{number}: no parameters")
    return parameters, settings, errors


def c_string(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def c_number(value: int) -> str:
    return f"INT64_C({value})"


def render(
    name: str, source: str, parameters: list[Parameter], settings: dict[str, int], roles: list[str]
) -> str:
    """The whole header as text."""
    place = {p.role: i for i, p in enumerate(parameters) if p.role}
    lines = [f"/* Made by tools/drive_table.py from {source}: do not edit. */", ""]
    lines.append(f"static const drive_parameter_t {name}_parameters[] = {{")
    for p in parameters:
        role = f"DRIVE_ROLE_{(p.role or 'none').upper()}"
        lines.append(
            f"    {{{p.pnu}, DRIVE_{p.type.upper()}, {ACCESS[p.access]}, {role}, {p.conversion}, "
            f"{'true' if p.while_running else 'false'}, {p.array}, {p.slot}, {c_number(p.min)}, "
            f"{c_number(p.max)}, {c_number(p.initial)}, {c_string(p.text)}, {c_string(p.name)}, "
            f"{c_string(p.unit)}}},"
        )
    lines += ["};", "", f"static const uint16_t {name}_by_role[DRIVE_ROLE_COUNT] = {{", f"    {ROLE_NONE},"]
    lines += [f"    {place.get(role, ROLE_NONE)}, /* {role} */" for role in roles]
    lines += ["};", "", f"static const drive_profile_t drive_profile_{name} = {{"]
    mask = (1 << settings.get("pnu_bits", 11)) - 1
    relays = [settings.get(key, 255) for key in ("relay_bus", "relay_running", "relay_alarm")]
    lines.append(f'    "{name}", {mask}, {len(parameters)}, {relays[0]}, {relays[1]}, {relays[2]},')
    lines += [f"    {name}_parameters, {name}_by_role,", "};", ""]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("profile", type=Path, help="parameter table, its name is the profile's")
    parser.add_argument("header", type=Path, help="C header to write")
    arguments = parser.parse_args()
    name = arguments.profile.stem
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        parser.error(f"{arguments.profile}: the file's name must be a C name in lower case")
    capacity = read_capacity()
    try:
        parameters, settings, errors = read_profile(arguments.profile, capacity)
    except (OSError, UnicodeDecodeError) as error:
        parser.error(f"{arguments.profile}: {error}")
    if errors:
        print("\n".join(errors), file=sys.stderr)
        return 1
    arguments.header.parent.mkdir(parents=True, exist_ok=True)
    partial = arguments.header.with_name(arguments.header.name + ".partial")
    partial.write_text(render(name, arguments.profile.name, parameters, settings, capacity.roles))
    partial.replace(arguments.header)
    return 0


if __name__ == "__main__":
    sys.exit(main())
