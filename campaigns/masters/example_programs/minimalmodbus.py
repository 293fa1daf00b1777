# SPDX-License-Identifier: Apache-2.0
import minimalmodbus

drive = minimalmodbus.Instrument("/dev/ttyUSB0", 1)
drive.serial.baudrate = 9600
drive.serial.parity = "N"
drive.serial.stopbits = 2
drive.serial.timeout = 1
print("40003:", drive.read_register(2))
print("motor current:", drive.read_long(5139) / 100, "A")
try:
    drive.read_bit(128, functioncode=1)
except minimalmodbus.SlaveReportedException as error:
    print(error)
drive.write_bits(0, [0x043C >> i & 1 for i in range(32)])
print("ramp stop accepted")
running = True
while running:  # coil 44 is of the drive's last reply: read a parameter first
    drive.read_long(5139)
    running = drive.read_bit(43, functioncode=1)
print("stopped")
