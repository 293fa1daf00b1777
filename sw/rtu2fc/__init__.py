# SPDX-License-Identifier: Apache-2.0
"""The command `rtu2fc`: asks, checks and watches a Modbus RTU card of a VLT drive over a serial adapter.

This folder is the package `rtu2fc` of the wheel (`make wheels`) and `sw.rtu2fc` of this project's own tests.
It imports nothing else of the project. Some of its files are links to the only source of frames, words and
tables.
"""

VERSION = "0.2.0"
