# SPDX-License-Identifier: Apache-2.0
"""Builds and proofs, kept for every checkout on this machine under hashes of everything they were made from.

They lie in ~/.cache/rtu2fc, or below XDG_CACHE_HOME. No path of a checkout is part of a hash, so a second
checkout of the same files compiles nothing. ccache keeps object files there, for what changed in part.
"""

from __future__ import annotations

import fcntl
import functools
import hashlib
import os
import platform
import shutil
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KEPT_BYTES, KEPT_S = 200_000_000, 3600  # of each kind; more only while it is young
CCACHE = {"CCACHE_MAXSIZE": "500M", "CCACHE_BASEDIR": str(ROOT)}


@functools.cache
def folder() -> Path:
    """The cache; where the user's own cannot be written, a folder of the checkout."""
    found = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "rtu2fc"
    try:
        found.mkdir(parents=True, exist_ok=True)
    except OSError:
        found = ROOT / "build/cache"
    return found


def key(*settings: object, files: Iterable[Path] = (), packages: Iterable[str] = (), tool: str = "") -> str:
    """A hash of settings, contents of files, versions of Python packages and what `tool` says of its own."""
    versions = [f"{name} {version(name)}" for name in packages]
    content = hashlib.sha256(f"{settings} {versions} {platform.machine()} {_said(tool)}".encode())
    for path in files:
        content.update(Path(path).name.encode() + b"\0" + Path(path).read_bytes() + b"\0")
    return content.hexdigest()[:20]


@functools.cache
def _said(command: str) -> str:
    """What a tool says of its version."""
    if not command or shutil.which(command.split()[0]) is None:
        return ""
    done = subprocess.run(command.split(), capture_output=True, text=True, check=False)
    return (done.stdout or done.stderr).partition("\n")[0]


def use_ccache() -> None:
    """Compilers that Verilator's and cocotb's makefiles start keep their objects in the cache."""
    if shutil.which("ccache"):
        for name, value in {"OBJCACHE": "ccache", "CCACHE_DIR": str(folder() / "ccache"), **CCACHE}.items():
            os.environ.setdefault(name, value)


def made(kind: str, name: str, make: Callable[[Path], Iterable[Path]]) -> Path:
    """The folder KIND/NAME of the cache; made by `make` unless it is there.

    `make` is given an empty folder inside the checkout, and returns the files in it that are to be kept.
    Relative paths from there to the tools are the same in every checkout. Other processes wait for the first.
    """
    kept = folder() / kind / name
    with _lock(kept.with_name(f"{name}.lock")):
        if not kept.exists():
            work = ROOT / "build" / kind / name
            shutil.rmtree(work, ignore_errors=True)
            work.mkdir(parents=True)
            files = list(make(work))
            # Complete in one step, for the process may be ended at any moment.
            partial = kept.with_name(f"{name}.partial")
            shutil.rmtree(partial, ignore_errors=True)
            partial.mkdir()
            for path in files:
                shutil.move(path, partial / path.name)
            partial.rename(kept)
            shutil.rmtree(work)
            _forget_old(kept.parent)
        os.utime(kept)
    return kept


@contextmanager
def _lock(path: Path) -> Iterator[None]:
    """The system releases the lock if this process dies."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _forget_old(kind: Path) -> None:
    """Removes the builds unused for longest. One used within KEPT_S stays: a process may still load it."""
    found = sorted(((path.stat().st_mtime, path) for path in kind.iterdir() if path.is_dir()), reverse=True)
    size = 0
    for used, path in found:
        size += 4096 + sum(file.stat().st_size for file in path.iterdir())
        if size > KEPT_BYTES and time.time() - used > KEPT_S:
            shutil.rmtree(path, ignore_errors=True)
            path.with_name(f"{path.name}.lock").unlink(missing_ok=True)
