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
LIBMODBUS = FOLDER / "libmodbus"
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
    adapter: str  # file of adapters/
    example: str  # file of example_programs/
    by_tcp: bool = False
    environment: dict[str, str] = field(default_factory=dict)

    def command(self) -> list[str]:
        name, _, kind = self.adapter.partition(".")
        if kind == "py":
            return [str(PYTHON), "-m", f"campaigns.masters.adapters.{name}"]
        if kind == "js":
            return ["node", str(HERE / "adapters" / self.adapter)]
        return [str(LIBMODBUS)]

    def environ(self) -> dict[str, str]:
        return os.environ | {"NODE_PATH": str(NODE_MODULES), "PYTHONPATH": ""} | self.environment

    @property
    def example_path(self) -> Path:
        return HERE / "example_programs" / self.example


MASTERS = (
    Master("pymodbus", "pymodbus", "pymodbus.py", "pymodbus.py"),
    Master(
        "pymodbus2",
        "pymodbus 2",
        "pymodbus2.py",
        "pymodbus2.py",
        environment={"PYTHONPATH": str(OLD_PYMODBUS)},
    ),
    Master("mbpoll", "mbpoll", "mbpoll.py", "mbpoll.sh"),
    Master("libmodbus", "libmodbus", "libmodbus.c", "libmodbus.c"),
    Master("minimalmodbus", "minimalmodbus", "minimalmodbus.py", "minimalmodbus.py"),
    Master("modbus_tk", "modbus_tk", "modbus_tk.py", "modbus_tk.py"),
    Master("umodbus", "umodbus", "umodbus.py", "umodbus.py"),
    Master("tmodbus", "tmodbus", "tmodbus.py", "tmodbus.py"),
    Master("anymodbus", "anymodbus", "anymodbus.py", "anymodbus.py"),
    Master("modbus-serial", "modbus-serial", "modbus_serial.js", "modbus_serial.js"),
    Master("socat", "RTU over TCP", "pymodbus.py", "socat.py", by_tcp=True),
)
BY_ID = {master.id: master for master in MASTERS}
