# SPDX-License-Identifier: Apache-2.0
"""tools/digests.txt: a changed image or design is named, and a check that compares nothing does not pass."""

from __future__ import annotations

import sys

import pytest

from constraints.boards import board
from tools import digests
from tools.digests import DESIGN, FIRMWARE

COMPILER = "gcc 12"
KEPT = {"firmware-8k-card.hex": "1" * 64, "firmware-8k-builtin.hex": "2" * 64}
KEPT |= {"design-ulx3s.bit": "3" * 64}


@pytest.fixture
def run(tmp_path, monkeypatch):
    """The command, with images that were made and their digests."""
    monkeypatch.setattr(digests, "FILE", tmp_path / "digests.txt")
    monkeypatch.setattr(digests, "ROOT", tmp_path)
    monkeypatch.setattr(digests, "firmware", list)
    monkeypatch.setattr(digests, "compiler", lambda: COMPILER)
    digests.write(KEPT)

    def run(made: dict[str, str], *options: str, compiler: str = COMPILER) -> int:
        kinds = {
            kind: {name: made[name] for name in made if name.startswith(kind)} for kind in (FIRMWARE, DESIGN)
        }
        monkeypatch.setattr(digests, "compiler", lambda: compiler)
        monkeypatch.setattr(digests, "of_images", lambda images: kinds[FIRMWARE])
        monkeypatch.setattr(digests, "of_designs", lambda entries: kinds[DESIGN] if entries else {})
        monkeypatch.setattr(sys, "argv", ["digests", *options])
        return digests.main()

    return run


SAME = {name: value for name, value in KEPT.items() if name.startswith(FIRMWARE)}
OTHER = SAME | {"firmware-8k-card.hex": "4" * 64}


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (SAME, []),
        (OTHER, ["firmware-8k-card.hex: another digest than in"]),
        (SAME | {"firmware-8k-new.hex": "4" * 64}, ["firmware-8k-new.hex: not in"]),
        ({"firmware-8k-card.hex": "1" * 64}, ["firmware-8k-builtin.hex: in digests.txt, but not made"]),
    ],
)
def test_a_difference_is_named(run, capsys, made, said):
    assert run(made, "--check") == int(bool(said))
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(said)
    assert all(part in line for part, line in zip(said, lines, strict=True))


def test_another_compiler_matters_if_its_images_differ(run, capsys):
    assert run(SAME, "--check", compiler="gcc 12, built again") == 0
    assert run(OTHER, "--check", compiler="gcc 14") == 1
    assert "digests: digests.txt is of gcc 12, and here is gcc 14\n" in capsys.readouterr().err


def test_a_file_that_lacks_what_it_ought_to_say_is_no_match(run):
    digests.FILE.write_text(digests.FILE.read_text().replace(digests.COMPILER, "# "))
    assert run(SAME, "--check") == 0 and run(OTHER, "--check") == 1
    digests.FILE.write_text("")
    assert run(SAME, "--check") == 1
    digests.FILE.unlink()
    assert run(SAME, "--check") == 1


def test_all_boards_are_all_designs(run, capsys):
    assert run(KEPT, "--check", "--board", "all") == 0
    made = SAME | {"design-icebreaker.bin": "6" * 64}
    assert run(made, "--check", "--board", "all") == 1
    said = capsys.readouterr().err
    assert "design-icebreaker.bin: not in" in said
    assert "design-ulx3s.bit: in digests.txt, but not made" in said
    assert run(made, "--board", "all") == 0 and digests.kept() == (COMPILER, made)


def test_writing_keeps_the_designs_and_forgets_old_images(run):
    made = {"firmware-8k-card.hex": "5" * 64}
    assert run(made) == 0
    assert digests.kept() == (COMPILER, made | {"design-ulx3s.bit": "3" * 64})


@pytest.mark.nightly("synth")
def test_a_design_is_placed_and_routed_to_the_same_bytes():
    assert digests.different(digests.of_designs([board("hx8k-breakout")]), ()) == []
