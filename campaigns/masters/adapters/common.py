# SPDX-License-Identifier: Apache-2.0
"""The common part of the adapters: each asks one master for what it reads from its standard input.

    python -m campaigns.masters.adapters.NAME PORT TIMEOUT PARITY    TIMEOUT in s, or `default`; PARITY N or E

First line of output: {"ready": version}, or the error of the opening. Then, a line for each request:

    read-coils ADDRESS COUNT         read-registers ADDRESS COUNT
    read-inputs ADDRESS COUNT        function 04
    write-coil ADDRESS VALUE         write-register ADDRESS VALUE
    write-coils ADDRESS VALUE...     write-registers ADDRESS VALUE...
    read-text ADDRESS REGISTERS      write-text ADDRESS HEX: the characters in hex

Answers: {"values": [...]}, {"text": "..."}, {"done": true}, or the error. {"shows": ...} is an error of the
master's own kind, with "code" if the master gives the exception's number; {"crash": ...} is any other error.

Runs in an environment of its own, so it imports the standard library only.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

BAUD, UNIT = 9600, 1
DEFAULT = "default"
# What each request calls: the address, then a count, a value or a list of values.
Calls = dict[str, Callable[[int, Any], Any]]


class ShownError(Exception):
    """An error that the master returns instead of raising it."""

    def __init__(self, text: str, code: int | None = None) -> None:
        super().__init__(text)
        self.code = code


@dataclass(frozen=True)
class Adapter:
    """A master. `errors`: its own kinds; `code_of`: the number in an error, if it has one."""

    version: str
    errors: tuple[type[Exception], ...]
    opened: Callable[[str, float | None, str], Calls]
    code_of: Callable[[Exception], int | None] = lambda error: None

    def ask(self, calls: Calls, line: str) -> dict:
        what, address, *rest = line.split()
        at = int(address)
        if what == "read-text":
            if "read-text" in calls:
                return {"text": calls["read-text"](at, int(rest[0]))}
            registers = calls["read-registers"](at, int(rest[0]))
            return {"text": b"".join(value.to_bytes(2, "big") for value in registers).decode("latin-1")}
        if what.startswith("read-"):
            return {"values": [int(value) for value in calls[what](at, int(rest[0]))]}
        if what == "write-text":
            data = bytes.fromhex(rest[0])
            if "write-text" in calls:
                calls["write-text"](at, data.decode("latin-1"))
            else:
                words = [int.from_bytes(data[i : i + 2], "big") for i in range(0, len(data), 2)]
                calls["write-registers"](at, words)
        else:
            values = [int(value) for value in rest]
            calls[what](at, values if what.endswith("s") else values[0])
        return {"done": True}

    def failed(self, error: Exception) -> dict:
        if isinstance(error, ShownError):
            answer = {"shows": str(error)}
            return answer if error.code is None else answer | {"code": error.code}
        said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        said = " ".join(said.split())
        if not isinstance(error, self.errors):
            return {"crash": said}
        code = self.code_of(error)
        return {"shows": said} | ({} if code is None else {"code": int(code)})

    def serve(self) -> int:
        """Opens the port and answers requests until their end. What a master raises is the subject here."""
        port, timeout, parity = sys.argv[1:]
        try:
            calls = self.opened(port, None if timeout == DEFAULT else float(timeout), parity)
        except Exception as error:
            tell(self.failed(error))
            return 0
        tell({"ready": self.version})
        for line in sys.stdin:
            try:
                tell(self.ask(calls, line))
            except Exception as error:
                tell(self.failed(error))
        return 0


def tell(answer: dict) -> None:
    print(json.dumps(answer), flush=True)
