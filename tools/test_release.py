# SPDX-License-Identifier: Apache-2.0
"""The release: its refusals, its boards, the names and sums of its files."""

from __future__ import annotations

import hashlib
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


def test_a_draft_says_so_in_each_name(tmp_path):
    files = release.Dist(tmp_path, "9.9.9", draft=True)
    files.add("board", ".bit", b"bits", "a bitstream")
    files.write_sums()
    sums = (tmp_path / "SHA256SUMS-draft").read_text()
    assert sums == f"{hashlib.sha256(b'bits').hexdigest()}  rtu2fc-9.9.9-board-draft.bit\n"


def test_a_release_has_each_board_with_either_kind_of_switches(releasable, monkeypatch):
    assert started(monkeypatch) == 0 and releasable == [(False, 2 * len(boards()))]
    assert started(monkeypatch, "--draft", "--board", "icebreaker-extended") == 0
    assert releasable[1:] == [(True, 1)]
