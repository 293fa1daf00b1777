# SPDX-License-Identifier: Apache-2.0
"""Runs the example of a master like an owner, but on a pty; returns its output."""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
from pathlib import Path

from campaigns.masters.masters import PORT, PYTHON, TCP_PORT, Master
from campaigns.masters.session import OPEN_S, MastersError, place, tcp_of
from rtl.sources import ROOT


def command(program: Path, folder: Path) -> list[str]:
    if program.suffix == ".c":
        made = folder / "example"
        subprocess.run(
            ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-o", made, program, "-lmodbus"], check=True
        )
        return [str(made)]
    return [{".py": str(PYTHON), ".js": "node", ".sh": "sh"}[program.suffix], str(program)]


def run(master: Master) -> str:
    """Output of the example. The name of the pty, or the port of socat, replaces the port in its text."""
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        there = stack.enter_context(place("card"))
        port, ours = there.relay.path, PORT
        if master.by_tcp:
            port, ours = stack.enter_context(tcp_of(port)).rpartition(":")[2], TCP_PORT
        text = master.example_path.read_text()
        if ours not in text:
            raise MastersError(f"{master.example} does not name {ours}")
        program = folder / f"example{master.example_path.suffix}"  # a name that hides no package
        program.write_text(text.replace(ours, port))
        done = subprocess.run(
            command(program, folder),
            cwd=ROOT,
            env=master.environ(),
            capture_output=True,
            text=True,
            timeout=OPEN_S,
            check=False,
        )
    return (done.stdout + done.stderr).replace(port, ours)
