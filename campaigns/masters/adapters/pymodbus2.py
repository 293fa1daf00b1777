# SPDX-License-Identifier: Apache-2.0
"""Adapter of pymodbus 2, whose calls are the same in all versions before 3.0."""

from __future__ import annotations

from typing import Any

from pymodbus.client.sync import ModbusSerialClient
from pymodbus.exceptions import ModbusException
from pymodbus.version import version

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, Calls, ShownError
from rtl.command import run_main


def good(response: Any) -> Any:
    if response.isError():
        raise ShownError(str(response), getattr(response, "exception_code", None))
    return response


def opened(port: str, timeout: float | None, parity: str) -> Calls:
    options = {} if timeout is None else {"timeout": timeout}
    client = ModbusSerialClient("rtu", port=port, baudrate=BAUD, parity=parity, stopbits=2, **options)
    if not client.connect():
        raise ShownError("connect() returns False")
    return {
        "read-coils": lambda at, count: good(client.read_coils(at, count, unit=UNIT)).bits[:count],
        "read-registers": lambda at, count: (
            good(client.read_holding_registers(at, count, unit=UNIT)).registers
        ),
        "read-inputs": lambda at, count: good(client.read_input_registers(at, count, unit=UNIT)).registers,
        "write-coil": lambda at, value: good(client.write_coil(at, bool(value), unit=UNIT)),
        "write-register": lambda at, value: good(client.write_register(at, value, unit=UNIT)),
        "write-coils": lambda at, values: good(client.write_coils(at, list(map(bool, values)), unit=UNIT)),
        "write-registers": lambda at, values: good(client.write_registers(at, values, unit=UNIT)),
    }


if __name__ == "__main__":
    run_main("old-pymodbus", Adapter(version.short(), (ModbusException,), opened).serve)
