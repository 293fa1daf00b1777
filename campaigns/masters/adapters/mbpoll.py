# SPDX-License-Identifier: Apache-2.0
"""Adapter of mbpoll: one start of the program a request."""

from __future__ import annotations

import re
import subprocess

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, ShownError, serve
from rtl.command import run_main

PARITIES = {"N": "none", "E": "even"}


def version() -> str:
    """Debian's: the program itself says 1.0 in each of its versions."""
    query = ["dpkg-query", "-W", "-f", "${Version}", "mbpoll"]
    try:
        shown = subprocess.run(query, capture_output=True, text=True, check=False).stdout
    except OSError:
        shown = ""
    found = re.match(r"[\d.]+", shown)
    return found[0] if found else "of unknown version"


class Mbpoll(Adapter):
    def __init__(self, port: str = "", timeout: float | None = None, parity: str = "N") -> None:
        self.version = version()
        self.line = ["mbpoll", "-m", "rtu", "-a", str(UNIT), "-b", str(BAUD), "-P", PARITIES[parity]]
        self.line += ["-s", "2", *([] if timeout is None else ["-o", str(timeout)])]
        self.port = port

    def _run(self, kind: int, address: int, count: int = 0, values: list[int] | None = None) -> list[int]:
        """References of mbpoll count from 1; -1 asks once."""
        command = [*self.line, "-t", str(kind), "-r", str(address + 1), "-1"]
        command += ["-c", str(count)] if count else []
        command += [self.port, *map(str, values or [])]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise ShownError(" ".join(done.stderr.split()) or f"exit code {done.returncode}")
        return [int(value) for value in re.findall(r"^\[\d+\]:\s+(\d+)", done.stdout, re.MULTILINE)]

    def read_coils(self, address: int, count: int) -> list[int]:
        return self._run(0, address, count)

    def read_registers(self, address: int, count: int) -> list[int]:
        return self._run(4, address, count)

    def read_inputs(self, address: int, count: int) -> list[int]:
        return self._run(3, address, count)

    def write_coil(self, address: int, value: int) -> None:
        self._run(0, address, values=[value])

    def write_register(self, address: int, value: int) -> None:
        self._run(4, address, values=[value])

    def write_coils(self, address: int, values: list[int]) -> None:
        self._run(0, address, values=values)

    def write_registers(self, address: int, values: list[int]) -> None:
        self._run(4, address, values=values)


if __name__ == "__main__":
    run_main("mbpoll", lambda: serve(Mbpoll, Mbpoll))
