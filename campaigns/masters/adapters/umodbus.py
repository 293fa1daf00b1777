# SPDX-License-Identifier: Apache-2.0
"""Adapter of umodbus. The time-out is that of the serial port, which without one waits for ever."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

import serial
from umodbus.client.serial import rtu
from umodbus.exceptions import ModbusError

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, serve
from rtl.command import run_main


class Umodbus(Adapter):
    version = version("uModbus")
    errors = (ModbusError,)

    def __init__(self, port: serial.Serial | None = None) -> None:
        self.port = port

    def code_of(self, error: Exception) -> int | None:
        return getattr(error, "error_code", None)

    def _send(self, adu: bytes) -> Any:
        return rtu.send_message(adu, self.port)

    def read_coils(self, address: int, count: int) -> list[int]:
        return self._send(rtu.read_coils(UNIT, address, count))

    def read_registers(self, address: int, count: int) -> list[int]:
        return self._send(rtu.read_holding_registers(UNIT, address, count))

    def read_inputs(self, address: int, count: int) -> list[int]:
        return self._send(rtu.read_input_registers(UNIT, address, count))

    def write_coil(self, address: int, value: int) -> None:
        self._send(rtu.write_single_coil(UNIT, address, value))

    def write_register(self, address: int, value: int) -> None:
        self._send(rtu.write_single_register(UNIT, address, value))

    def write_coils(self, address: int, values: list[int]) -> None:
        self._send(rtu.write_multiple_coils(UNIT, address, values))

    def write_registers(self, address: int, values: list[int]) -> None:
        self._send(rtu.write_multiple_registers(UNIT, address, values))


def opened(port: str, timeout: float | None, parity: str) -> Umodbus:
    return Umodbus(serial.Serial(port, BAUD, parity=parity, stopbits=2, timeout=timeout))


if __name__ == "__main__":
    run_main("umodbus", lambda: serve(opened, Umodbus))
