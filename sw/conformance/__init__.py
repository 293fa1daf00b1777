# SPDX-License-Identifier: Apache-2.0
"""Numbered tests of a Modbus RTU slave, for any driver: README.md beside this file.

Its files are those of `rtu2fc grade` and of the agents; setup.py takes them into the wheel.
"""

VERSION = "0.2.0"
