# SPDX-License-Identifier: Apache-2.0
import asyncio

from tmodbus import create_async_rtu_client
from tmodbus.exceptions import ModbusResponseError


async def main() -> None:
    line = {"baudrate": 9600, "parity": "N", "stopbits": 2}
    client = create_async_rtu_client("/dev/ttyUSB0", unit_id=1, timeout=1, retry_on_device_busy=False, **line)
    async with client as drive:
        print("40003:", await drive.read_holding_registers(2, 1))
        high, low = await drive.read_holding_registers(5139, 2)
        print("motor current:", (high << 16 | low) / 100, "A")
        try:
            await drive.read_coils(128, 1)
        except ModbusResponseError as error:
            print("exception", error.error_code)
        ramp_stop = [bool(0x043C >> i & 1) for i in range(32)]
        print("ramp stop accepted:", await drive.write_multiple_coils(0, ramp_stop))
        running = True
        while running:  # coil 44 is of the drive's last reply: read a parameter first
            await drive.read_holding_registers(5139, 2)
            running = (await drive.read_coils(43, 1))[0]
        print("stopped")


asyncio.run(main())
