# SPDX-License-Identifier: Apache-2.0
"""Builds the fuzzer's card: Verilog in, a library for sim/harness/pins.py out.

A build lies in a folder named by everything it was made from, so nothing stale is used and several processes
may share it. A card with a planted bug is built by the same function from changed sources.
"""

from __future__ import annotations

import fcntl
import functools
import hashlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rtl.sources import ROOT, card_files
from sim.harness import registers

BUILD = ROOT / "build/fuzz/cards"
HARNESS = ROOT / "sim/harness/fuzz_card.cpp"
LINES = ROOT / "sim/harness/line_player.h"
WAIVERS = ROOT / "tools/verilator.vlt"
IMAGE = "firmware.hex"  # looked for in the working directory when a card is switched on
KEPT, KEPT_S = 6, 3600  # builds; more only while they are young
FLAGS = (
    *(
        "--cc",
        "--build",
        "-j",
        "1",
        "--top-module",
        "rtu2fc",
        "--no-timing",
        "--no-assert",
        "-O3",
        "-Wno-lint",
    ),
    *("--x-assign", "fast", "--x-initial", "fast", "--timescale-override", "1ns/1ns"),
    *("-CFLAGS", "-fPIC", "-MAKEFLAGS", "PYTHON3=python3 VK_PCH_I_FAST= VK_PCH_I_SLOW= OPT_FAST=-O3"),
    f'-GFIRMWARE_HEX="{IMAGE}"',
)
EXTRA = {"": (), "waves": ("--trace-fst",), "flips": ()}
# All of a library's names stay its own: several are loaded into one process.
LINK = (
    *(
        "-std=c++17",
        "-O3",
        "-fPIC",
        "-shared",
        "-fvisibility-inlines-hidden",
        "-fno-gnu-unique",
        "-Wl,-Bsymbolic",
    ),
    *("-Wall", "-Wextra", "-Werror"),
)


@dataclass(frozen=True)
class Target:
    """A card to be fuzzed: the project's own or one that differs. `images`: folder of the firmware images."""

    sources: tuple[Path, ...] = ()
    parameters: tuple[tuple[str, int], ...] = ()
    images: Path = ROOT / "build"

    @functools.cache  # noqa: B019 - there are only a few of them
    def library(self, clk_hz: int, extra: str = "") -> Path:
        return build(clk_hz, sources=self.sources, parameters=dict(self.parameters), extra=extra)

    def image_folder(self, dialect: str) -> Path:
        folder = self.images if dialect == "card" else self.images / dialect
        if not (folder / IMAGE).exists():
            raise BuildError(f"{(folder / IMAGE).relative_to(ROOT)} is missing; run `make firmware`")
        return folder


class BuildError(Exception):
    """One line that tells the user what is wrong, and then the tool's own words."""


def build(
    clk_hz: int,
    *,
    sources: Sequence[Path] | None = None,
    parameters: Mapping[str, int] | None = None,
    extra: str = "",
) -> Path:
    """The library of the standard card at this clock, made unless this very content was made before.

    `extra`: `waves` for one that writes a waveform, `flips` for one whose variables can be turned over.
    """
    sources = list(sources or card_files())
    settings = {"CLK_HZ": clk_hz, **(parameters or {})}
    waivers = [WAIVERS]
    if extra == "flips":
        found = registers.registers(tuple(sources), clk_hz)
        waivers.append(registers.public(found, registers.FOLDER / f"{clk_hz}.vlt"))
    content = hashlib.sha256(f"{ROOT} {sorted(settings.items())} {extra} {FLAGS} {LINK}".encode())
    for path in (*sources, HARNESS, LINES, *waivers):
        content.update(path.name.encode() + b"\0" + path.read_bytes())
    folder = BUILD / content.hexdigest()[:16]
    made = folder / "libcard.so"
    with _lock():
        if not made.exists():
            _make(made, [*waivers, *sources], settings, extra)
            _forget_old()
        os.utime(folder)
    return made


@contextmanager
def _lock():
    BUILD.mkdir(parents=True, exist_ok=True)
    with open(BUILD / "lock", "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _make(made: Path, sources: Sequence[Path], settings: Mapping[str, int], extra: str) -> None:
    folder = made.parent
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    if shutil.which("ccache"):
        os.environ.setdefault("OBJCACHE", "ccache")
        os.environ.setdefault("CCACHE_DIR", str(ROOT / "build/ccache"))
    define = f"-DFUZZ_{extra.upper()}" if extra else "-DFUZZ"
    generics = [f"-G{name}={value}" for name, value in settings.items()]
    _tool("verilator", *FLAGS, *EXTRA[extra], *generics, "--Mdir", folder, *sources)
    root = _tool("verilator", "--getenv", "VERILATOR_ROOT").strip()
    _tool(
        *("g++", *LINK, define, "-o", folder / "partial.so", HARNESS, "-I", LINES.parent),
        *("-isystem", folder, "-isystem", f"{root}/include", "-isystem", f"{root}/include/vltstd"),
        *(folder / "libVrtu2fc.a", folder / "libverilated.a", "-llz4", "-lz", "-lpthread"),
    )
    (folder / "partial.so").rename(made)
    for path in folder.iterdir():
        if path != made:
            path.unlink()


def _tool(*command: object) -> str:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    words = [str(word) for word in command]
    if shutil.which(words[0], path=path) is None:
        raise BuildError(f"{words[0]} is missing; run `make setup`")
    done = subprocess.run(
        words, cwd=ROOT, env={**os.environ, "PATH": path}, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise BuildError(f"{words[0]} fails\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout


def _forget_old() -> None:
    """Another process may have just been given a young one."""
    folders = sorted((path.stat().st_mtime, path) for path in BUILD.iterdir() if path.is_dir())
    for used, folder in folders[:-KEPT]:
        if time.time() - used > KEPT_S:
            shutil.rmtree(folder, ignore_errors=True)
