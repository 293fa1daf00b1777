# SPDX-License-Identifier: Apache-2.0
"""Adapter of pymodbus 3.10 or newer, on a serial port, or RTU over TCP."""

from __future__ import annotations

from typing import Any

import pymodbus
from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ModbusException

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, Calls, ShownError
from rtl.command import run_main


def good(response: Any) -> Any:
    if response.isError():
        raise ShownError(str(response), response.exception_code)
    return response


def opened(port: str, timeout: float | None, parity: str) -> Calls:
    options: dict[str, Any] = {} if timeout is None else {"timeout": timeout, "retries": 0}
    if ":" in port:
        host, _, number = port.rpartition(":")
        client = ModbusTcpClient(host, port=int(number), framer=FramerType.RTU, **options)
    else:
        client = ModbusSerialClient(port, baudrate=BAUD, parity=parity, stopbits=2, **options)
    if not client.connect():
        raise ShownError("connect() returns False")
    text = client.DATATYPE.STRING

    def read(method: Any):
        return lambda at, count: good(method(at, count=count, device_id=UNIT)).registers

    def write(method: Any):
        return lambda at, value: good(method(at, value, device_id=UNIT))

    registers, write_registers = read(client.read_holding_registers), write(client.write_registers)
    return {
        "read-coils": lambda at, count: good(client.read_coils(at, count=count, device_id=UNIT)).bits[:count],
        "read-registers": registers,
        "read-inputs": read(client.read_input_registers),
        "write-coil": lambda at, value: write(client.write_coil)(at, bool(value)),
        "write-register": write(client.write_register),
        "write-coils": lambda at, values: write(client.write_coils)(at, list(map(bool, values))),
        "write-registers": write_registers,
        "read-text": lambda at, count: client.convert_from_registers(registers(at, count), text),
        "write-text": lambda at, value: write_registers(at, client.convert_to_registers(value, text)),
    }


if __name__ == "__main__":
    run_main("pymodbus", Adapter(pymodbus.__version__, (ModbusException,), opened).serve)
