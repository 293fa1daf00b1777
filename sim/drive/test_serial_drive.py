# SPDX-License-Identifier: Apache-2.0
"""The simulated drive on a serial port, asked as the card asks it."""

from __future__ import annotations

import os
import pty
import select
import subprocess
import sys
import tty

import pytest

from rtl.sources import ROOT
from tb.model import fc_telegram
from tb.model.vlt_drive import VltDrive

READ = fc_telegram.build_parameter(1, 514)
START = fc_telegram.build_process(0x047C, 0x1999)


@pytest.fixture
def port():
    inside, outside = pty.openpty()
    tty.setraw(outside)
    run = subprocess.Popen(
        [sys.executable, "-m", "sim.drive.serial_drive", os.ttyname(outside), "--parity", "none"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert run.stdout and "vlt6000" in run.stdout.readline()
    yield inside
    run.terminate()
    run.communicate()
    os.close(inside)
    os.close(outside)


def reply(port: int, *pieces: bytes, wait: float = 1.0) -> bytes:
    for piece in pieces:
        os.write(port, piece)
    heard = b""
    while select.select([port], [], [], wait if not heard else 0.2)[0]:
        heard += os.read(port, 100)
    return heard


def test_it_answers_as_the_simulated_drive_and_starts(port):
    drive = VltDrive()
    assert reply(port, READ) == drive.telegram(READ)
    assert reply(port, START[:3], START[3:]) == drive.telegram(START)
    running = fc_telegram.parse(reply(port, READ), reply=True)
    assert running.pcd1 & 0x0800  # the status word says that it runs


def test_rubbish_gets_no_answer_and_the_next_telegram_does(port):
    assert reply(port, READ[:-1] + bytes([READ[-1] ^ 1]), wait=0.2) == b""
    assert reply(port, b"\x00\xff", READ[:5], wait=0.2) == b""
    assert reply(port, READ)


def test_no_such_port_is_one_line():
    run = subprocess.run(
        [sys.executable, "-m", "sim.drive.serial_drive", "/dev/no-such-port"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 2 and len(run.stderr.splitlines()) == 1
