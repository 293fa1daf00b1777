# SPDX-License-Identifier: Apache-2.0
"""Puts the masters below build/masters: those in Python, the older pymodbus, modbus-serial, one adapter.

Versions: requirements.txt, pymodbus-2.txt and package-lock.json of this folder. mbpoll, socat and libmodbus
are Debian packages (tools/setup.sh, layer `masters`). A second call finds everything in place and ends.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

from campaigns.masters.masters import FOLDER, HERE, LIBMODBUS, NODE_MODULES, OLD_PYMODBUS, PYTHON

COMMANDS = ("gcc", "mbpoll", "socat", "node", "npm")
OLDEST, NEWEST = 13, 19  # minor versions of Python 3: anymodbus needs 3.13, tmodbus 3.12
PIP = ("-m", "pip", "install", "-q", "--disable-pip-version-check", "--no-input")


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


def stamp(*paths: Path) -> str:
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()


def part(name: str, content: str, target: Path, what: str, make: Callable[[], None]) -> None:
    """Makes a part anew if its sources have changed."""
    mark = FOLDER / f"{name}.stamp"
    if target.exists() and mark.exists() and mark.read_text() == content:
        return
    print(f"masters: {what}", flush=True)
    mark.unlink(missing_ok=True)
    make()
    mark.write_text(content)


def environment() -> None:
    shutil.rmtree(FOLDER / "venv", ignore_errors=True)
    run(find_python(), "-m", "venv", FOLDER / "venv")
    run(PYTHON, *PIP, "-r", "requirements.txt")


def old_pymodbus() -> None:
    shutil.rmtree(OLD_PYMODBUS, ignore_errors=True)
    run(PYTHON, *PIP, "--no-deps", "--target", OLD_PYMODBUS, "-r", "pymodbus-2.txt")


def node() -> None:
    folder = NODE_MODULES.parent
    folder.mkdir(exist_ok=True)
    for name in ("package.json", "package-lock.json"):
        shutil.copy(HERE / name, folder)
    # Without install scripts: the package of the serial port brings its library ready-made.
    run("npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--silent", folder=folder)


def libmodbus() -> None:
    run("gcc", "-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-o", LIBMODBUS, source(), "-lmodbus")


def source() -> Path:
    return HERE / "adapters/libmodbus.c"


def install() -> None:
    """Everything; InstallError in one line for the first thing that is missing."""
    missing = [name for name in COMMANDS if shutil.which(name) is None]
    if missing:
        raise InstallError(f"{', '.join(missing)}: not installed; run `tools/setup.sh masters`")
    FOLDER.mkdir(parents=True, exist_ok=True)
    pins, old = HERE / "requirements.txt", HERE / "pymodbus-2.txt"
    common = HERE.parents[1] / "requirements.txt"
    downloads = "downloading the masters in Python into build/masters/venv"
    part("venv", stamp(pins, common), PYTHON, downloads, environment)
    part(
        "old",
        stamp(pins, old),
        OLD_PYMODBUS,
        "downloading pymodbus 2 into build/masters/pymodbus2",
        old_pymodbus,
    )
    packages = "downloading modbus-serial from npm into build/masters/node"
    part("node", stamp(HERE / "package-lock.json"), NODE_MODULES, packages, node)
    part("libmodbus", stamp(source()), LIBMODBUS, "compiling the adapter of libmodbus", libmodbus)
