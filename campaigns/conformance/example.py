# SPDX-License-Identifier: Apache-2.0
"""Runs the example of tb/agents on another project's slave, with the installed package.

The package is built and installed below build/, the slave fetched by its commit (designs.toml).
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from campaigns.conformance.designs import BUILD, Design, DesignError, designs
from rtl.command import run_main
from rtl.sources import ROOT

SLAVE = "shroubovak"
AGENTS = ROOT / "tb/agents"


def install(folder: Path) -> Path:
    """Installs the package from a copy of its folder; returns the folder to import it from."""
    source, site = folder / "source", folder / "site"
    for old in (source, site):
        shutil.rmtree(old, ignore_errors=True)
    shutil.copytree(AGENTS, source)
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation"]
    done = subprocess.run(
        [*command, "--target", str(site), str(source)], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise DesignError(f"pip cannot install tb/agents: {done.stderr.strip().splitlines()[-1]}")
    return site


def command(design: Design, folder: Path) -> list[str]:
    """The example's runner and its options for the design."""
    entry = design.entry
    pins = {**entry["pins"], "rst": ("!" if entry.get("reset_low") else "") + entry["pins"]["rst"]}
    options = {
        "top": entry["top"],
        "clk-hz": entry["clk_hz"],
        "baud": entry["baud"],
        "form": entry["form"],
        "unit": entry["profile"]["unit"],
        "register": entry["profile"].get("register", 0),
        "pins": ",".join(pins[name] for name in ("clk", "rst", "rx", "tx", "de")),
        "build": folder / "simulation",
    }
    words = [word for name, value in options.items() for word in (f"--{name}", str(value))]
    for kind, values in (("--parameter", entry.get("parameters", {})), ("--input", entry.get("inputs", {}))):
        for name, value in values.items():
            words += [kind, f"{name}={value}"]
    return [str(AGENTS / "example/run.py"), *words, *map(str, design.sources())]


def main() -> int:
    folder = BUILD / "example"
    design = designs()[SLAVE]
    print(f"installs the package and runs its example on {design.title}", flush=True)
    arguments, site = command(design, folder), install(folder)
    # Nothing of this project is on the path: no folder, no variable, only the installed package.
    script = f"import runpy, sys\nsys.path.insert(0, {str(site)!r})\nsys.argv = {arguments!r}\n"
    script += f"runpy.run_path({arguments[0]!r}, run_name='__main__')\n"
    return subprocess.run([sys.executable, "-I", "-c", script], cwd=folder, check=False).returncode


if __name__ == "__main__":
    run_main("example", main, DesignError)
