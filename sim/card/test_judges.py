# SPDX-License-Identifier: Apache-2.0
"""sigrok-cli must agree with the card's log: it decodes the bits of the waveform.

sim/view/test_wireshark.py does the same with tshark, campaigns/masters with eleven Modbus masters.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from sim.card.example_run import ExampleRun, Recorded
from sim.card.run_card import ROOT, Frame
from tb.agents import rtu

pytestmark = pytest.mark.nightly("views")

BIT_S = 1 / 9600
DAMAGED = bytes.fromhex("01 01 00 00 00 10 3D C7")
PLAYED = ("ex1-start-40", "ex4-write-104", "ex5-read-514", "ex6b-text-533", "refused-17", "bad-address")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Recorded:
    """Recording with reads, writes, a text, two kinds of exception and a frame with a wrong CRC."""
    folder = tmp_path_factory.mktemp("judged")
    with ExampleRun(folder, wave=True) as run:
        played = tuple(run.play(name) for name in PLAYED)
        before = len(run.card.frames())
        run.master.write(DAMAGED)
        run.card.wait_for_frames(before, "modbus", "master")
        run.play("appA-fc01")
    return Recorded(played, tuple(run.card.frames()), run.pcap, run.card.log, run.wave)


@pytest.fixture(scope="module")
def network(recorded) -> list[Frame]:
    frames = [frame for frame in recorded.frames if frame.line == "modbus"]
    assert [frame.data for frame in frames if not frame.ok] == [DAMAGED]
    return frames


# ---------------------------------------------------------------- sigrok, from the bits of the waveform
@dataclass(frozen=True)
class Annotation:
    start_s: float
    end_s: float
    text: str


@pytest.fixture(scope="module")
def shell(recorded, tmp_path_factory) -> Callable[[str], str]:
    """Runs a documented command in a plain shell without the tools of .venv; returns its output."""
    folder = tmp_path_factory.mktemp("documented")
    shutil.copy(recorded.wave, folder / "card.fst")
    for name in (".venv", "regs", "rtl", "sim", "sw"):
        (folder / name).symlink_to(ROOT / name)

    def run(command: str) -> str:
        done = subprocess.run(
            ["sh", "-c", command],
            cwd=folder,
            env={"PATH": "/usr/bin:/bin", "HOME": str(folder)},
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def documented(section: str) -> list[str]:
    """Lines of the first code block in a section of docs/guide/recordings.md."""
    text = (ROOT / "docs/guide/recordings.md").read_text().split(f"## {section}\n")[1]
    return re.search(r"```\n(.*?)```", text, re.DOTALL)[1].splitlines()


TO_VCD, ON_NETWORK, ON_DRIVE = documented("sigrok")


@pytest.fixture(scope="module")
def sigrok(shell) -> Callable[[str], list[Annotation]]:
    """Runs a command of sigrok; returns its annotations in order of time."""
    assert shell(TO_VCD) == ""

    def annotations(command: str) -> list[Annotation]:
        shown = shell(f"{command} --protocol-decoder-samplenum")
        rows = re.findall(r"^(\d+)-(\d+) [\w-]+: (.*)$", shown, re.MULTILINE)
        assert rows, shown
        # One sample is a microsecond (sim/view/lines_vcd.py).
        found = (Annotation(int(a) / 1e6, int(b) / 1e6, text) for a, b, text in rows)
        return sorted(found, key=lambda x: x.start_s)

    return annotations


def within(annotations: list[Annotation], frame: Frame) -> list[Annotation]:
    return [a for a in annotations if frame.start - BIT_S <= a.start_s <= frame.end + BIT_S]


ON_NETWORK_WIRE = ON_DRIVE.replace("rx=drive", "rx=modbus").replace("parity=even", "parity=none")


@pytest.mark.rule("LINE-1", "FC-1")
@pytest.mark.parametrize(("line", "command"), [("modbus", ON_NETWORK_WIRE), ("drive", ON_DRIVE)])
def test_sigrok_uart_agrees_with_the_log(recorded, sigrok, line, command):
    """Both directions on one wire: no parity error, no missing stop bit, no byte between the frames."""
    heard = sigrok(command)
    frames = [frame for frame in recorded.frames if frame.line == line]
    assert [bytes.fromhex("".join(a.text for a in within(heard, frame))) for frame in frames] == [
        frame.data for frame in frames
    ]
    assert len(heard) == sum(len(frame.data) for frame in frames)
    everything = sigrok(command.replace("uart=rx-data", "uart"))
    assert not [a for a in everything if "rror" in a.text or "reak" in a.text]


@pytest.mark.rule("FRAME-4")
def test_sigrok_modbus_agrees_with_the_log(network, sigrok):
    annotations = sigrok(ON_NETWORK)
    for frame in network:
        texts = [a.text for a in within(annotations, frame)]
        assert texts[0] == f"Slave ID: {frame.data[0]}"
        assert ("CRC correct" in texts) == frame.ok, (frame, texts)
        refused = frame.ok and bool(frame.data[1] & rtu.EXCEPTION_BIT)
        assert texts[1].startswith("Error for function") == refused
        assert any(text.startswith(f"Error {frame.data[2]}:") for text in texts) == refused


def test_the_documented_command_writes_the_views(shell):
    command, *viewers = documented("Waveforms")
    printed = shell(command)
    written = [re.findall(r"card\.(?:gtkw|sucl)", viewer)[0] for viewer in viewers]
    assert written == ["card.gtkw", "card.sucl"]
    assert all(name in printed and len(shell(f"cat {name}")) > 1000 for name in written)


def test_a_waveform_that_cannot_be_read_is_one_line(recorded, tmp_path):
    """The writer of a running card fills in the header at its end."""
    wave, words = tmp_path / "card.fst", "the waveform is unfinished: its program still runs or was killed"
    wave.write_bytes(bytes(329) + recorded.wave.read_bytes()[329:])
    for name, *more in (("lines_vcd", tmp_path / "lines.vcd"), ("waves",)):
        command = [sys.executable, "-m", f"sim.view.{name}", wave, *more]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout, done.stderr) == (2, "", f"{name}: {words}\n")
