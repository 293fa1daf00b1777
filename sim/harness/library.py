# SPDX-License-Identifier: Apache-2.0
"""Builds the Verilated card: the only recipe, for every program and test that runs the whole card.

    python -m sim.harness.library bench            the libraries of the measuring bench: `make bench-card`
    python -m sim.harness.library tiny             the tiny card of the measuring bench
    python -m sim.harness.library model CONFIG CLK_HZ EXTENDED_SWITCHES FOLDER
                                                   the model of the virtual card, copied to FOLDER

A build lies in the cache of rtl/cache.py under a hash of everything that it was made from. So nothing stale
is used, and all checkouts on a machine share it. A card with a planted bug is built by the same function from
changed sources.
"""

from __future__ import annotations

import functools
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rtl import cache
from rtl.command import run_main
from rtl.sources import ROOT, SourcesError, card_files, configuration, configurations
from sim.harness import registers
from sim.harness.power_up import copies_without_values
from sim.harness.wave_rows import ROW_FILES, copies_with_rows

HERE = ROOT / "sim/harness"
LIBRARY = HERE / "card_library.cpp"
HEADERS = (HERE / "card_model.h", HERE / "line_player.h")
POWER_UP = HERE / "power_up.py"
WAIVERS = (ROOT / "tools/verilator.vlt", HERE / "probes.vlt")
IMAGE = "firmware.hex"  # read from the working directory when a card is switched on
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


def model(clk_hz: int, config: str, extended_switches: int) -> Path:
    """The folder with headers and archives of the virtual card's model.

    The firmware alone decides there whether the loss of the master stops the drive (SAFE-7).
    """
    stop = {"MASTER_LOSS_STOP": 1} if config == "standard" else {}
    parameters = {"EXTENDED_SWITCHES": extended_switches, **stop}
    return _folder(clk_hz, config, None, parameters, "program", library=False)


def _folder(
    clk_hz: int,
    config: str,
    sources: Sequence[Path] | None,
    parameters: Mapping[str, int] | None,
    extra: str,
    library: bool,
) -> Path:
    sources = list(sources or card_files(config))
    # One core runs twice as fast as two in lockstep. A card whose core may fail gets both by `parameters`.
    # EXTENDED_SWITCHES, because many benches run at 38400 or 115200 bit/s or with 8N1.
    settings = {"CLK_HZ": clk_hz, "LOCKSTEP": 0, "EXTENDED_SWITCHES": 1, **(parameters or {})}
    waivers = list(WAIVERS)
    if extra == "flips":
        more = tuple(sorted((parameters or {}).items()))
        found = registers.registers(tuple(sources), clk_hz, more)
        name = "-".join([str(clk_hz), *(f"{parameter}={value}" for parameter, value in more)])
        waivers.append(registers.public(found, registers.FOLDER / f"{name}.vlt"))
    if extra == "program":
        waivers.append(HERE / "wave.vlt")
    recipe = LINK if library else ()
    files = (*sources, *waivers, POWER_UP, *ROW_FILES, *((LIBRARY, *HEADERS) if library else ()))
    name = cache.key(
        sorted(settings.items()),
        *(extra, FLAGS, EXTRA[extra], recipe),
        files=files,
        packages=["verilator"],
        tool="g++ --version",
    )

    def make(folder: Path) -> list[Path]:
        copies = copies_without_values(sources, folder / "sources")
        if "--trace-fst" in EXTRA[extra]:
            copies = copies_with_rows(copies, folder / "sources")
        _verilate(folder, [*waivers, *copies], settings, extra)
        if library:
            return [_link(folder, extra)]
        return [path for path in folder.iterdir() if path.suffix in (".h", ".a")]

    return cache.made("harness", name, make)


def _verilate(folder: Path, sources: Sequence[Path], settings: Mapping[str, int], extra: str) -> None:
    cache.use_ccache()
    generics = [f"-G{name}={value}" for name, value in settings.items()]
    _tool("verilator", *FLAGS, *EXTRA[extra], *generics, "--Mdir", folder, *sources)
    text = "".join(path.read_text() for path in sorted(folder.glob("Vrtu2fc___024root*.cpp")))
    triggers = sorted(set(re.findall(r"trigger index \d+ is active: @\([^)]*\)", text)))
    if triggers != sorted(TRIGGERS):
        raise BuildError(f"the harness knows clk and rst_n alone, and the card has {triggers}")
    # Public registers have such logic of their own; CardModel::flip() evaluates it.
    if extra != "flips" and "___eval_ico" in text:
        raise BuildError("the harness needs a register at each input, and the card has logic before it")


def _link(folder: Path, extra: str) -> Path:
    root = _tool("verilator", "--getenv", "VERILATOR_ROOT").strip()
    library = folder / "libcard.so"
    _tool(
        *("g++", *LINK, DEFINES.get(extra, "-DCARD"), "-o", library, LIBRARY, "-I", HERE),
        *("-isystem", folder, "-isystem", f"{root}/include", "-isystem", f"{root}/include/vltstd"),
        *(folder / "libVrtu2fc.a", folder / "libverilated.a", "-llz4", "-lz", "-lpthread"),
    )
    return library


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


def main(kind: str, *words: str) -> None:
    if kind == "model":
        config, clk_hz, extended, name = words
        shutil.copytree(model(int(clk_hz), config, int(extended)), name, dirs_exist_ok=True)
        return
    config = "tiny" if kind == "tiny" else "standard"
    clk_hz = configurations()[config]["clk_hz"]
    build(clk_hz, config=config)


if __name__ == "__main__":
    run_main("harness", lambda: main(*sys.argv[1:]), BuildError, SourcesError, registers.RegistersError)
