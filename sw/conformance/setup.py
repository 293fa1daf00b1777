# SPDX-License-Identifier: Apache-2.0
"""Takes the cases and what they need into the wheel: the files of `rtu2fc grade` and of the agents."""

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parents[2]
SHARED = [f"sw/rtu2fc/{name}.py" for name in ("cases", "engine", "problem")]
SHARED += [f"tb/agents/{name}.py" for name in ("crc16", "edges", "line", "rtu")]


class WithShared(build_py):
    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        package = Path(self.build_lib, "modbus_rtu_conformance")
        for path in SHARED:
            self.copy_file(str(ROOT / path), str(package / Path(path).name))
        (package / "setup.py").unlink()


if __name__ == "__main__":
    setup(cmdclass={"build_py": WithShared})
