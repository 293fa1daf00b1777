# SPDX-License-Identifier: Apache-2.0
"""Builds the Python packages of this project as wheels, into build/wheels: the same bytes at any place."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from rtl.command import run_main
from rtl.sources import ROOT

PACKAGES = ("sw/rtu2fc", "sw/conformance", "tb/agents")
SHARED = ("regs/generated", "sim/drive")  # more folders of which a package takes files
DATE = "315532800"  # 1980, the first year that a zip file knows
IGNORED = shutil.ignore_patterns("build", "*.egg-info", "__pycache__")


class WheelError(Exception):
    """Error for the user, in one line."""


def build(folder: Path) -> list[Path]:
    """The wheels of all packages, from a copy in which no mode is the user's."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as work:
        for name in (*PACKAGES, *SHARED):
            shutil.copytree(ROOT / name, Path(work, name), ignore=IGNORED)
        for package in PACKAGES:
            shutil.copy(ROOT / "LICENSE", Path(work, package))
        for path in Path(work).rglob("*"):
            path.chmod(0o755 if path.is_dir() else 0o644)
        for package in PACKAGES:
            command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation"]
            done = subprocess.run(
                [*command, "-w", folder, Path(work, package)],
                env=os.environ | {"SOURCE_DATE_EPOCH": DATE},
                capture_output=True,
                text=True,
                check=False,
                umask=0o022,
            )
            if done.returncode:
                raise WheelError(f"{package}: {(done.stderr.strip() or 'pip failed').splitlines()[-1]}")
    return sorted(folder.glob("*.whl"))


def main() -> int:
    for path in build(ROOT / "build/wheels"):
        print(path)
    return 0


if __name__ == "__main__":
    run_main("wheels", main, WheelError)
