# SPDX-License-Identifier: Apache-2.0
"""The release: its refusals, its files, and a second build with the same bytes."""

from __future__ import annotations

import io
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from packaging.utils import parse_wheel_filename

from constraints.boards import board, boards
from regs.dialects import DIALECTS, IMAGES, STANDARD
from rtl.command import VERSION, version
from rtl.sources import ROOT
from tb.firmware.test_firmware_images import images
from tb.model.card import OBJECTS
from tools import datasheet, figures, release, trace, wheels
from tools.release import Image
from tools.trace import Result

NUMBER = VERSION.read_text().strip()
CHANGES = """# Changelog

## [Unreleased]

## [1.2.3] - 2026-12-01

### Added

- A thing.
"""


def test_one_number_everywhere():
    """Also in build/card and in the replies of functions 11 and 2B/0E: sim/card/test_virtual_card.py."""
    assert re.fullmatch(r"\d+\.\d+\.\d+", NUMBER)
    assert version("name") == f"rtu2fc {NUMBER}, name"
    assert f'#define CARD_VERSION "{NUMBER}"\n' in (ROOT / "regs/generated/version.h").read_text()
    assert OBJECTS[2] == NUMBER.encode()
    done = subprocess.run(
        ["tools/setup.sh", "--version"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout == f"rtu2fc {NUMBER}, setup\n"


def test_the_changelog_has_a_section_of_the_release():
    missing = "CHANGELOG.md has no section `## [1.2.3] - YYYY-MM-DD`"
    left = "CHANGELOG.md has entries below [Unreleased]; move them to 1.2.3"
    for text, wrong in (
        (CHANGES, []),
        (CHANGES.replace("1.2.3", "1.2.30"), [missing]),
        (CHANGES.replace(" - 2026-12-01", ""), [missing]),
        (CHANGES.replace("## [1", "- New.\n\n## [1"), [left]),
    ):
        assert list(release.changelog_wrong(text, "1.2.3")) == wrong


def test_every_test_has_passed_on_the_commit():
    good = Result("passed", "now")
    assert list(release.tests_wrong({"a": good, "b": good}, {"a", "b"}, "now")) == []
    for of_b in ({"b": Result("passed", "before")}, {"b": Result("failed", "now")}, {}):
        (line,) = release.tests_wrong({"a": good} | of_b, {"a", "b"}, "now")
        assert line.startswith("1 of 2 tests have not passed on commit now; run `make nightly`")


@pytest.fixture
def releasable(monkeypatch, tmp_path):
    """A tree without a reason to refuse. Each build is noted instead."""
    built = []
    changelog = tmp_path / "CHANGELOG.md"
    changelog.write_text(CHANGES.replace("1.2.3", NUMBER))
    found = trace.Collector()
    found.all.add("a")
    monkeypatch.setattr(release, "CHANGELOG", changelog)
    monkeypatch.setattr(release, "commit", lambda: "abc1234")
    monkeypatch.setattr(figures, "older", dict)
    monkeypatch.setattr(trace, "collect", lambda: found)
    monkeypatch.setattr(trace, "read_results", lambda: {"a": Result("passed", "abc1234")})
    monkeypatch.setattr(release, "build", lambda draft, chosen, _: built.append((draft, len(chosen))))
    return built


def started(monkeypatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["release", *words])
    return release.main()


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (
            lambda patch: patch.setattr(figures, "older", lambda: {"results": "make bench"}),
            "figures are of an older card, and these commands renew them: results (make bench)",
        ),
        (
            lambda patch: patch.setattr(release, "commit", lambda: ""),
            "the commit is not known: this folder is no git repository",
        ),
        (
            lambda patch: patch.setattr(release, "commit", lambda: "abc1234-dirty"),
            "some files are not committed",
        ),
        (
            lambda patch: patch.setattr(trace, "read_results", dict),
            "1 of 1 tests have not passed on commit abc1234; run `make nightly`",
        ),
    ],
)
def test_a_release_is_refused_and_a_draft_is_not(releasable, monkeypatch, capsys, change, line):
    change(monkeypatch)
    assert started(monkeypatch) == 1 and releasable == []
    assert capsys.readouterr().err.splitlines() == [
        f"release: refused: {line}",
        "release: DRAFT=1 builds it all the same and names each file -draft",
    ]
    assert started(monkeypatch, "--draft", "--board", "icebreaker") == 0
    assert releasable == [(True, 1)]


