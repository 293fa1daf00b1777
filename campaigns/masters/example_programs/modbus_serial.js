// SPDX-License-Identifier: Apache-2.0
const ModbusRTU = require("modbus-serial");

async function main() {
  const drive = new ModbusRTU();
  await drive.connectRTUBuffered("/dev/ttyUSB0", { baudRate: 9600, parity: "none", stopBits: 2 });
  drive.setID(1);
  drive.setTimeout(1000);
  console.log("40003:", (await drive.readHoldingRegisters(2, 1)).data);
  const current = await drive.readHoldingRegisters(5139, 2);
  console.log("motor current:", current.buffer.readUInt32BE() / 100, "A");
  await drive.readCoils(128, 1).catch((error) => console.log("exception", error.modbusCode));
  await drive.writeCoils(0, Array.from({ length: 32 }, (_, i) => Boolean((0x043c >> i) & 1)));
  console.log("ramp stop accepted");
  let running = true;
  while (running) {
    await drive.readHoldingRegisters(5139, 2); // coil 44 is of the drive's last reply: read a parameter first
    running = (await drive.readCoils(43, 1)).data[0];
  }
  console.log("stopped");
  drive.close(() => process.exit());
}

main();
