# SPDX-License-Identifier: Apache-2.0
from anymodbus import BusConfig, ModbusExceptionResponse, RetryPolicy
from anymodbus.sync import open_modbus_rtu

config = BusConfig(request_timeout=1, retries=RetryPolicy(retries=0))
with open_modbus_rtu("/dev/ttyUSB0", baudrate=9600, parity="none", config=config) as bus:
    drive = bus.slave(1)
    print("40003:", drive.read_holding_registers(2, count=1))
    high, low = drive.read_holding_registers(5139, count=2)
    print("motor current:", (high << 16 | low) / 100, "A")
    try:
        drive.read_coils(128, count=1)
    except ModbusExceptionResponse as error:
        print("exception", error.exception_code)
    drive.write_coils(0, [bool(0x043C >> i & 1) for i in range(32)])
    print("ramp stop accepted")
    running = True
    while running:  # coil 44 is of the drive's last reply: read a parameter first
        drive.read_holding_registers(5139, count=2)
        running = drive.read_coils(43, count=1)[0]
    print("stopped")