def test_the_tag_is_that_of_the_version(releasable, monkeypatch, capsys):
    assert started(monkeypatch, "--tag", "v9.9.9") == 1
    assert f"the tag is v9.9.9, but VERSION says v{NUMBER}" in capsys.readouterr().err
    assert started(monkeypatch, "--tag", f"v{NUMBER}") == 0 and len(releasable) == 1


def firmware_images() -> list[Image]:
    return [Image(Path(name)) for name in images()]


def test_images_have_the_names_of_their_dialect_and_option():
    names = {str(image.path.parent): image.name for image in firmware_images()}
    assert len(names) == 3 + sum(len(image.dialects) for image in IMAGES.values()) + 2 * len(DIALECTS) - 2
    assert (names["build"], names["build/tiny"], names["build/large/builtin"]) == ("card", "card", "builtin")
    assert names[f"build/norefresh/{STANDARD}"] == "hvac-basic-norefresh"
    assert names["build/large/all/builtin"] == "builtin-all"


@pytest.mark.nightly
def test_the_data_sheet_offers_what_a_release_has():
    """No image with MASTER_LOSS_STOP alone, which does nothing in these designs."""
    rows = re.findall(r"<tr><td><code>([\w-]+)</code></td>.*?<td>([\w, -]+)</td></tr>", datasheet.images())
    offered = {name: sorted(images.split(", ")) for name, images in rows}
    images = release.firmware()
    assert offered == {
        name: sorted(image.name for image in release.fitting(entry, images))
        for name, entry in boards().items()
    }
    assert not [name for names in offered.values() for name in names if "stop" in name]


