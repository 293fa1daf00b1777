# SPDX-License-Identifier: Apache-2.0
"""Agents for Modbus RTU and FC lines under cocotb: README.md beside this file.

uart, rs485, modbus_master and fc_slave need cocotb and a simulator. line, edges, rtu and crc16 need nothing.
This folder is the package `tb.agents` of the project's own benches, and the package `cocotbext.rtu` where it
is installed (pyproject.toml). It imports nothing from the rest of the project.
"""
