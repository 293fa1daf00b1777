# SPDX-License-Identifier: Apache-2.0
"""Adapter of anymodbus, by its face without async. It sets one stop bit and has no option for two."""

from __future__ import annotations

from importlib.metadata import version

from anymodbus import BusConfig, ModbusError, ModbusExceptionResponse, RetryPolicy, sync

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, serve
from rtl.command import run_main

PARITIES = {"N": "none", "E": "even"}


class Anymodbus(Adapter):
    version = version("anymodbus")
    errors = (ModbusError,)

    def __init__(self, bus: sync.Bus | None = None) -> None:
        self.bus = bus  # it closes the port when nothing refers to it any more
        self.slave = bus.slave(UNIT) if bus else None

    def code_of(self, error: Exception) -> int | None:
        return error.exception_code if isinstance(error, ModbusExceptionResponse) else None

    def read_coils(self, address: int, count: int) -> list[int]:
        return list(self.slave.read_coils(address, count=count))

    def read_registers(self, address: int, count: int) -> list[int]:
        return list(self.slave.read_holding_registers(address, count=count))

    def read_inputs(self, address: int, count: int) -> list[int]:
        return list(self.slave.read_input_registers(address, count=count))

    def write_coil(self, address: int, value: int) -> None:
        self.slave.write_coil(address, on=bool(value))

    def write_register(self, address: int, value: int) -> None:
        self.slave.write_register(address, value)

    def write_coils(self, address: int, values: list[int]) -> None:
        self.slave.write_coils(address, [bool(v) for v in values])

    def write_registers(self, address: int, values: list[int]) -> None:
        self.slave.write_registers(address, values)

    def read_text(self, address: int, count: int) -> str:
        return self.slave.read_string(address, register_count=count)

    def write_text(self, address: int, text: str) -> None:
        self.slave.write_string(address, text, register_count=len(text) // 2)


def opened(port: str, timeout: float | None, parity: str) -> Anymodbus:
    config = None
    if timeout is not None:
        config = BusConfig(request_timeout=timeout, retries=RetryPolicy(retries=0))
    return Anymodbus(sync.open_modbus_rtu(port, baudrate=BAUD, parity=PARITIES[parity], config=config))


if __name__ == "__main__":
    run_main("anymodbus", lambda: serve(opened, Anymodbus))
