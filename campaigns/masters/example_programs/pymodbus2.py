# SPDX-License-Identifier: Apache-2.0
from pymodbus.client.sync import ModbusSerialClient

client = ModbusSerialClient("rtu", port="/dev/ttyUSB0", baudrate=9600, parity="N", stopbits=2, timeout=1)
client.connect()
print("40003:", client.read_holding_registers(2, 1, unit=1).registers)
high, low = client.read_holding_registers(5139, 2, unit=1).registers
print("motor current:", (high << 16 | low) / 100, "A")
answer = client.read_coils(128, 1, unit=1)
if answer.isError():
    print("exception", answer.exception_code)
ramp_stop = [bool(0x043C >> i & 1) for i in range(32)]
print("ramp stop accepted:", not client.write_coils(0, ramp_stop, unit=1).isError())
running = True
while running:  # coil 44 is of the drive's last reply: read a parameter first
    current = client.read_holding_registers(5139, 2, unit=1)
    running = current.isError() or client.read_coils(43, 1, unit=1).bits[0]
print("stopped")
client.close()
