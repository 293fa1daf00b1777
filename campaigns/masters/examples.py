# SPDX-License-Identifier: Apache-2.0
"""Runs the example of a master like an owner, but on a pty and with a motor that runs; returns its output."""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
from pathlib import Path

from campaigns.masters.cases import READY, bits
from campaigns.masters.masters import PORT, PYTHON, TCP_PORT, Master
from campaigns.masters.session import OPEN_S, MastersError, place, tcp_of
from rtl.sources import ROOT
from sim.card.masters import Pymodbus
from tb.agents import rtu

START, SLOW = 0x047C, 0x0333  # control word; reference 5 %


def command(program: Path, folder: Path) -> list[str]:
    if program.suffix == ".c":
        made = folder / "example"
        subprocess.run(
            ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-o", made, program, "-lmodbus"], check=True
        )
        return [str(made)]
    return [{".py": str(PYTHON), ".js": "node", ".sh": "sh"}[program.suffix], str(program)]


def run(master: Master, patient: bool = False) -> str:
    """Output of the example. The name of the pty, or the port of socat, replaces the port in its text.

    patient: pymodbus and mbpoll wait 5 s for a reply instead of 1 s, since a busy machine delays the card.
    """
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        there = stack.enter_context(place("card"))
        port, ours = there.relay.path, PORT
        with Pymodbus(port) as client:
            client.ask(rtu.build(1, rtu.write_coils(0, bits(START) + bits(SLOW))))
        if master.by_tcp:
            port, ours = stack.enter_context(tcp_of(port)).rpartition(":")[2], TCP_PORT
        text = master.example_path.read_text()
        if patient:
            text = text.replace("timeout=1,", "timeout=5,").replace("-o 1 ", "-o 5 ")
        if ours not in text:
            raise MastersError(f"{master.example} does not name {ours}")
        program = folder / f"example{master.example_path.suffix}"  # a name that hides no package
        program.write_text(text.replace(ours, port))
        done = subprocess.run(
            command(program, folder),
            cwd=ROOT,
            env=master.environ(),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=OPEN_S,
            check=False,
        )
        shown = done.stdout.replace(port, ours)
        if not shown.endswith("stopped\n") or there.card.state()["motor"]["status"] != READY:
            raise MastersError(f"{master.example} does not end in a stopped drive: {shown.splitlines()[-1:]}")
    return shown
