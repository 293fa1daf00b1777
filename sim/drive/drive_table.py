# SPDX-License-Identifier: Apache-2.0
"""Converts the parameter tables of the simulated drives (sim/drive/NAME.csv) into one C header.

    python -m sim.drive.drive_table sim/drive/vlt5000.csv sim/drive/vlt6000.csv build/sim/drive_profiles.h

The header holds the array `drive_profiles`; only sim/drive/vlt_drive.c includes it. The first malformed line
is reported as `file:line: message`; the exit code is then 1.

A profile is a CSV file. `#` lines are comments. `#: key = number` lines are settings, decimal or 0x:

    pnu_bits           bits of PKE that are the parameter number, 11 or 12
    index_first        index of an array's first element, 0 or 1
    fault_unknown_ak   fault number for an AK that the drive does not know
    fc_status          1: status word bit 2 = 0 coasting; 0: bit 2 = 1 stand by
    example_status, example_frequency       process words of the example state
    example PNU = number, example PNU[INDEX] = number   a value of the example state

The first other line names the columns. Values are raw. `source` is the origin of a row: `document` (number,
type and conversion are in a public document), `partly` (some of it), `memory` (of the product family),
`simulator` (a choice of the simulator). Roles, types and capacities are read from sim/drive/vlt_drive.h, so
that only one file defines them.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import sys
from collections import namedtuple
from dataclasses import dataclass, field
from pathlib import Path

HEADER = Path(__file__).resolve().parents[2] / "sim" / "drive" / "vlt_drive.h"
COLUMNS = [
    *("pnu", "name", "type", "conversion", "min", "max", "default"),
    *("array", "access", "while_running", "unit", "role", "source"),
]
SOURCES = ["document", "partly", "memory", "simulator"]
# Setting: minimum, maximum, default.
SETTINGS = {
    "pnu_bits": (11, 12, 11),
    "index_first": (0, 1, 1),
    "fault_unknown_ak": (0, 255, 130),
    "fc_status": (0, 1, 0),
    "example_status": (0, 0xFFFF, 0x0F03),
    "example_frequency": (0, 0xFFFF, 0x2000),
}
RANGES = {
    "uint8": (0, 0xFF),
    "int16": (-0x8000, 0x7FFF),
    "uint16": (0, 0xFFFF),
    "int32": (-0x80000000, 0x7FFFFFFF),
    "uint32": (0, 0xFFFFFFFF),
}
ACCESS = {
    "rw": "DRIVE_READ_WRITE",
    "ro": "DRIVE_READ_ONLY",
    "local": "DRIVE_LOCAL",
    "reset": "DRIVE_RESET",
    "fixed": "DRIVE_FIXED",
    "denied": "DRIVE_DENIED",
}
PRESETS = 4  # preset references that the control word can choose
CONVERSIONS = [*range(-4, 4), 73, 74]
ROLE_NONE = 0xFFFF


class TableError(ValueError):
    """A row that cannot be used, with the reason."""


# One row, numbers raw. `slot` is the first of its values in the drive's memory.
Parameter = namedtuple(
    "Parameter",
    "pnu name type conversion min max initial text array access while_running unit role slot",
    defaults=(0,),
)


@dataclass
class Profile:
    """One table. `examples` are (line, pnu, index, value)."""

    name: str
    parameters: list[Parameter] = field(default_factory=list)
    settings: dict[str, int] = field(default_factory=dict)
    examples: list[tuple[int, int, int, int]] = field(default_factory=list)

    def setting(self, key: str) -> int:
        return self.settings.get(key, SETTINGS[key][2])


# Capacities of sim/drive/vlt_drive.h.
Capacity = namedtuple("Capacity", "parameters slots texts text_max roles")


def read_capacity(header: Path = HEADER) -> Capacity:
    """Reads roles and array sizes from the C header."""
    source = header.read_text()
    names = ("DRIVE_PARAMETERS_MAX", "DRIVE_SLOTS_MAX", "DRIVE_TEXTS_MAX", "DRIVE_TEXT_MAX")
    numbers = (int(re.search(rf"#define {name} (\d+)", source)[1]) for name in names)
    roles = re.findall(r"^  DRIVE_ROLE_(\w+)", source, re.MULTILINE)
    return Capacity(*numbers, [role.lower() for role in roles if role not in ("NONE", "COUNT")])


def number(text: str, name: str, low: int, high: int) -> int:
    try:
        value = int(text, 0)
    except ValueError:
        raise TableError(f"{name} '{text}' is not a whole number") from None
    if not low <= value <= high:
        raise TableError(f"{name} {value} is outside {low} to {high}")
    return value


def parse_row(fields: list[str], pnu_bits: int, capacity: Capacity) -> Parameter:
    """Parses one row; TableError if it is invalid by itself."""
    if len(fields) != len(COLUMNS):
        raise TableError(f"{len(fields)} columns instead of {len(COLUMNS)}")
    row = dict(zip(COLUMNS, fields, strict=True))

    def integer(column: str, low: int, high: int) -> int:
        return number(row[column], column, low, high)

    for column, allowed in (
        ("type", [*RANGES, "text"]),
        ("conversion", list(map(str, CONVERSIONS))),
        ("access", list(ACCESS)),
        ("while_running", ["0", "1"]),
        ("role", ["", *capacity.roles]),
        ("source", SOURCES),
    ):
        if row[column] not in allowed:
            raise TableError(f"{column} '{row[column]}' is not one of {', '.join(allowed)}")
    kind, role = row["type"], row["role"]
    pnu = integer("pnu", 1, (1 << pnu_bits) - 1)
    low, high = RANGES.get(kind, (0, capacity.text_max))
    minimum = integer("min", low, high)
    maximum = integer("max", minimum, high)
    array = integer("array", 0, 255)
    if kind == "text":
        initial, text = 0, row["default"]
        if not minimum <= len(text) <= maximum or array or role:
            raise TableError(f"a text is no array, has no role and {minimum} to {maximum} characters")
    else:
        initial, text = integer("default", minimum, maximum), ""
    logs = role.startswith("fault_")
    if logs != bool(array) and role not in ("", "presets"):
        raise TableError(f"role {role} {'needs an array' if logs else 'cannot have an array'}")
    return Parameter(
        *(pnu, row["name"], kind, int(row["conversion"]), minimum, maximum, initial, text, array),
        *(row["access"], row["while_running"] == "1", row["unit"], role),
    )


def parse_setting(line: int, text: str, profile: Profile) -> None:
    """Parses a `#:` line."""
    match = re.fullmatch(r"#:\s*(\w+)(?:\s+(\d+)(?:\[(\d+)\])?)?\s*=\s*(-?\w+)\s*", text)
    if match is None or (match[1] not in SETTINGS if match[2] is None else match[1] != "example"):
        raise TableError(f"setting must be one of {', '.join(SETTINGS)}, example PNU[INDEX] = NUMBER")
    if match[2] is not None:
        value = number(match[4], "example", *RANGES["int32"])
        profile.examples.append((line, int(match[2]), int(match[3] or 0), value))
    else:
        profile.settings[match[1]] = number(match[4], match[1], *SETTINGS[match[1]][:2])


def check_example(profile: Profile, pnu: int, index: int, value: int) -> None:
    """Checks that an example is a value that the table allows."""
    parameter = next((p for p in profile.parameters if p.pnu == pnu and p.type != "text"), None)
    first = profile.setting("index_first") if parameter and parameter.array else 0
    if parameter is None or not first <= index < first + max(parameter.array, 1):
        raise TableError(f"example {pnu}[{index}] is no number of this table")
    number(str(value), f"example {pnu}", parameter.min, parameter.max)


def check_presets(parameters: list[Parameter]) -> None:
    """Checks that role `presets` has four values of one kind side by side in the drive's memory."""
    at = next((i for i, p in enumerate(parameters) if p.role == "presets"), None)
    if at is None or parameters[at].array >= PRESETS:
        return
    run = parameters[at : at + PRESETS]
    wanted = [(run[0].pnu + i, run[0].type, run[0].conversion, 0) for i in range(PRESETS)]
    if [(p.pnu, p.type, p.conversion, p.array) for p in run] != wanted:
        raise TableError(f"role presets needs {PRESETS} parameters in a row or an array of {PRESETS}")


