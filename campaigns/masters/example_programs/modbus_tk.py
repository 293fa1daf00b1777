# SPDX-License-Identifier: Apache-2.0
import serial
from modbus_tk import defines
from modbus_tk.modbus import ModbusError
from modbus_tk.modbus_rtu import RtuMaster

master = RtuMaster(serial.Serial("/dev/ttyUSB0", 9600, parity="N", stopbits=2))
master.set_timeout(1)
print("40003:", master.execute(1, defines.READ_HOLDING_REGISTERS, 2, 1))
(current,) = master.execute(1, defines.READ_HOLDING_REGISTERS, 5139, 2, data_format=">L")
print("motor current:", current / 100, "A")
try:
    master.execute(1, defines.READ_COILS, 128, 1)
except ModbusError as error:
    print("exception", error.get_exception_code())
ramp_stop = [0x043C >> i & 1 for i in range(32)]
print("ramp stop accepted:", master.execute(1, defines.WRITE_MULTIPLE_COILS, 0, output_value=ramp_stop))
running = True
while running:  # coil 44 is of the drive's last reply: read a parameter first
    master.execute(1, defines.READ_HOLDING_REGISTERS, 5139, 2)
    running = master.execute(1, defines.READ_COILS, 43, 1)[0]
print("stopped")
