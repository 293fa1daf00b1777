# SPDX-License-Identifier: Apache-2.0
"""Converts the parameter tables of the simulated drives (sim/drive/NAME.csv) into one C header.

    python -m sim.drive.drive_table sim/drive/vlt5000.csv sim/drive/vlt6000.csv build/sim/drive_profiles.h

The header holds the array `drive_profiles`; only sim/drive/vlt_drive.c includes it. A malformed line is
reported as `file:line: message`; the exit code is then 1. The compiler finds a type or a role that is not in
vlt_drive.h, and the tests of the drives find wrong values.

A profile is a CSV file. `#` lines are comments. `#: key = number` lines are settings, decimal or 0x:

    pnu_bits           bits of PKE that are the parameter number, 11 or 12
    index_first        index of an array's first element, 0 or 1
    fault_unknown_ak   fault number for an AK that the drive does not know
    fc_status          1: status word bit 2 = 0 coasting; 0: bit 2 = 1 stand by
    example_status, example_frequency       process words of the example state
    example PNU = number                    a value of the example state; PNU[INDEX] that of an element

The first other line names the columns. Values are raw. `source` is the origin of a row: `document` (number,
type and conversion are in a public document), `partly` (some of it), `memory` (of the product family),
`simulator` (a choice of the simulator).
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

COLUMNS = [
    *("pnu", "name", "type", "conversion", "min", "max", "default"),
    *("array", "access", "while_running", "unit", "role", "source"),
]
DEFAULTS = {
    **{"pnu_bits": 11, "index_first": 1, "fault_unknown_ak": 130, "fc_status": 0},
    **{"example_status": 0x0F03, "example_frequency": 0x2000},
}
ACCESS = {
    "rw": "DRIVE_READ_WRITE",
    "ro": "DRIVE_READ_ONLY",
    "local": "DRIVE_LOCAL",
    "reset": "DRIVE_RESET",
    "fixed": "DRIVE_FIXED",
    "denied": "DRIVE_DENIED",
}


@dataclass
class Profile:
    """One table. `parameters` and `examples` are rows of C, `used`: room taken so far, of DRIVE_..._MAX."""

    name: str
    parameters: list[str] = field(default_factory=list)
    examples: list[str] = field(default_factory=list)
    settings: dict[str, int] = field(default_factory=DEFAULTS.copy)
    used: Counter[str] = field(default_factory=Counter)
    last: int = 0  # number of the last parameter

    def add_setting(self, text: str) -> None:
        match = re.fullmatch(r"#:\s*(\w+)(?:\s+(\d+)(?:\[(\d+)\])?)?\s*=\s*(-?\w+)\s*", text)
        if match is None or (match[1] not in self.settings if match[2] is None else match[1] != "example"):
            raise ValueError(f"no setting of {', '.join(self.settings)}, example PNU[INDEX] = NUMBER")
        if match[2] is None:
            self.settings[match[1]] = int(match[4], 0)
        else:
            self.examples.append(f"{match[2]}, {match[3] or 0}, {c_number(match[4])}")

    def add_row(self, fields: list[str]) -> None:
        row = dict(zip(COLUMNS, fields, strict=True))
        pnu, array, kind = int(row["pnu"]), int(row["array"]), row["type"]
        # The drive finds a parameter by bisection.
        if pnu <= self.last:
            raise ValueError(f"pnu {pnu} does not follow {self.last}")
        self.last = pnu
        initial, text = ("0", row["default"]) if kind == "text" else (row["default"], "")
        memory, role = "TEXTS" if kind == "text" else "SLOTS", row["role"].upper() or "NONE"
        cells = (pnu, f"DRIVE_{kind.upper()}", ACCESS[row["access"]], f"DRIVE_ROLE_{role}")
        cells += (int(row["conversion"]), int(row["while_running"]), array, self.used[memory])
        cells += (*map(c_number, (row["min"], row["max"], initial)),)
        cells += (*map(json.dumps, (text, row["name"], row["unit"])),)
        self.parameters.append(", ".join(map(str, cells)))
        self.used += Counter({memory: max(array, 1), "PARAMETERS": 1})


def read_profile(path: Path) -> Profile:
    """Reads a table. ValueError at its first malformed line: `file:line: message`."""
    profile, header_seen = Profile(path.stem), False
    for line, text in enumerate(path.read_text(encoding="ascii").splitlines(), 1):
        try:
            if text.startswith("#:"):
                profile.add_setting(text)
            elif text.strip() and not text.startswith("#"):
                fields = next(csv.reader([text], strict=True))
                if header_seen:
                    profile.add_row(fields)
                elif fields != COLUMNS:
                    raise ValueError(f"columns must be {','.join(COLUMNS)}")
                header_seen = True
        except (ValueError, KeyError, csv.Error) as error:
            raise ValueError(f"{path}:{line}: {error}") from None
    return profile


def c_number(text: str) -> str:
    return f"INT64_C({int(text, 0)})"


def c_array(kind: str, name: str, rows: list[str]) -> list[str]:
    return [f"static const {kind} {name}[] = {{", *(f"    {{{row}}}," for row in rows), "};", ""]


def render(profiles: list[Profile]) -> str:
    """The whole header as text."""
    lines, found = ["/* Made by sim/drive/drive_table.py from sim/drive/: do not edit. */", ""], []
    for profile in profiles:
        name, get = profile.name, profile.settings
        for what, count in profile.used.items():
            lines += [f"#if {count} > DRIVE_{what}_MAX", f'#error "{name} has {count} {what}"', "#endif"]
        lines += c_array("drive_parameter_t", f"{name}_parameters", profile.parameters)
        # C has no empty arrays.
        lines += c_array("drive_example_t", f"{name}_examples", profile.examples or ["0, 0, 0"])
        found.append(
            f'"{name}", {(1 << get["pnu_bits"]) - 1}, {get["index_first"]}, {get["fault_unknown_ak"]}, '
            f"{get['fc_status']}, {get['example_status']}, {get['example_frequency']}, "
            f"{len(profile.examples)}, {name}_examples, {len(profile.parameters)}, {name}_parameters"
        )
    return "\n".join([*lines, *c_array("drive_profile_t", "drive_profiles", found)])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("profile", type=Path, nargs="+", help="parameter table, its name is the profile's")
    parser.add_argument("header", type=Path, help="C header to write")
    arguments = parser.parse_args()
    try:
        profiles = [read_profile(path) for path in arguments.profile]
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    arguments.header.parent.mkdir(parents=True, exist_ok=True)
    partial = arguments.header.with_name(arguments.header.name + ".partial")
    partial.write_text(render(profiles))
    partial.replace(arguments.header)
    return 0


if __name__ == "__main__":
    sys.exit(main())
