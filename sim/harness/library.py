# SPDX-License-Identifier: Apache-2.0
"""Builds the Verilated card: the only recipe, for every program and test that runs the whole card.

    python -m sim.harness.library bench            the libraries of the measuring bench: `make bench-card`
    python -m sim.harness.library tiny             the tiny card of the measuring bench
    python -m sim.harness.library model CONFIG CLK_HZ FOLDER
                                                   the model of the virtual card; FOLDER becomes a link to it

A build lies in a folder named by everything that it was made from. So nothing stale is used, and several
processes may share a build; a lock a folder makes the others wait for the first. A card with a planted bug is
built by the same function from changed sources.
"""

from __future__ import annotations

import fcntl
import functools
import hashlib
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rtl.command import run_main
from rtl.sources import ROOT, SourcesError, card_files, configuration, configurations
from sim.harness import registers
from sim.harness.power_up import copies_without_values

HERE = ROOT / "sim/harness"
BUILD = ROOT / "build/harness"
LIBRARY = HERE / "card_library.cpp"
HEADERS = (HERE / "card_model.h", HERE / "line_player.h")
POWER_UP = HERE / "power_up.py"
WAIVERS = (ROOT / "tools/verilator.vlt", HERE / "probes.vlt")
IMAGE = "firmware.hex"  # read from the working directory when a card is switched on
KEPT, KEPT_S = 24, 3600  # builds; more only while they are young
# Without these two passes g++ 12 spills less in the one long function that a clock is: a tenth faster.
OPTIMISE = "-O3 -fno-tree-pre -fno-store-merging"
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
    *("--x-assign", "fast", "--timescale-override", "1ns/1ns", "-CFLAGS", "-fPIC"),
    *("-MAKEFLAGS", f"PYTHON3=python3 VK_PCH_I_FAST= VK_PCH_I_SLOW= OPT_FAST='{OPTIMISE}'"),
    f'-GFIRMWARE_HEX="{IMAGE}"',
)
# waves: can write a waveform. flips: registers can be flipped. program: the virtual card's, waves without
# the inside of the soft core. In each a seed decides what registers hold at power-up (SAFE-5).
RANDOM = ("--x-initial", "unique")
EXTRA = {
    "": RANDOM,
    "waves": (*RANDOM, "--trace-fst"),
    "flips": RANDOM,
    "program": (*RANDOM, "--trace-fst"),
}
DEFINES = {"waves": "-DCARD_WAVES", "flips": "-DCARD_FLIPS", "program": "-DCARD_WAVES"}
# All of a library's names stay its own: several are loaded into one process.
LINK = (
    *("-std=c++17", "-O3", "-fPIC", "-shared", "-fvisibility-inlines-hidden", "-fno-gnu-unique"),
    *("-Wl,-Bsymbolic", "-Wall", "-Wextra", "-Werror"),
)
# CardModel::clock() runs the clocked logic alone. These texts in the model show that this is all there is.
TRIGGERS = (
    "trigger index 0 is active: @(posedge clk)",
    "trigger index 1 is active: @(negedge rst_n)",
)


class BuildError(Exception):
    """One line that tells the user what is wrong, and then the tool's own words."""


@dataclass(frozen=True)
class Target:
    """A card to be tested: the project's own or one that differs.

    `sources` and `images` (folder of the firmware images): those of the configuration, unless they are given.
    """

    sources: tuple[Path, ...] = ()
    parameters: tuple[tuple[str, int], ...] = ()
    images: Path | None = None
    config: str = "standard"

    @functools.cache  # noqa: B019 - there are only a few of them
    def library(self, clk_hz: int, extra: str = "") -> Path:
        return build(
            clk_hz,
            config=self.config,
            sources=self.sources,
            parameters=dict(self.parameters),
            extra=extra,
        )

    def files(self) -> tuple[Path, ...]:
        return self.sources or tuple(card_files(self.config))

    def image_folder(self, dialect: str) -> Path:
        images = self.images or (ROOT / configuration(self.config)["firmware_hex"]).parent
        folder = images if dialect == "card" else images / dialect
        if not (folder / IMAGE).exists():
            raise BuildError(f"{(folder / IMAGE).relative_to(ROOT)} is missing; run `make firmware`")
        return folder


def build(
    clk_hz: int,
    *,
    config: str = "standard",
    sources: Sequence[Path] | None = None,
    parameters: Mapping[str, int] | None = None,
    extra: str = "",
) -> Path:
    """The library of a card at this clock, made unless this very content was made before.

    `extra`: a key of EXTRA.
    """
    folder = _folder(clk_hz, config, sources, parameters, extra, library=True)
    return folder / "libcard.so"


