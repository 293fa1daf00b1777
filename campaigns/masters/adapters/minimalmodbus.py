# SPDX-License-Identifier: Apache-2.0
"""Adapter of minimalmodbus. Its functions for one register and one bit need the function code by name."""

from __future__ import annotations

import minimalmodbus

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, serve
from rtl.command import run_main


class Minimalmodbus(Adapter):
    version = minimalmodbus.__version__
    errors = (minimalmodbus.ModbusException,)

    def __init__(self, instrument: minimalmodbus.Instrument | None = None) -> None:
        self.instrument = instrument

    def read_coils(self, address: int, count: int) -> list[int]:
        return self.instrument.read_bits(address, count, functioncode=1)

    def read_registers(self, address: int, count: int) -> list[int]:
        return self.instrument.read_registers(address, count)

    def read_inputs(self, address: int, count: int) -> list[int]:
        return self.instrument.read_registers(address, count, functioncode=4)

    def write_coil(self, address: int, value: int) -> None:
        self.instrument.write_bit(address, value, functioncode=5)

    def write_register(self, address: int, value: int) -> None:
        self.instrument.write_register(address, value, functioncode=6)

    def write_coils(self, address: int, values: list[int]) -> None:
        self.instrument.write_bits(address, values)

    def write_registers(self, address: int, values: list[int]) -> None:
        self.instrument.write_registers(address, values)

    def read_text(self, address: int, count: int) -> str:
        return self.instrument.read_string(address, count)

    def write_text(self, address: int, text: str) -> None:
        self.instrument.write_string(address, text, len(text) // 2)


def opened(port: str, timeout: float | None, parity: str) -> Minimalmodbus:
    instrument = minimalmodbus.Instrument(port, UNIT)
    instrument.serial.baudrate = BAUD
    instrument.serial.stopbits = 2
    instrument.serial.parity = parity
    if timeout is not None:
        instrument.serial.timeout = timeout
    return Minimalmodbus(instrument)


if __name__ == "__main__":
    run_main("minimalmodbus", lambda: serve(opened, Minimalmodbus))
