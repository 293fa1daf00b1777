# SPDX-License-Identifier: Apache-2.0
"""Adapter of libmodbus, the C library itself.

`code` stands in an answer for the codes 1-11 of the standard alone, because libmodbus gives no number for
others.
"""

from __future__ import annotations

import ctypes

from campaigns.masters.adapters.common import BAUD, UNIT, Adapter, Calls, ShownError
from rtl.command import run_main

LIBRARY = ctypes.CDLL("libmodbus.so.5", use_errno=True)
LIBRARY.modbus_new_rtu.restype = ctypes.c_void_p
LIBRARY.modbus_strerror.restype = ctypes.c_char_p
BASE, STANDARD = 112345678, 12  # MODBUS_ENOBASE; the codes below are the standard's
BIT, WORD = ctypes.c_uint8, ctypes.c_uint16


def good(result: int) -> int:
    if result < 0:
        number = ctypes.get_errno()
        code = number - BASE if BASE < number < BASE + STANDARD else None
        raise ShownError(LIBRARY.modbus_strerror(number).decode(), code)
    return result


def opened(port: str, timeout: float | None, parity: str) -> Calls:
    found = LIBRARY.modbus_new_rtu(port.encode(), BAUD, ctypes.c_char(parity.encode()), 8, 2)
    bus = ctypes.c_void_p(found)
    if not found or LIBRARY.modbus_set_slave(bus, UNIT) < 0 or LIBRARY.modbus_connect(bus) < 0:
        good(-1)
    if timeout is not None:
        whole = int(timeout)
        LIBRARY.modbus_set_response_timeout(bus, whole, int(1e6 * (timeout - whole)))

    def read(function, kind):
        def call(at: int, count: int) -> list[int]:
            values = (kind * count)()
            return list(values[: good(function(bus, at, count, values))])

        return call

    def write(function, kind):
        return lambda at, values: good(function(bus, at, len(values), (kind * len(values))(*values)))

    return {
        "read-coils": read(LIBRARY.modbus_read_bits, BIT),
        "read-registers": read(LIBRARY.modbus_read_registers, WORD),
        "read-inputs": read(LIBRARY.modbus_read_input_registers, WORD),
        "write-coil": lambda at, value: good(LIBRARY.modbus_write_bit(bus, at, value)),
        "write-register": lambda at, value: good(LIBRARY.modbus_write_register(bus, at, value)),
        "write-coils": write(LIBRARY.modbus_write_bits, BIT),
        "write-registers": write(LIBRARY.modbus_write_registers, WORD),
    }


def version() -> str:
    parts = (
        ctypes.c_uint.in_dll(LIBRARY, f"libmodbus_version_{part}") for part in ("major", "minor", "micro")
    )
    return ".".join(str(part.value) for part in parts)


if __name__ == "__main__":
    run_main("libmodbus", Adapter(version(), (), opened).serve)
