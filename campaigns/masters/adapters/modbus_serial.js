// SPDX-License-Identifier: Apache-2.0
// Adapter of modbus-serial: requests and answers as in common.py.
"use strict";
const readline = require("readline");

const BAUD = 9600;
const UNIT = 1;
const PARITIES = { N: "none", E: "even" };
const ModbusRTU = require("modbus-serial");
const { version } = require("modbus-serial/package.json");

const client = new ModbusRTU();
const [port, timeout, parity] = process.argv.slice(2);

function tell(answer) {
  process.stdout.write(JSON.stringify(answer) + "\n");
}

// The library rejects with an Error; a number of the exception is its property modbusCode.
function failed(error) {
  const said = `${error.name}: ${error.message}`;
  return error.modbusCode === undefined ? { shows: said } : { shows: said, code: error.modbusCode };
}

async function ask(line) {
  const [what, address, ...rest] = line.trim().split(/\s+/);
  const at = Number(address);
  const values = rest.map(Number);
  switch (what) {
    case "read-coils":
      return { values: (await client.readCoils(at, values[0])).data.slice(0, values[0]).map(Number) };
    case "read-registers":
      return { values: (await client.readHoldingRegisters(at, values[0])).data };
    case "read-inputs":
      return { values: (await client.readInputRegisters(at, values[0])).data };
    case "read-text":
      return { text: (await client.readHoldingRegisters(at, values[0])).buffer.toString("latin1") };
    case "write-coil":
      await client.writeCoil(at, values[0] !== 0);
      return { done: true };
    case "write-register":
      await client.writeRegister(at, values[0]);
      return { done: true };
    case "write-coils":
      await client.writeCoils(at, values.map(Boolean));
      return { done: true };
    case "write-registers":
      await client.writeRegisters(at, values);
      return { done: true };
    case "write-text":
      await client.writeRegisters(at, Buffer.from(rest[0], "hex"));
      return { done: true };
    default:
      throw new Error(`unknown request ${what}`);
  }
}

async function main() {
  try {
    await client.connectRTUBuffered(port, { baudRate: BAUD, parity: PARITIES[parity], stopBits: 2 });
  } catch (error) {
    tell(failed(error));
    process.exit(0);
  }
  client.setID(UNIT);
  if (timeout !== "default") client.setTimeout(1000 * Number(timeout));
  tell({ ready: version });
  for await (const line of readline.createInterface({ input: process.stdin })) {
    try {
      tell(await ask(line));
    } catch (error) {
      tell(failed(error));
    }
  }
  process.exit(0);
}

main();
