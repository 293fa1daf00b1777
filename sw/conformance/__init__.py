# SPDX-License-Identifier: Apache-2.0
"""Numbered tests of a Modbus RTU slave, for any driver: README.md beside this file.

All other files are links to the only source of each: those of `rtu2fc grade` and of the agents.
"""

VERSION = "0.2.0"
