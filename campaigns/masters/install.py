# SPDX-License-Identifier: Apache-2.0
"""Puts the masters below build/masters: those in Python, the older pymodbus, modbus-serial.

Versions: requirements.txt, pymodbus-2.txt and package.json of this folder. mbpoll, socat and libmodbus are
Debian packages (tools/setup.sh, layer `masters`). A second call finds everything in place and ends.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from pathlib import Path

from campaigns.masters.masters import FOLDER, HERE, NODE_MODULES, OLD_PYMODBUS, PYTHON

COMMANDS = ("gcc", "mbpoll", "socat", "node", "npm")
OLDEST, NEWEST = 13, 19  # minor versions of Python 3: anymodbus needs 3.13, tmodbus 3.12
PIP = ("-m", "pip", "install", "-q", "--disable-pip-version-check", "--no-input")
# Without install scripts: the package of the serial port brings its library ready-made.
NPM = ("npm", "install", "--ignore-scripts", "--no-package-lock", "--no-audit", "--no-fund", "--silent")
PINS = tuple(HERE / name for name in ("requirements.txt", "pymodbus-2.txt", "package.json"))


class InstallError(Exception):
    """Error for the user, in one line."""


def run(*command: str | Path, folder: Path = HERE) -> None:
    words = list(map(str, command))
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr or done.stdout).strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
        raise InstallError(f"{Path(words[0]).name} failed: {last[0]}")


def minor(python: str) -> int:
    """Minor version of an interpreter of Python 3; 0 if it does not start."""
    code = "import sys, venv, ensurepip; print(sys.version_info.minor)"
    try:
        done = subprocess.run([python, "-c", code], capture_output=True, text=True, check=False)
    except OSError:
        return 0
    return int(done.stdout) if re.fullmatch(r"\d+\n", done.stdout) else 0


def find_python() -> str:
    """An interpreter that is new enough: MASTERS_PYTHON, the path, or one of pyenv's."""
    chosen = os.environ.get("MASTERS_PYTHON")
    candidates = [chosen] if chosen else ["python3", *(f"python3.{n}" for n in range(NEWEST, OLDEST - 1, -1))]
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    if not chosen and pyenv.is_dir():
        candidates += sorted(str(path / "bin/python") for path in pyenv.iterdir())
    for candidate in candidates:
        if minor(candidate) >= OLDEST:
            return candidate
    raise InstallError(
        f"no Python 3.{OLDEST} or newer with venv, which anymodbus needs; name one: MASTERS_PYTHON=path"
    )


def install() -> None:
    """Everything; InstallError in one line for the first thing that is missing or cannot be downloaded."""
    if missing := [name for name in COMMANDS if shutil.which(name) is None]:
        raise InstallError(f"{', '.join(missing)}: not installed; run `tools/setup.sh masters`")
    pins = (*PINS, HERE.parents[1] / "requirements.txt")
    mark = FOLDER / hashlib.sha256(b"".join(path.read_bytes() for path in pins)).hexdigest()[:12]
    if mark.exists():
        return
    print("masters: downloading pymodbus, modbus-serial and the others into build/masters", flush=True)
    shutil.rmtree(FOLDER, ignore_errors=True)
    node = NODE_MODULES.parent
    node.mkdir(parents=True)
    run(find_python(), "-m", "venv", FOLDER / "venv")
    run(PYTHON, *PIP, "-r", "requirements.txt")
    run(PYTHON, *PIP, "--no-deps", "--target", OLD_PYMODBUS, "-r", "pymodbus-2.txt")
    shutil.copy(HERE / "package.json", node)
    run(*NPM, folder=node)
    mark.touch()
