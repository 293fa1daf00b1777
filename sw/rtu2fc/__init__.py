# SPDX-License-Identifier: Apache-2.0
"""The command `rtu2fc`: asks, checks and watches a Modbus RTU card of a VLT drive over a serial adapter.

This folder is the package `rtu2fc` of the wheel (`make wheels`) and `sw.rtu2fc` of this project's own tests.
It imports nothing else of the project. Frames, the card's rates and the drives' tables have their only source
in other folders: the wheel holds them (setup.py), and a clone finds them there.
"""

from pathlib import Path

VERSION = "0.2.0"

_root = Path(__file__).resolve().parents[2]
if (_root / "regs/card.toml").exists():
    __path__ += [str(_root / folder) for folder in ("tb/agents", "regs/generated", "sim/drive")]
