# SPDX-License-Identifier: Apache-2.0
"""The diagrams of docs/diagrams are what the runs give, and say what an edge that moves does to them."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from tb.lib.fast_card import FastCard
from tools import diagrams
from tools.diagrams import BIT, DIAGRAMS, DRAWINGS, difference, svg
from tools.sources import ROOT


@pytest.mark.parametrize("name", DRAWINGS)
def test_checked_in_diagram_is_what_the_run_gives(name):
    wrong = difference((DIAGRAMS / f"{name}.svg").read_text(), svg(DRAWINGS[name]()))
    assert wrong is None, f"docs/diagrams/{name}.svg: {wrong}; run `make diagrams`"


@pytest.mark.parametrize(
    ("found", "instead", "wrong"),
    [
        ("t1.5: 16.49 bits", "t1.5: 16.53 bits", False),
        ("t1.5: 16.49 bits", "t1.5: 16.59 bits", True),
        ("t1.5: 16.49 bits", "t1.5: 16.49 ms", True),
        (">CA<", ">CB<", True),
        (">candidate<", "><", True),
    ],
)
def test_what_differs_is_said(found, instead, wrong):
    picture = (DIAGRAMS / "commit.svg").read_text()
    assert found in picture
    assert (difference(picture, picture.replace(found, instead)) is not None) == wrong


def test_the_same_run_gives_the_same_picture():
    assert svg(diagrams.commit()) == svg(diagrams.commit())


def test_every_diagram_stands_in_the_page_and_no_other_file_is_there():
    shown = re.findall(r"\(diagrams/([\w-]+)\.svg\)", (ROOT / "docs/timing.md").read_text())
    assert shown == list(DRAWINGS)
    assert sorted(path.stem for path in DIAGRAMS.iterdir()) == sorted(DRAWINGS)


@pytest.mark.rule("FRAME-6")
@pytest.mark.parametrize("figure", ["candidate after the request", "commit after the request"])
def test_a_strobe_two_bits_late_is_another_picture_and_another_figure(figure, monkeypatch):
    """The figures come from the recording: what is late in it is late in the picture."""
    right = diagrams.commit()
    recorded = FastCard.recorded_so_far

    def late(card):
        return {
            pin: [(at + 2 * BIT * (pin == figure.split()[0]), level) for at, level in edges]
            for pin, edges in recorded(card).items()
        }

    monkeypatch.setattr(FastCard, "recorded_so_far", late)
    wrong = diagrams.commit()
    assert difference(svg(right), svg(wrong)) is not None
    changed = float(wrong.figures[figure].split()[0]) - float(right.figures[figure].split()[0])
    assert changed == pytest.approx(2, abs=0.02)


def test_an_unknown_name_is_one_line_and_exit_2():
    command = [sys.executable, "-m", "tools.diagrams", "comit"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert run.stdout == "" and run.stderr.count("\n") == 1 and "'comit'" in run.stderr
