# SPDX-License-Identifier: Apache-2.0
"""The example's bench: writes and reads a register of a Modbus RTU slave, judges the edges of each reply.

It imports the installed package alone. run.py passes pins and line of the slave in the variable SLAVE.
"""

from __future__ import annotations

import json
import os

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import Timer
from cocotbext.rtu import edges, rtu
from cocotbext.rtu.crc16 import with_crc
from cocotbext.rtu.modbus_master import ModbusMaster
from cocotbext.rtu.rs485 import Rs485Line
from cocotbext.rtu.uart import Flaws, Format

SLAVE = json.loads(os.environ["SLAVE"])
UNIT, REGISTER, VALUE = SLAVE["unit"], SLAVE["register"], 0x0012
REPLY_PS = 20_000_000_000


async def powered_up(dut) -> ModbusMaster:
    """Clock, reset, a line, and a master on it."""
    clk, rst, rx, tx, de = (getattr(dut, name.strip("!")) for name in SLAVE["pins"])
    active = 0 if SLAVE["pins"][1].startswith("!") else 1
    line = Rs485Line(rx, tx, de, Format.named(SLAVE["baud"], SLAVE["form"]))
    rst.value = active
    for name, value in SLAVE["inputs"].items():
        getattr(dut, name).value = value
    Clock(clk, 2 * round(5e11 / SLAVE["clk_hz"]), unit="ps").start()
    await Timer(10, unit="us")
    rst.value = 1 - active
    await line.source.idle(100)
    return ModbusMaster(line)


async def exchange(master: ModbusMaster, pdu: bytes) -> bytes:
    """The PDU of the reply. The faults of its edges are printed; if the run is strict, they fail the test."""
    done = await master.request(rtu.build(UNIT, pdu), REPLY_PS)
    assert done.reply is not None, f"no reply to {pdu.hex(' ')}"
    await master.line.source.idle(100)
    line = master.line
    found = edges.judge(
        line.monitor, done.reply, request_end_ps=done.sent.end_ps, pulses=line.direction.pulses
    )
    cocotb.log.info("%s: %s", done.reply, "; ".join(found) or "edges good")
    assert not (SLAVE["strict"] and found), found
    assert not line.collisions()
    reply = rtu.parse(done.reply.data)
    assert reply.address == UNIT
    return reply.pdu


@cocotb.test()
async def a_register_that_was_written_is_read_back(dut):
    master = await powered_up(dut)
    write = rtu.write_register(REGISTER, VALUE)
    assert await exchange(master, write) == write
    assert await exchange(master, rtu.read_registers(REGISTER, 1)) == bytes([3, 2, 0, VALUE])


@cocotb.test()
async def a_damaged_frame_has_no_reply(dut):
    master = await powered_up(dut)
    good = rtu.build(UNIT, rtu.read_registers(REGISTER, 1))
    assert (await master.request(good[:-1] + bytes([good[-1] ^ 1]), REPLY_PS)).reply is None
    assert (await master.request(with_crc(bytes([UNIT + 1]) + good[1:-2]), REPLY_PS)).reply is None
    if "N" not in SLAVE["form"]:
        assert (await master.request(good, REPLY_PS, Flaws(bad_parity=(3,)))).reply is None
    assert (await master.request(good, REPLY_PS)).reply is not None
