# SPDX-License-Identifier: Apache-2.0
"""The release: its refusals, its files, and a second build with the same bytes."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest

from constraints.boards import boards
from rtl.command import VERSION
from tools import evidence, release, trace
from tools.trace import Result

NUMBER = VERSION.read_text().strip()
CHANGES = """# Changelog

## [Unreleased]

## [1.2.3] - 2026-12-01

### Added

- A thing.
"""


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
    monkeypatch.setattr(evidence, "older", dict)
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
            lambda patch: patch.setattr(evidence, "older", lambda: {"bench": "standard card"}),
            "figures are of an older card, and `make evidence` renews them: bench",
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


def test_a_release_has_each_board_with_either_kind_of_switches(releasable, monkeypatch):
    assert started(monkeypatch) == 0 and releasable == [(False, 2 * len(boards()))]
    assert started(monkeypatch, "--draft", "--board", "icebreaker-extended") == 0
    assert releasable[1:] == [(True, 1)]
