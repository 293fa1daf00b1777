# SPDX-License-Identifier: Apache-2.0
"""The masters of the matrix, and the commands of their adapters and examples.

`install` (campaigns/masters/install.py) puts the masters into build/masters.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from rtl.sources import ROOT

FOLDER = ROOT / "build/masters"
HERE = ROOT / "campaigns/masters"
PYTHON = FOLDER / "venv/bin/python"
OLD_PYMODBUS = FOLDER / "pymodbus2"
NODE_MODULES = FOLDER / "node/node_modules"
# Device that the examples name; the campaign puts the pty's name in its place.
PORT = "/dev/ttyUSB0"
# Joins a TCP port and the serial line; the example of RTU over TCP names the same port.
TCP_PORT = "5020"
SOCAT = ("TCP-LISTEN:{tcp},bind=127.0.0.1,reuseaddr,fork", "OPEN:{device},rawer,b9600,cstopb=1")


@dataclass(frozen=True)
class Master:
    """`by_tcp`: reaches the card through socat, which joins a TCP port and the serial line."""

    id: str
    title: str
    adapter: str  # module or program of adapters/
    example: str  # file of example_programs/
    by_tcp: bool = False
    environment: dict[str, str] = field(default_factory=dict)

    def command(self) -> list[str]:
        if self.adapter.endswith(".js"):
            return ["node", str(HERE / "adapters" / self.adapter)]
        return [str(PYTHON), "-m", f"campaigns.masters.adapters.{self.adapter}"]

    def environ(self) -> dict[str, str]:
        return os.environ | {"NODE_PATH": str(NODE_MODULES), "PYTHONPATH": ""} | self.environment

    @property
    def example_path(self) -> Path:
        return HERE / "example_programs" / self.example


OLD = {"PYTHONPATH": str(OLD_PYMODBUS)}
MASTERS = (
    Master("pymodbus", "pymodbus", "pymodbus", "pymodbus.py"),
    Master("pymodbus2", "pymodbus 2", "pymodbus2", "pymodbus2.py", environment=OLD),
    Master("mbpoll", "mbpoll", "mbpoll", "mbpoll.sh"),
    Master("libmodbus", "libmodbus", "libmodbus", "libmodbus.c"),
    Master("minimalmodbus", "minimalmodbus", "minimalmodbus", "minimalmodbus.py"),
    Master("modbus_tk", "modbus_tk", "modbus_tk", "modbus_tk.py"),
    Master("umodbus", "umodbus", "umodbus", "umodbus.py"),
    Master("tmodbus", "tmodbus", "tmodbus", "tmodbus.py"),
    Master("anymodbus", "anymodbus", "anymodbus", "anymodbus.py"),
    Master("modbus-serial", "modbus-serial", "modbus_serial.js", "modbus_serial.js"),
    Master("socat", "RTU over TCP", "pymodbus", "socat.py", by_tcp=True),
)
BY_ID = {master.id: master for master in MASTERS}
