# SPDX-License-Identifier: Apache-2.0
"""Adapter of minimalmodbus. Its functions for one register and one bit need the function code by name."""

from __future__ import annotations

import minimalmodbus

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, Calls
from rtl.command import run_main


def opened(port: str, timeout: float | None, parity: str) -> Calls:
    of = minimalmodbus.Instrument(port, UNIT)
    of.serial.baudrate, of.serial.stopbits, of.serial.parity = BAUD, 2, parity
    if timeout is not None:
        of.serial.timeout = timeout
    return {
        "read-coils": lambda at, count: of.read_bits(at, count, functioncode=1),
        "read-registers": of.read_registers,
        "read-inputs": lambda at, count: of.read_registers(at, count, functioncode=4),
        "write-coil": lambda at, value: of.write_bit(at, value, functioncode=5),
        "write-register": lambda at, value: of.write_register(at, value, functioncode=6),
        "write-coils": of.write_bits,
        "write-registers": of.write_registers,
        "read-text": of.read_string,
        "write-text": lambda at, text: of.write_string(at, text, len(text) // 2),
    }


if __name__ == "__main__":
    adapter = Adapter(minimalmodbus.__version__, (minimalmodbus.ModbusException,), opened)
    run_main("minimalmodbus", adapter.serve)
