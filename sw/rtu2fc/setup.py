# SPDX-License-Identifier: Apache-2.0
"""Takes the files that this package shares with other folders of the project into the wheel."""

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parents[2]
SHARED = [f"tb/agents/{name}.py" for name in ("crc16", "edges", "line", "rtu")]
SHARED += ["regs/generated/card_tables.py"]
SHARED += [str(path.relative_to(ROOT)) for path in sorted(ROOT.glob("sim/drive/*.csv"))]


class WithShared(build_py):
    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        package = Path(self.build_lib, "rtu2fc")
        for path in SHARED:
            self.copy_file(str(ROOT / path), str(package / Path(path).name))
        (package / "setup.py").unlink()


if __name__ == "__main__":
    setup(cmdclass={"build_py": WithShared})
