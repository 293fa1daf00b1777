# SPDX-License-Identifier: Apache-2.0
"""tools/digests.txt: a changed image or design is named; another compiler's images are not compared."""

from __future__ import annotations

import subprocess
import sys

import pytest

from rtl.sources import ROOT
from tools import digests

COMPILER = "gcc 12"
KEPT = {"firmware-8k-card.hex": "1" * 64, "firmware-8k-builtin.hex": "2" * 64}
KEPT |= {"design-ulx3s.config": "3" * 64}


@pytest.fixture
def run(tmp_path, monkeypatch):
    """The command, with images that were made and their digests."""
    monkeypatch.setattr(digests, "FILE", tmp_path / "digests.txt")
    monkeypatch.setattr(digests, "ROOT", tmp_path)
    monkeypatch.setattr(digests, "firmware", list)
    digests.write(COMPILER, KEPT)

    def run(made: dict[str, str], *options: str, compiler: str = COMPILER) -> int:
        monkeypatch.setattr(digests, "first_line", lambda *command: compiler)
        monkeypatch.setattr(digests, "of_images", lambda images: made)
        monkeypatch.setattr(sys, "argv", ["digests", *options])
        return digests.main()

    return run


SAME = {name: value for name, value in KEPT.items() if name.startswith("firmware-")}


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (SAME, []),
        (SAME | {"firmware-8k-card.hex": "4" * 64}, ["firmware-8k-card.hex: another digest than in"]),
        (SAME | {"firmware-8k-new.hex": "4" * 64}, ["firmware-8k-new.hex: not in"]),
        ({"firmware-8k-card.hex": "1" * 64}, ["firmware-8k-builtin.hex: in digests.txt, but not made"]),
    ],
)
def test_a_difference_is_named(run, capsys, made, said):
    assert run(made, "--check") == int(bool(said))
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(said)
    assert all(part in line for part, line in zip(said, lines, strict=True))


def test_another_compiler_is_said_and_not_compared(run, capsys):
    assert run({"firmware-8k-card.hex": "4" * 64}, "--check", compiler="gcc 14") == 0
    assert "images not compared: they are of gcc 12, and here is gcc 14" in capsys.readouterr().out


def test_writing_keeps_the_designs_and_forgets_old_images(run):
    made = {"firmware-8k-card.hex": "5" * 64}
    assert run(made) == 0
    assert digests.kept() == (COMPILER, made | {"design-ulx3s.config": "3" * 64})


@pytest.mark.nightly("synth")
def test_a_design_is_placed_and_routed_to_the_same_bytes():
    command = [sys.executable, "-m", "tools.digests", "--check", "--board", "hx8k-breakout"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
