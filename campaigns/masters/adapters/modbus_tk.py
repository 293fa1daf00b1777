# SPDX-License-Identifier: Apache-2.0
"""Adapter of modbus_tk."""

from __future__ import annotations

from importlib.metadata import version

import serial
from modbus_tk import defines, modbus, modbus_rtu

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, Calls
from rtl.command import run_main

READS = {
    "read-coils": defines.READ_COILS,
    "read-registers": defines.READ_HOLDING_REGISTERS,
    "read-inputs": defines.READ_INPUT_REGISTERS,
}
WRITES = {
    "write-coil": defines.WRITE_SINGLE_COIL,
    "write-register": defines.WRITE_SINGLE_REGISTER,
    "write-coils": defines.WRITE_MULTIPLE_COILS,
    "write-registers": defines.WRITE_MULTIPLE_REGISTERS,
}
ERRORS = (
    modbus.ModbusError,
    modbus.ModbusFunctionNotSupportedError,
    modbus.ModbusInvalidRequestError,
    modbus.ModbusInvalidResponseError,
)


def opened(port: str, timeout: float | None, parity: str) -> Calls:
    master = modbus_rtu.RtuMaster(serial.Serial(port, BAUD, parity=parity, stopbits=2))
    if timeout is not None:
        master.set_timeout(timeout)

    def read(code: int):
        return lambda at, count: master.execute(UNIT, code, at, count)

    def write(code: int):
        return lambda at, value: master.execute(UNIT, code, at, output_value=value)

    reads = {what: read(code) for what, code in READS.items()}
    return reads | {what: write(code) for what, code in WRITES.items()}


def code_of(error: Exception) -> int | None:
    return error.get_exception_code() if isinstance(error, modbus.ModbusError) else None


if __name__ == "__main__":
    run_main("modbus_tk", Adapter(version("modbus_tk"), ERRORS, opened, code_of).serve)
