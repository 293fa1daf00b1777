# SPDX-License-Identifier: Apache-2.0
"""The slaves of two Python libraries, each as a program on a serial port.

    python -m campaigns.conformance.libraries pymodbus PORT UNIT

Both have REGISTERS holding and input registers and COILS coils and discrete inputs, from address 0 on. Ctrl-C
ends the program.
"""

from __future__ import annotations

import sys
import time
from importlib.metadata import version

from rtl.command import run_main

REGISTERS, COILS = 125, 2000
BAUD = 19200


def pymodbus(port: str, unit: int) -> None:
    from pymodbus import FramerType
    from pymodbus.datastore import ModbusDeviceContext, ModbusSequentialDataBlock, ModbusServerContext
    from pymodbus.server import StartSerialServer

    # The block's own first address is 1: the context adds 1 to the address on the wire.
    sizes = {"hr": REGISTERS, "ir": REGISTERS, "co": COILS, "di": COILS}
    blocks = {name: ModbusSequentialDataBlock(1, [0] * size) for name, size in sizes.items()}
    context = ModbusServerContext(devices={unit: ModbusDeviceContext(**blocks)}, single=False)
    StartSerialServer(
        context,
        framer=FramerType.RTU,
        port=port,
        baudrate=BAUD,
        ignore_missing_devices=True,
        broadcast_enable=True,
    )


def modbus_tk(port: str, unit: int) -> None:
    import serial
    from modbus_tk import defines, modbus_rtu

    server = modbus_rtu.RtuServer(serial.Serial(port, BAUD), error_on_missing_slave=False)
    slave = server.add_slave(unit)
    slave.add_block("registers", defines.HOLDING_REGISTERS, 0, REGISTERS)
    slave.add_block("input registers", defines.ANALOG_INPUTS, 0, REGISTERS)
    slave.add_block("coils", defines.COILS, 0, COILS)
    slave.add_block("inputs", defines.DISCRETE_INPUTS, 0, COILS)
    server.start()
    while True:
        time.sleep(1)


SLAVES = {"pymodbus": pymodbus, "modbus_tk": modbus_tk}


def title(name: str) -> str:
    return f"{name} {version(name)}"


def main() -> int:
    if len(sys.argv) != 4 or sys.argv[1] not in SLAVES or not sys.argv[3].isdigit():
        print(f"libraries: say {' or '.join(SLAVES)}, a port and a unit", file=sys.stderr)
        return 2
    SLAVES[sys.argv[1]](sys.argv[2], int(sys.argv[3]))
    return 0


if __name__ == "__main__":
    run_main("libraries", main, OSError)
