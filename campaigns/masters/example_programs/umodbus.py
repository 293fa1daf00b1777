# SPDX-License-Identifier: Apache-2.0
import serial
from umodbus.client.serial import rtu
from umodbus.exceptions import ModbusError

port = serial.Serial("/dev/ttyUSB0", 9600, parity="N", stopbits=2, timeout=1)
print("40003:", rtu.send_message(rtu.read_holding_registers(1, 2, 1), port))
high, low = rtu.send_message(rtu.read_holding_registers(1, 5139, 2), port)
print("motor current:", (high << 16 | low) / 100, "A")
try:
    rtu.send_message(rtu.read_coils(1, 128, 1), port)
except ModbusError as error:
    print(error)
except KeyError as error:  # a code that is not of the standard
    print("exception", error)
ramp_stop = [0x043C >> i & 1 for i in range(32)]
print("ramp stop accepted:", rtu.send_message(rtu.write_multiple_coils(1, 0, ramp_stop), port))
running = True
while running:  # coil 44 is of the drive's last reply: read a parameter first
    rtu.send_message(rtu.read_holding_registers(1, 5139, 2), port)
    running = rtu.send_message(rtu.read_coils(1, 43, 1), port)[0]
print("stopped")
