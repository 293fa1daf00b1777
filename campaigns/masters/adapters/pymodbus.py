# SPDX-License-Identifier: Apache-2.0
"""Adapter of pymodbus 3.10 or newer, on a serial port, or RTU over TCP."""

from __future__ import annotations

from typing import Any

import pymodbus
from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ModbusException

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, ShownError, serve
from rtl.command import run_main


class Pymodbus(Adapter):
    version = pymodbus.__version__
    errors = (ModbusException,)

    def __init__(self, client: ModbusSerialClient | ModbusTcpClient | None = None) -> None:
        self.client = client

    def _good(self, response: Any) -> Any:
        if response.isError():
            raise ShownError(str(response), response.exception_code)
        return response

    def read_coils(self, address: int, count: int) -> list[int]:
        return self._good(self.client.read_coils(address, count=count, device_id=UNIT)).bits[:count]

    def read_registers(self, address: int, count: int) -> list[int]:
        return self._good(self.client.read_holding_registers(address, count=count, device_id=UNIT)).registers

    def read_inputs(self, address: int, count: int) -> list[int]:
        return self._good(self.client.read_input_registers(address, count=count, device_id=UNIT)).registers

    def write_coil(self, address: int, value: int) -> None:
        self._good(self.client.write_coil(address, bool(value), device_id=UNIT))

    def write_register(self, address: int, value: int) -> None:
        self._good(self.client.write_register(address, value, device_id=UNIT))

    def write_coils(self, address: int, values: list[int]) -> None:
        self._good(self.client.write_coils(address, [bool(v) for v in values], device_id=UNIT))

    def write_registers(self, address: int, values: list[int]) -> None:
        self._good(self.client.write_registers(address, values, device_id=UNIT))

    def read_text(self, address: int, count: int) -> str:
        registers = self.read_registers(address, count)
        return self.client.convert_from_registers(registers, self.client.DATATYPE.STRING)

    def write_text(self, address: int, text: str) -> None:
        self.write_registers(address, self.client.convert_to_registers(text, self.client.DATATYPE.STRING))


def opened(port: str, timeout: float | None, parity: str) -> Pymodbus:
    options: dict[str, Any] = {} if timeout is None else {"timeout": timeout, "retries": 0}
    if ":" in port:
        host, _, number = port.rpartition(":")
        client = ModbusTcpClient(host, port=int(number), framer=FramerType.RTU, **options)
    else:
        client = ModbusSerialClient(port, baudrate=BAUD, parity=parity, stopbits=2, **options)
    if not client.connect():
        raise ShownError("connect() returns False")
    return Pymodbus(client)


if __name__ == "__main__":
    run_main("pymodbus", lambda: serve(opened, Pymodbus))
