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
        ramp_stop = [bool(0x043C >> i & 1) for i in range(32)]
        print("ramp stop:", await drive.write_multiple_coils(0, ramp_stop))
        try:
            await drive.read_coils(128, 1)
        except ModbusResponseError as error:
            print("exception", error.error_code)


asyncio.run(main())
