# SPDX-License-Identifier: Apache-2.0
"""Cards with a planted bug: the fuzzer must find each, otherwise a run without findings proves nothing."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

from regs.dialects import DEFAULT, DIALECTS
from rtl.sources import ROOT, card_files, configurations
from sim.harness.library import Target
from tb.lib.planted import Bug, PlantError, bugs

FOLDER = ROOT / "build/fuzz/plants"
CONFIGS = ROOT / "configs.toml"
PLANTS = bugs("fuzz")


def named(name: str) -> Bug:
    for plant in PLANTS:
        if plant.name == name:
            return plant
    raise PlantError(f"no plant '{name}'; there are {', '.join(plant.name for plant in PLANTS)}")


def card_with(plant: Bug) -> Target:
    if plant.in_firmware:
        return Target(images=firmware(plant))
    changed = FOLDER / plant.name / Path(plant.file).name
    changed.parent.mkdir(parents=True, exist_ok=True)
    changed.write_text(plant.planted())
    return Target(sources=tuple(changed if path == ROOT / plant.file else path for path in card_files()))


def firmware(plant: Bug) -> Path:
    """The folder of its images."""
    folder = FOLDER / plant.name
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("sw", "regs"):
        shutil.copytree(ROOT / name, folder / name)
    # The changed firmware needs to fit only the standard card.
    sizes = {entry["memory_bytes"] for entry in configurations().values()}
    roomy = re.sub(r"(?m)^memory_bytes = .*", f"memory_bytes = {max(sizes)}", CONFIGS.read_text())
    (folder / CONFIGS.name).write_text(roomy)
    (folder / plant.file).write_text(plant.planted())
    dialects = [f"build/{dialect}/firmware.hex" for dialect in DIALECTS if dialect != DEFAULT]
    command = ["make", "--silent", "-f", "sw/firmware.mk", "SETUP=", "build/firmware.hex", *dialects]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise PlantError(f"plant {plant.name}: {done.stderr[-2000:]}")
    return folder / "build"
