# SPDX-License-Identifier: Apache-2.0
"""Adapter of pymodbus 2, whose calls are the same in all versions before 3.0."""

from __future__ import annotations

from typing import Any

from pymodbus.client.sync import ModbusSerialClient
from pymodbus.exceptions import ModbusException
from pymodbus.version import version

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, ShownError, serve
from rtl.command import run_main


class Pymodbus2(Adapter):
    version = version.short()
    errors = (ModbusException,)

    def __init__(self, client: ModbusSerialClient | None = None) -> None:
        self.client = client

    def _good(self, response: Any) -> Any:
        if response.isError():
            raise ShownError(str(response), getattr(response, "exception_code", None))
        return response

    def read_coils(self, address: int, count: int) -> list[int]:
        return self._good(self.client.read_coils(address, count, unit=UNIT)).bits[:count]

    def read_registers(self, address: int, count: int) -> list[int]:
        return self._good(self.client.read_holding_registers(address, count, unit=UNIT)).registers

    def read_inputs(self, address: int, count: int) -> list[int]:
        return self._good(self.client.read_input_registers(address, count, unit=UNIT)).registers

    def write_coil(self, address: int, value: int) -> None:
        self._good(self.client.write_coil(address, bool(value), unit=UNIT))

    def write_register(self, address: int, value: int) -> None:
        self._good(self.client.write_register(address, value, unit=UNIT))

    def write_coils(self, address: int, values: list[int]) -> None:
        self._good(self.client.write_coils(address, [bool(v) for v in values], unit=UNIT))

    def write_registers(self, address: int, values: list[int]) -> None:
        self._good(self.client.write_registers(address, values, unit=UNIT))


def opened(port: str, timeout: float | None, parity: str) -> Pymodbus2:
    options = {} if timeout is None else {"timeout": timeout}
    client = ModbusSerialClient("rtu", port=port, baudrate=BAUD, parity=parity, stopbits=2, **options)
    if not client.connect():
        raise ShownError("connect() returns False")
    return Pymodbus2(client)


if __name__ == "__main__":
    run_main("old-pymodbus", lambda: serve(opened, Pymodbus2))
