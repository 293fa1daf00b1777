# SPDX-License-Identifier: Apache-2.0
"""tools/digests.txt: a changed image or design is named, and a check that compares nothing does not pass."""

from __future__ import annotations

import sys

import pytest

from constraints.boards import board
from tools import digests
from tools.digests import BITSTREAM, DESIGN, FIRMWARE

COMPILER = "gcc 12"
KEPT = {"firmware-8k-card.hex": "1" * 64, "firmware-8k-builtin.hex": "2" * 64}
KEPT |= {"design-ulx3s.bit": "3" * 64, "rtu2fc-1.2.3-ulx3s-card.bit": "7" * 64}


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
            kind: {name: made[name] for name in made if name.startswith(kind)}
            for kind in (FIRMWARE, DESIGN, BITSTREAM)
        }
        monkeypatch.setattr(digests, "compiler", lambda: compiler)
        monkeypatch.setattr(digests, "of_images", lambda images: kinds[FIRMWARE])
        monkeypatch.setattr(digests, "of_designs", lambda entries: kinds[DESIGN] if entries else {})
        monkeypatch.setattr(digests, "of_bitstreams", lambda entries, _: kinds[BITSTREAM] if entries else {})
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


def test_a_name_has_one_digest(run):
    with digests.FILE.open("a") as file:
        file.write(f"{'8' * 64}  firmware-8k-card.hex\n")
    with pytest.raises(digests.BuildError, match="has a name twice"):
        run(OTHER, "--check")


def test_all_boards_are_all_designs_and_bitstreams(run, capsys):
    assert run(KEPT, "--check", "--board", "all") == 0
    made = SAME | {"design-icebreaker.bin": "6" * 64}
    assert run(made, "--check", "--board", "all") == 1
    said = capsys.readouterr().err
    assert "design-icebreaker.bin: not in" in said
    for name in ("design-ulx3s.bit", "rtu2fc-1.2.3-ulx3s-card.bit"):
        assert f"{name}: in digests.txt, but not made" in said
    assert run(made, "--board", "all") == 0 and digests.kept() == (COMPILER, made)


def test_writing_keeps_the_boards_and_forgets_old_images(run):
    made = {"firmware-8k-card.hex": "5" * 64}
    assert run(made) == 0
    boards = {name: value for name, value in KEPT.items() if not name.startswith(FIRMWARE)}
    assert digests.kept() == (COMPILER, made | boards)


def test_a_bitstream_has_the_name_of_its_file_in_the_release(monkeypatch, tmp_path):
    """A board's memory decides which images fit; the option that stops nothing there is left out."""
    entry, memory = board("hx8k-breakout"), "00000013\n"
    paths = [
        tmp_path / folder / "firmware.hex"
        for folder in ("build", "build/stop", "build/builtin/gaps", "build/large")
    ]
    for path in paths:
        path.parent.mkdir(parents=True)
        path.write_text(memory * (entry.memory_words * (2 if "large" in path.parts else 1)))
    monkeypatch.setattr(digests, "design", lambda _: None)
    monkeypatch.setattr(digests.image, "make", lambda _, hex_file, to: to.write_bytes(hex_file.read_bytes()))
    monkeypatch.setattr(digests, "ROOT", tmp_path)
    monkeypatch.chdir(tmp_path)
    made = digests.of_bitstreams([entry], [digests.Image(path.relative_to(tmp_path)) for path in paths])
    version = digests.VERSION.read_text().strip()
    assert set(made) == {f"rtu2fc-{version}-hx8k-breakout-{name}.bin" for name in ("card", "builtin-gaps")}
    assert set(made.values()) == {digests.digest(paths[0])}


def test_an_image_is_built_from_its_sources_whatever_the_times_of_files_say(monkeypatch):
    """An image that is newer than a changed source must not pass as that of the source."""
    said = []
    run = digests.subprocess.run
    monkeypatch.setattr(
        digests.subprocess, "run", lambda command, **more: said.append(command) or run(["true"], **more)
    )
    digests.firmware()
    assert said and all("-sB" in command for command in said)


@pytest.mark.nightly("synth")
def test_a_design_is_placed_and_routed_to_the_same_bytes():
    assert digests.different(digests.of_designs([board("hx8k-breakout")]), ()) == []
