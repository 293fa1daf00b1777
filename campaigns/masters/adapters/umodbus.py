# SPDX-License-Identifier: Apache-2.0
"""Adapter of umodbus. The time-out is that of the serial port, which without one waits for ever."""

from __future__ import annotations

from importlib.metadata import version

import serial
from umodbus.client.serial import rtu
from umodbus.exceptions import ModbusError

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, Calls
from rtl.command import run_main

REQUESTS = {
    "read-coils": rtu.read_coils,
    "read-registers": rtu.read_holding_registers,
    "read-inputs": rtu.read_input_registers,
    "write-coil": rtu.write_single_coil,
    "write-register": rtu.write_single_register,
    "write-coils": rtu.write_multiple_coils,
    "write-registers": rtu.write_multiple_registers,
}


def opened(name: str, timeout: float | None, parity: str) -> Calls:
    port = serial.Serial(name, BAUD, parity=parity, stopbits=2, timeout=timeout)

    def call(request):
        return lambda at, what: rtu.send_message(request(UNIT, at, what), port)

    return {what: call(request) for what, request in REQUESTS.items()}


if __name__ == "__main__":
    adapter = Adapter(
        version("uModbus"), (ModbusError,), opened, lambda error: getattr(error, "error_code", None)
    )
    run_main("umodbus", adapter.serve)
