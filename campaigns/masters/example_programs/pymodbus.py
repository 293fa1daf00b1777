# SPDX-License-Identifier: Apache-2.0
from pymodbus.client import ModbusSerialClient

client = ModbusSerialClient("/dev/ttyUSB0", baudrate=9600, parity="N", stopbits=2, timeout=1, retries=0)
client.connect()
print("40003:", client.read_holding_registers(2, count=1, device_id=1).registers)
current = client.read_holding_registers(5139, count=2, device_id=1)
print("motor current:", client.convert_from_registers(current.registers, client.DATATYPE.UINT32) / 100, "A")
answer = client.read_coils(128, count=1, device_id=1)
if answer.isError():
    print("exception", answer.exception_code)
ramp_stop = [bool(0x043C >> i & 1) for i in range(32)]
print("ramp stop accepted:", not client.write_coils(0, ramp_stop, device_id=1).isError())
running = True
while running:  # coil 44 is of the drive's last reply: read a parameter first
    current = client.read_holding_registers(5139, count=2, device_id=1)
    running = current.isError() or client.read_coils(43, count=1, device_id=1).bits[0]
print("stopped")
client.close()
