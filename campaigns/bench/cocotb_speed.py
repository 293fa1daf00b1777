# SPDX-License-Identifier: Apache-2.0
"""How fast cocotb simulates the idle card at its own clock; campaigns/bench/run.py runs it on both
simulators."""

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import Timer

from campaigns.bench.wave import CLK_HZ

SIMULATED_MS = 5


@cocotb.test
async def idle(dut):
    dut.sw_baud.value = 0b11111
    dut.sw_addr.value = 1
    dut.modbus_rx.value = 1
    dut.drive_rx.value = 1
    dut.rst_n.value = 0
    Clock(dut.clk, round(1e12 / CLK_HZ / 2) * 2, unit="ps").start()
    await Timer(1, unit="us")
    dut.rst_n.value = 1
    await Timer(SIMULATED_MS, unit="ms")
