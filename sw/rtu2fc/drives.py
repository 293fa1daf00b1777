# SPDX-License-Identifier: Apache-2.0
"""The drives: their parameters and the kinds of bits that they have, from the tables of sim/drive."""

from __future__ import annotations

import csv
from pathlib import Path

from . import __path__

NAMES = sorted({path.stem for folder in __path__ for path in Path(folder).glob("*.csv")})


def _drive(name: str) -> dict:
    """`parameters`: number, then name, type, conversion index, unit. Lines `#:` are settings of the drive."""
    (table,) = (found for folder in __path__ if (found := Path(folder, f"{name}.csv")).exists())
    lines = table.read_text(encoding="ascii").splitlines()
    settings = dict(line[2:].split(" = ") for line in lines if line.startswith("#:"))
    settings = {key.strip(): int(value, 0) for key, value in settings.items()}
    rows = list(csv.DictReader(line for line in lines if line and not line.startswith("#")))
    two_ramps = any(row["role"] == "ramp_up_2" for row in rows)
    status = "fc_status" if settings.get("fc_status") else "vlt_status"
    return {
        "pnu_mask": (1 << settings["pnu_bits"]) - 1,
        "first_index": settings.get("index_first", 1),
        "kinds": (status, "two_ramps" if two_ramps else "one_ramp"),
        "parameters": {
            int(row["pnu"]): (row["name"], row["type"], int(row["conversion"]), row["unit"]) for row in rows
        },
    }


DRIVES = {name: _drive(name) for name in NAMES}