def add_row(profile: Profile, parameter: Parameter, used: dict[str, int]) -> None:
    """Appends a parameter and assigns its slot: `used` counts values and texts so far."""
    if profile.parameters and parameter.pnu <= profile.parameters[-1].pnu:
        raise TableError(f"pnu {parameter.pnu} does not follow {profile.parameters[-1].pnu}")
    single = parameter.role and not parameter.role.startswith("show_")
    if single and any(parameter.role == other.role for other in profile.parameters):
        raise TableError(f"role {parameter.role} is given twice")
    kind = "texts" if parameter.type == "text" else "values"
    profile.parameters.append(parameter._replace(slot=used[kind]))
    used[kind] += max(parameter.array, 1)


def read_profile(path: Path, capacity: Capacity) -> Profile:
    """Reads a table. TableError at its first malformed line: `file:line: message`."""
    profile, used, header_seen, line = Profile(path.stem), {"values": 0, "texts": 0}, False, 0
    try:
        for line, text in enumerate(path.read_text(encoding="ascii").splitlines(), 1):
            if text.startswith("#:"):
                parse_setting(line, text, profile)
            elif text.strip() and not text.startswith("#"):
                fields = next(csv.reader([text], strict=True))
                if header_seen:
                    add_row(profile, parse_row(fields, profile.setting("pnu_bits"), capacity), used)
                elif fields != COLUMNS:
                    raise TableError(f"columns must be {','.join(COLUMNS)}")
                header_seen = True
        for what, have, room in (
            ("parameters", len(profile.parameters), capacity.parameters),
            ("values", used["values"], capacity.slots),
            ("texts", used["texts"], capacity.texts),
        ):
            if have > room:
                raise TableError(f"{have} {what}, vlt_drive.h has room for {room}")
        check_presets(profile.parameters)
        for example in profile.examples:
            line = example[0]
            check_example(profile, *example[1:])
    except (TableError, csv.Error) as error:
        raise TableError(f"{path}:{line}: {error}") from None
    return profile


