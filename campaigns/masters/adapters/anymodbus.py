# SPDX-License-Identifier: Apache-2.0
"""Adapter of anymodbus, by its face without async. It sets one stop bit and has no option for two."""

from __future__ import annotations

from importlib.metadata import version

from anymodbus import BusConfig, ModbusError, ModbusExceptionResponse, RetryPolicy, sync

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, Calls
from rtl.command import run_main

PARITIES = {"N": "none", "E": "even"}


def opened(port: str, timeout: float | None, parity: str) -> Calls:
    config = None
    if timeout is not None:
        config = BusConfig(request_timeout=timeout, retries=RetryPolicy(retries=0))
    bus = sync.open_modbus_rtu(port, baudrate=BAUD, parity=PARITIES[parity], config=config)

    def slave():
        return bus.slave(UNIT)  # the bus closes the port when nothing refers to it any more

    return {
        "read-coils": lambda at, count: slave().read_coils(at, count=count),
        "read-registers": lambda at, count: slave().read_holding_registers(at, count=count),
        "read-inputs": lambda at, count: slave().read_input_registers(at, count=count),
        "write-coil": lambda at, value: slave().write_coil(at, on=bool(value)),
        "write-register": lambda at, value: slave().write_register(at, value),
        "write-coils": lambda at, values: slave().write_coils(at, list(map(bool, values))),
        "write-registers": lambda at, values: slave().write_registers(at, values),
        "read-text": lambda at, count: slave().read_string(at, register_count=count),
        "write-text": lambda at, text: slave().write_string(at, text, register_count=len(text) // 2),
    }


def code_of(error: Exception) -> int | None:
    return error.exception_code if isinstance(error, ModbusExceptionResponse) else None


if __name__ == "__main__":
    run_main("anymodbus", Adapter(version("anymodbus"), (ModbusError,), opened, code_of).serve)
