# SPDX-License-Identifier: Apache-2.0
"""Adapter of tmodbus, which is for asyncio alone."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from importlib.metadata import version
from typing import Any

import tmodbus
from tmodbus.exceptions import ModbusResponseError, TModbusError

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, serve
from rtl.command import run_main


class Tmodbus(Adapter):
    version = version("tmodbus")
    errors = (TModbusError, TimeoutError)

    def __init__(self, loop: asyncio.Runner | None = None, client: Any = None) -> None:
        self.loop, self.client = loop, client

    def code_of(self, error: Exception) -> int | None:
        return error.error_code if isinstance(error, ModbusResponseError) else None

    def _run(self, call: Coroutine) -> Any:
        return self.loop.run(call)

    def read_coils(self, address: int, count: int) -> list[int]:
        return self._run(self.client.read_coils(address, count))

    def read_registers(self, address: int, count: int) -> list[int]:
        return self._run(self.client.read_holding_registers(address, count))

    def read_inputs(self, address: int, count: int) -> list[int]:
        return self._run(self.client.read_input_registers(address, count))

    def write_coil(self, address: int, value: int) -> None:
        self._run(self.client.write_single_coil(address, bool(value)))

    def write_register(self, address: int, value: int) -> None:
        self._run(self.client.write_single_register(address, value))

    def write_coils(self, address: int, values: list[int]) -> None:
        self._run(self.client.write_multiple_coils(address, [bool(v) for v in values]))

    def write_registers(self, address: int, values: list[int]) -> None:
        self._run(self.client.write_multiple_registers(address, values))

    def read_text(self, address: int, count: int) -> str:
        return self._run(self.client.read_string(address, number_of_registers=count))

    def write_text(self, address: int, text: str) -> None:
        self._run(self.client.write_string(address, text, number_of_registers=len(text) // 2))


def opened(port: str, timeout: float | None, parity: str) -> Tmodbus:
    loop = asyncio.Runner()
    client = tmodbus.create_async_rtu_client(
        port, unit_id=UNIT, timeout=timeout, baudrate=BAUD, parity=parity, stopbits=2
    )
    loop.run(client.connect())
    return Tmodbus(loop, client)


if __name__ == "__main__":
    run_main("tmodbus", lambda: serve(opened, Tmodbus))
