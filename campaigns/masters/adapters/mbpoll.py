# SPDX-License-Identifier: Apache-2.0
"""Adapter of mbpoll: one start of the program a request."""

from __future__ import annotations

import re
import subprocess

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, Calls, ShownError
from rtl.command import run_main

PARITIES = {"N": "none", "E": "even"}
COILS, INPUTS, REGISTERS = "034"  # of mbpoll's option -t


def version() -> str:
    """Debian's: the program itself says 1.0 in each of its versions."""
    query = ["dpkg-query", "-W", "-f", "${Version}", "mbpoll"]
    try:
        shown = subprocess.run(query, capture_output=True, text=True, check=False).stdout
    except OSError:
        shown = ""
    found = re.match(r"[\d.]+", shown)
    return found[0] if found else "of unknown version"


def opened(port: str, timeout: float | None, parity: str) -> Calls:
    line = ["mbpoll", "-m", "rtu", "-a", str(UNIT), "-b", str(BAUD), "-P", PARITIES[parity], "-s", "2"]
    line += [] if timeout is None else ["-o", str(timeout)]

    def run(kind: str, at: int, *more: str, values: list[int]) -> list[int]:
        """References of mbpoll count from 1; -1 asks once."""
        command = [*line, "-t", kind, "-r", str(at + 1), "-1", *more, port, *map(str, values)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise ShownError(" ".join(done.stderr.split()) or f"exit code {done.returncode}")
        return [int(value) for value in re.findall(r"^\[\d+\]:\s+(\d+)", done.stdout, re.MULTILINE)]

    def read(kind: str):
        return lambda at, count: run(kind, at, "-c", str(count), values=[])

    def write(kind: str):
        return lambda at, what: run(kind, at, values=what if isinstance(what, list) else [what])

    return {
        "read-coils": read(COILS),
        "read-registers": read(REGISTERS),
        "read-inputs": read(INPUTS),
        "write-coil": write(COILS),
        "write-register": write(REGISTERS),
        "write-coils": write(COILS),
        "write-registers": write(REGISTERS),
    }


if __name__ == "__main__":
    run_main("mbpoll", Adapter(version(), (), opened).serve)