def c_number(value: int) -> str:
    return f"INT64_C({value})"


def render_tables(profile: Profile, roles: list[str]) -> list[str]:
    """The parameter, role and example tables of one profile."""
    name = profile.name
    place = {p.role: i for i, p in enumerate(profile.parameters) if p.role}
    lines = [f"static const drive_parameter_t {name}_parameters[] = {{"]
    for p in profile.parameters:
        role = f"DRIVE_ROLE_{(p.role or 'none').upper()}"
        cells = (p.pnu, f"DRIVE_{p.type.upper()}", ACCESS[p.access], role, p.conversion)
        cells += (str(p.while_running).lower(), p.array, p.slot)
        cells += (*map(c_number, (p.min, p.max, p.initial)), *map(json.dumps, (p.text, p.name, p.unit)))
        lines.append(f"    {{{', '.join(map(str, cells))}}},")
    lines += ["};", "", f"static const uint16_t {name}_by_role[DRIVE_ROLE_COUNT] = {{", f"    {ROLE_NONE},"]
    lines += [f"    {place.get(role, ROLE_NONE)}, /* {role} */" for role in roles]
    lines += ["};", ""]
    if profile.examples:
        lines.append(f"static const drive_example_t {name}_examples[] = {{")
        lines += [f"    {{{pnu}, {index}, {c_number(value)}}}," for _, pnu, index, value in profile.examples]
        lines += ["};", ""]
    return lines


def render_profile(profile: Profile) -> str:
    """One element of the array drive_profiles."""
    name, get = profile.name, profile.setting
    return (
        f'    {{"{name}", {(1 << get("pnu_bits")) - 1}, {get("index_first")}, {get("fault_unknown_ak")}, '
        f"{'true' if get('fc_status') else 'false'}, {get('example_status')}, {get('example_frequency')}, "
        f"{len(profile.examples)}, {f'{name}_examples' if profile.examples else 'NULL'}, "
        f"{len(profile.parameters)}, {name}_parameters, {name}_by_role}},"
    )


def render(profiles: list[Profile], roles: list[str]) -> str:
    """The whole header as text."""
    lines = ["/* Made by sim/drive/drive_table.py from sim/drive/: do not edit. */", ""]
    for profile in profiles:
        lines += render_tables(profile, roles)
    lines.append("static const drive_profile_t drive_profiles[] = {")
    lines += [render_profile(profile) for profile in profiles]
    lines += ["};", ""]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("profile", type=Path, nargs="+", help="parameter table, its name is the profile's")
    parser.add_argument("header", type=Path, help="C header to write")
    arguments = parser.parse_args()
    capacity = read_capacity()
    try:
        profiles = [read_profile(path, capacity) for path in arguments.profile]
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    arguments.header.parent.mkdir(parents=True, exist_ok=True)
    partial = arguments.header.with_name(arguments.header.name + ".partial")
    partial.write_text(render(profiles, capacity.roles))
    partial.replace(arguments.header)
    return 0


if __name__ == "__main__":
    sys.exit(main())
