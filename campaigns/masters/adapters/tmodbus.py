# SPDX-License-Identifier: Apache-2.0
"""Adapter of tmodbus, which is for asyncio alone."""

from __future__ import annotations

import asyncio
from importlib.metadata import version

import tmodbus
from tmodbus.exceptions import ModbusResponseError, TModbusError

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, Calls
from rtl.command import run_main

METHODS = {
    "read-coils": "read_coils",
    "read-registers": "read_holding_registers",
    "read-inputs": "read_input_registers",
    "write-register": "write_single_register",
    "write-registers": "write_multiple_registers",
}


def opened(port: str, timeout: float | None, parity: str) -> Calls:
    loop = asyncio.Runner()
    client = tmodbus.create_async_rtu_client(
        port, unit_id=UNIT, timeout=timeout, baudrate=BAUD, parity=parity, stopbits=2
    )
    loop.run(client.connect())

    def call(method: str):
        return lambda at, what: loop.run(getattr(client, method)(at, what))

    return {what: call(method) for what, method in METHODS.items()} | {
        "write-coil": lambda at, value: loop.run(client.write_single_coil(at, bool(value))),
        "write-coils": lambda at, values: loop.run(client.write_multiple_coils(at, list(map(bool, values)))),
        "read-text": lambda at, count: loop.run(client.read_string(at, number_of_registers=count)),
        "write-text": lambda at, text: loop.run(
            client.write_string(at, text, number_of_registers=len(text) // 2)
        ),
    }


def code_of(error: Exception) -> int | None:
    return error.error_code if isinstance(error, ModbusResponseError) else None


if __name__ == "__main__":
    run_main("tmodbus", Adapter(version("tmodbus"), (TModbusError, TimeoutError), opened, code_of).serve)