@pytest.mark.nightly
def test_an_image_built_elsewhere_has_the_same_bytes(tmp_path):
    for name in ("sw", "regs/generated", "configs.toml", "constraints/boards.toml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copyfile
        copy(ROOT / name, tmp_path / name)
    target = "build/tiny/firmware.hex"
    command = ["make", "-s", "-f", "sw/firmware.mk", f"FIRMWARE_PYTHON={sys.executable}", target]
    clean = {name: value for name, value in os.environ.items() if not re.match(r"MAKE|MFLAGS", name)}
    subprocess.run(command, cwd=tmp_path, env=clean, capture_output=True, check=True)
    assert (tmp_path / target).read_text() == (ROOT / target).read_text()


def test_an_archive_depends_on_names_and_contents_alone(tmp_path):
    def folder(name: str, *files: str) -> Path:
        for file in files:
            path = tmp_path / name / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(f"{file}\n" * 50)
            os.utime(path, (len(name), 1e9 + len(name)))
        return tmp_path / name

    one = release.archive(folder("one", "b/c", "a"), "top")
    other = folder("another", "a", "b/c")
    (other / "a").chmod(0o600)
    assert release.archive(other, "top") == one
    with zipfile.ZipFile(io.BytesIO(one)) as packed:
        entries = [(entry.filename, entry.date_time[0]) for entry in packed.infolist()]
    assert entries == [("top/a", 1980), ("top/b/c", 1980)]
    (other / "a").write_text("changed")
    assert release.archive(other, "top") != one


@pytest.fixture
def dist(monkeypatch, tmp_path):
    """A draft of two files in a folder of its own."""
    monkeypatch.setattr(release, "ROOT", tmp_path)
    monkeypatch.setattr(release, "DIST", tmp_path / "build/dist")
    monkeypatch.setattr(release, "AGAIN", tmp_path / "build/again")
    files = release.Dist(release.DIST, "9.9.9", draft=True)
    release.DIST.mkdir(parents=True)
    files.add("board", ".bit", b"bits", "a bitstream")
    files.add("firmware", ".hex", b"image", "an image")
    files.write_sums()
    return files


@pytest.mark.nightly
def test_a_draft_of_a_wheel_has_a_build_tag(tmp_path):
    """The form of a wheel's name is fixed: installers refuse another one."""
    files = release.Dist(tmp_path, "9.9.9", draft=True)
    release.add_wheels(files)
    builds = {name: parse_wheel_filename(name)[2] for name in files.described}
    assert len(builds) == len(wheels.PACKAGES) and set(builds.values()) == {(0, "draft")}


def test_files_of_a_draft_say_so(dist):
    names = {path.name for path in release.DIST.iterdir()}
    assert names == {"rtu2fc-9.9.9-board-draft.bit", "rtu2fc-9.9.9-firmware-draft.hex", "SHA256SUMS-draft"}
    command = ["sha256sum", "--check", "--strict", "SHA256SUMS-draft"]
    assert subprocess.run(command, cwd=release.DIST, capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize("change", ["", "board"])
def test_check_names_what_the_second_build_made_otherwise(dist, monkeypatch, capsys, change):
    """The second build is a copy of the first, with one more byte in the file `change`."""

    def second(_command, **_options):
        again = release.AGAIN / "build/dist"
        shutil.copytree(release.DIST, again)
        if change:
            with open(again / dist.name(change, ".bit"), "ab") as file:
                file.write(b"!")
        (again / "SHA256SUMS-draft").unlink()
        release.Dist(again, "9.9.9", draft=True).write_sums()
        return subprocess.CompletedProcess([], 0)

    monkeypatch.setattr(release, "copy_sources", lambda target: target.mkdir(parents=True))
    monkeypatch.setattr(release.subprocess, "run", second)
    assert release.check(["--draft"], True, "9.9.9", []) == bool(change)
    said = capsys.readouterr().out.splitlines()[-1]
    if change:
        assert said.startswith(
            "release: rtu2fc-9.9.9-board-draft.bit differs between build/dist and build/again"
        )
    else:
        assert said == "2 files: the second build gave the same bytes" and not release.AGAIN.exists()


def test_the_second_build_has_every_file_but_ignored_ones(monkeypatch, tmp_path):
    tree, target = tmp_path / "tree", tmp_path / "again"
    for name, text in (
        (".gitignore", "build/\n"),
        ("sub/new", "new"),
        ("kept", "kept"),
        ("build/old", "old"),
    ):
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        (tree / name).write_text(text)
    for command in (["init", "-q"], ["add", "kept"]):
        subprocess.run(["git", *command], cwd=tree, check=True, capture_output=True)
    monkeypatch.setattr(release, "ROOT", tree)
    release.copy_sources(target)
    found = {str(path.relative_to(target)): path.read_text() for path in target.rglob("*") if path.is_file()}
    assert found == {".gitignore": "build/\n", "sub/new": "new", "kept": "kept"}
    (tree / "kept").write_text("changed")
    release.copy_sources(target)
    assert (target / "kept").read_text() == "changed"


def test_a_release_has_each_board_with_either_kind_of_switches(releasable, monkeypatch):
    assert started(monkeypatch) == 0 and releasable == [(False, 2 * len(boards()))]
    assert started(monkeypatch, "--draft", "--board", "icebreaker-extended") == 0
    assert releasable[1:] == [(True, 1)]


def test_check_distinguishes_the_two_kinds_of_a_board():
    one, other = board("icebreaker"), board("icebreaker-extended")
    for entry in (one, other):
        files = [f"rtu2fc-9.9.9-{entry.name}-{name}.bin" for name in ("card", "builtin-refresh")]
        assert release.other_boards([*files, "SHA256SUMS"], "9.9.9", [entry]) == []
        assert release.other_boards(files, "9.9.9", [one, other]) == [
            each.name for each in (one, other) if each != entry
        ]


def test_check_needs_a_whole_release(dist):
    with pytest.raises(release.ReleaseError, match=r"SHA256SUMS is not there; run `make release` first$"):
        release.check([], False, "9.9.9", [])
    (release.DIST / "rtu2fc-9.9.9-board-draft.bit").write_bytes(b"bats")
    with pytest.raises(release.ReleaseError, match="is not what SHA256SUMS-draft says"):
        release.check([], True, "9.9.9", [])
