# SPDX-License-Identifier: Apache-2.0
"""Adapter of modbus_tk."""

from __future__ import annotations

from importlib.metadata import version

import serial
from modbus_tk import defines, modbus, modbus_rtu

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, serve
from rtl.command import run_main


class ModbusTk(Adapter):
    version = version("modbus_tk")
    errors = (
        modbus.ModbusError,
        modbus.ModbusFunctionNotSupportedError,
        modbus.ModbusInvalidRequestError,
        modbus.ModbusInvalidResponseError,
    )

    def __init__(self, master: modbus_rtu.RtuMaster | None = None) -> None:
        self.master = master

    def code_of(self, error: Exception) -> int | None:
        return error.get_exception_code() if isinstance(error, modbus.ModbusError) else None

    def read_coils(self, address: int, count: int) -> list[int]:
        return list(self.master.execute(UNIT, defines.READ_COILS, address, count))

    def read_registers(self, address: int, count: int) -> list[int]:
        return list(self.master.execute(UNIT, defines.READ_HOLDING_REGISTERS, address, count))

    def read_inputs(self, address: int, count: int) -> list[int]:
        return list(self.master.execute(UNIT, defines.READ_INPUT_REGISTERS, address, count))

    def write_coil(self, address: int, value: int) -> None:
        self.master.execute(UNIT, defines.WRITE_SINGLE_COIL, address, output_value=value)

    def write_register(self, address: int, value: int) -> None:
        self.master.execute(UNIT, defines.WRITE_SINGLE_REGISTER, address, output_value=value)

    def write_coils(self, address: int, values: list[int]) -> None:
        self.master.execute(UNIT, defines.WRITE_MULTIPLE_COILS, address, output_value=values)

    def write_registers(self, address: int, values: list[int]) -> None:
        self.master.execute(UNIT, defines.WRITE_MULTIPLE_REGISTERS, address, output_value=values)


def opened(port: str, timeout: float | None, parity: str) -> ModbusTk:
    master = modbus_rtu.RtuMaster(serial.Serial(port, BAUD, parity=parity, stopbits=2))
    if timeout is not None:
        master.set_timeout(timeout)
    return ModbusTk(master)


if __name__ == "__main__":
    run_main("modbus_tk", lambda: serve(opened, ModbusTk))
