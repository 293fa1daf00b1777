# SPDX-License-Identifier: Apache-2.0
"""Common to the adapters in Python: a request comes in as a line, an answer goes out as a line of JSON.

    python -m campaigns.masters.adapters.NAME PORT TIMEOUT PARITY

PORT is a device, or `HOST:PORT` for RTU over TCP. TIMEOUT is in seconds, or `default` for the master's own.
PARITY is N or E. The line is 9600 bit/s, the unit is 1, addresses are on-wire. The first line out is `ready`
with the master's version, or the answer to the failed opening. Requests:

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

BAUD, UNIT = 9600, 1
DEFAULT = "default"


class ShownError(Exception):
    """An error that the master returns instead of raising it."""

    def __init__(self, text: str, code: int | None = None) -> None:
        super().__init__(text)
        self.code = code


def text_of(registers: list[int]) -> str:
    """Two characters a register, the first in the high byte."""
    return b"".join(value.to_bytes(2, "big") for value in registers).decode("latin-1")


def registers_of(text: str) -> list[int]:
    data = text.encode("latin-1")
    return [int.from_bytes(data[i : i + 2], "big") for i in range(0, len(data), 2)]


class Adapter:
    """A master's calls. A master without a call of its own for texts inherits these two."""

    version = ""
    errors: tuple[type[Exception], ...] = ()

    def read_coils(self, address: int, count: int) -> list[int]:
        raise NotImplementedError

    def read_registers(self, address: int, count: int) -> list[int]:
        raise NotImplementedError

    def read_inputs(self, address: int, count: int) -> list[int]:
        raise NotImplementedError

    def write_coil(self, address: int, value: int) -> None:
        raise NotImplementedError

    def write_register(self, address: int, value: int) -> None:
        raise NotImplementedError

    def write_coils(self, address: int, values: list[int]) -> None:
        raise NotImplementedError

    def write_registers(self, address: int, values: list[int]) -> None:
        raise NotImplementedError

    def read_text(self, address: int, count: int) -> str:
        return text_of(self.read_registers(address, count))

    def write_text(self, address: int, text: str) -> None:
        self.write_registers(address, registers_of(text))

    def code_of(self, error: Exception) -> int | None:
        """The exception's number, if the master gives it as a number."""
        return None

    def ask(self, line: str) -> dict:
        what, address, *rest = line.split()
        at = int(address)
        if what in ("read-coils", "read-registers", "read-inputs"):
            values = getattr(self, what.replace("-", "_"))(at, int(rest[0]))
            return {"values": [int(value) for value in values]}
        if what == "read-text":
            return {"text": self.read_text(at, int(rest[0]))}
        if what == "write-text":
            self.write_text(at, bytes.fromhex(rest[0]).decode("latin-1"))
        elif what in ("write-coil", "write-register"):
            getattr(self, what.replace("-", "_"))(at, int(rest[0]))
        else:
            getattr(self, what.replace("-", "_"))(at, [int(value) for value in rest])
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


def tell(answer: dict) -> None:
    print(json.dumps(answer), flush=True)


def serve(opened: Callable[[str, float | None, str], Adapter], kind: type[Adapter]) -> int:
    """Opens the port and answers requests until their end."""
    port, timeout, parity = sys.argv[1:]
    try:
        adapter = opened(port, None if timeout == DEFAULT else float(timeout), parity)
    except Exception as error:  # the subject of the campaign: whatever a master raises
        tell(kind().failed(error))
        return 0
    tell({"ready": adapter.version})
    for line in sys.stdin:
        try:
            tell(adapter.ask(line))
        except Exception as error:
            tell(adapter.failed(error))
    return 0
