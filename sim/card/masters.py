# SPDX-License-Identifier: Apache-2.0
"""Independent Modbus masters for the demo and the tests of the virtual card: pymodbus and mbpoll.

Requests and replies are complete frames: unit address, PDU, CRC.
"""

from __future__ import annotations

import contextlib
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

BAUD = 9600  # a pty ignores rate and parity
REPLY_S = 5.0  # wall time that pymodbus waits for a reply


@dataclass(frozen=True)
class Exchange:
    """A master's call and its reading of the reply."""

    call: str
    answer: str
    accepted: bool


def words(data: bytes) -> list[int]:
    """16-bit registers, high byte first."""
    return [int.from_bytes(data[i : i + 2], "big") for i in range(0, len(data), 2)]


def as_pymodbus_call(request: bytes) -> tuple[str, list, dict]:
    """Method of the pymodbus client for this request, with its arguments."""
    address, value = words(request[2:6])
    data = request[7:-2]
    match request[1]:
        case 0x01:
            return "read_coils", [address], {"count": value}
        case 0x03:
            return "read_holding_registers", [address], {"count": value}
        case 0x05:
            return "write_coil", [address, value == 0xFF00], {}
        case 0x06:
            return "write_register", [address, value], {}
        case 0x0F:
            return "write_coils", [address, [bool(data[i // 8] >> (i % 8) & 1) for i in range(value)]], {}
        case 0x10:
            return "write_registers", [address, words(data)], {}
    raise ValueError(f"no pymodbus call for function {request[1]}")


class Pymodbus:
    """The synchronous client on a serial link; use with `with`, or close() it."""

    def __init__(self, link: Path, wait: float = REPLY_S) -> None:
        from pymodbus.client import ModbusSerialClient

        self.client = ModbusSerialClient(
            str(link),
            baudrate=BAUD,
            parity="N",
            stopbits=2,
            timeout=wait,
            retries=0,
            trace_packet=self._trace,
        )
        self.received = b""
        if not self.client.connect():
            raise ConnectionError(f"pymodbus cannot open {link}")

    def __enter__(self) -> Pymodbus:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self.client.close()

    def _trace(self, sending: bool, data: bytes) -> bytes:
        self.received = b"" if sending else data  # everything since the request
        return data

    def ask(self, request: bytes) -> Exchange:
        """Sends a request by the client's own method."""
        from pymodbus.exceptions import ModbusException

        method, arguments, options = as_pymodbus_call(request)
        shown = [str(a) for a in arguments]
        if method == "write_coils":
            shown[1] = f"[{len(arguments[1])} coils]"
        shown += [f"{key}={value}" for key, value in options.items()]
        call = f"pymodbus {method}({', '.join(shown)})"
        try:
            response = getattr(self.client, method)(*arguments, device_id=request[0], **options)
        except ModbusException as error:
            return Exchange(call, str(error), False)
        if response.isError():
            return Exchange(call, f"exception {response.exception_code}", False)
        answer = "accepted"
        if method == "read_holding_registers":
            answer = f"registers {response.registers}"
        elif method == "read_coils":
            answer = f"coils {''.join(str(int(bit)) for bit in response.bits[: options['count']])}"
        return Exchange(call, answer, True)

    def send(self, unit: int, pdu: bytes, answered: bool = True) -> bytes:
        """Sends any PDU, valid or not, as a custom function; returns the received bytes."""
        from pymodbus.exceptions import ModbusException
        from pymodbus.pdu import ModbusPDU

        class Raw(ModbusPDU):
            function_code = pdu[0]

            def encode(self) -> bytes:
                return pdu[1:]

        self.received = b""
        with contextlib.suppress(ModbusException):  # no reply, or an invalid one
            self.client.execute(not answered, Raw(dev_id=unit))
        return self.received


def ask_mbpoll(link: Path, register: int, *, count: int = 1, values: tuple[int, ...] = ()) -> Exchange:
    """Runs one read of holding registers, or one write of `values`; `register` counts from 1."""
    what = ["-t", "4", "-r", str(register), "-1"] + ([] if values else ["-c", str(count)])
    line = ["mbpoll", "-m", "rtu", "-a", "1", "-b", str(BAUD), "-P", "none"]
    values_text = [str(value) for value in values]
    command = [*line, *what, str(link), *values_text]
    run = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    call = " ".join([*line, *what, "LINK", *values_text])
    if run.returncode != 0:
        return Exchange(call, " ".join(run.stderr.split()) or f"exit code {run.returncode}", False)
    read = re.findall(r"^\[\d+\]:\s+(\S+)", run.stdout, re.MULTILINE)
    return Exchange(call, f"registers [{', '.join(read)}]" if read else "accepted", True)