def model(clk_hz: int, config: str) -> Path:
    """The folder with headers and archives of the virtual card's model.

    The firmware alone decides there whether the loss of the master stops the drive (SAFE-7).
    """
    stop = {"MASTER_LOSS_STOP": 1} if config == "standard" else None
    return _folder(clk_hz, config, None, stop, "program", library=False)


def _folder(
    clk_hz: int,
    config: str,
    sources: Sequence[Path] | None,
    parameters: Mapping[str, int] | None,
    extra: str,
    library: bool,
) -> Path:
    sources = list(sources or card_files(config))
    settings = {"CLK_HZ": clk_hz, **(parameters or {})}
    waivers = list(WAIVERS)
    if extra == "flips":
        more = tuple(sorted((parameters or {}).items()))
        found = registers.registers(tuple(sources), clk_hz, more)
        name = "-".join([str(clk_hz), *(f"{parameter}={value}" for parameter, value in more)])
        waivers.append(registers.public(found, registers.FOLDER / f"{name}.vlt"))
    if extra == "program":
        waivers.append(HERE / "wave.vlt")
    content = hashlib.sha256(f"{ROOT} {sorted(settings.items())} {extra} {FLAGS} {EXTRA} {LINK}".encode())
    for path in (*sources, *waivers, POWER_UP, *((LIBRARY, *HEADERS) if library else ())):
        content.update(path.name.encode() + b"\0" + path.read_bytes())
    folder = BUILD / content.hexdigest()[:16]
    done = folder / "built"
    with _lock(folder):
        if not done.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            copies = copies_without_values(sources, folder / "sources")
            _verilate(folder, [*waivers, *copies], settings, extra)
            if library:
                _link(folder, extra)
            done.touch()
            _forget_old()
        os.utime(folder)
    return folder


@contextmanager
def _lock(folder: Path):
    """Other processes wait; the system releases the lock if this one dies."""
    BUILD.mkdir(parents=True, exist_ok=True)
    with open(folder.with_suffix(".lock"), "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _verilate(folder: Path, sources: Sequence[Path], settings: Mapping[str, int], extra: str) -> None:
    if shutil.which("ccache"):
        os.environ.setdefault("OBJCACHE", "ccache")
        os.environ.setdefault("CCACHE_DIR", str(ROOT / "build/ccache"))
    generics = [f"-G{name}={value}" for name, value in settings.items()]
    _tool("verilator", *FLAGS, *EXTRA[extra], *generics, "--Mdir", folder, *sources)
    text = "".join(path.read_text() for path in sorted(folder.glob("Vrtu2fc___024root*.cpp")))
    triggers = sorted(set(re.findall(r"trigger index \d+ is active: @\([^)]*\)", text)))
    if triggers != sorted(TRIGGERS):
        raise BuildError(f"the harness knows clk and rst_n alone, and the card has {triggers}")
    # Public registers have such logic of their own; CardModel::flip() evaluates it.
    if extra != "flips" and "___eval_ico" in text:
        raise BuildError("the harness needs a register at each input, and the card has logic before it")


def _link(folder: Path, extra: str) -> None:
    root = _tool("verilator", "--getenv", "VERILATOR_ROOT").strip()
    _tool(
        *("g++", *LINK, DEFINES.get(extra, "-DCARD"), "-o", folder / "libcard.so", LIBRARY, "-I", HERE),
        *("-isystem", folder, "-isystem", f"{root}/include", "-isystem", f"{root}/include/vltstd"),
        *(folder / "libVrtu2fc.a", folder / "libverilated.a", "-llz4", "-lz", "-lpthread"),
    )
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.name != "libcard.so":
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
    """Another process may have just been given a young build."""
    folders = sorted((path.stat().st_mtime, path) for path in BUILD.iterdir() if path.is_dir())
    for used, folder in folders[:-KEPT]:
        if time.time() - used > KEPT_S:
            shutil.rmtree(folder, ignore_errors=True)
            folder.with_suffix(".lock").unlink(missing_ok=True)


def main(kind: str, *words: str) -> None:
    if kind == "model":
        config, clk_hz, name = words
        link = Path(name)
        if link.is_dir() and not link.is_symlink():
            shutil.rmtree(link)
        link.unlink(missing_ok=True)
        link.symlink_to(model(int(clk_hz), config))
        return
    config = "tiny" if kind == "tiny" else "standard"
    clk_hz = configurations()[config]["clk_hz"]
    build(clk_hz, config=config)
    if kind == "bench":
        build(clk_hz, config=config, parameters={"PREPARE_EARLY": 0})


if __name__ == "__main__":
    run_main("harness", lambda: main(*sys.argv[1:]), BuildError, SourcesError, registers.RegistersError)
