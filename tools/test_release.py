# SPDX-License-Identifier: Apache-2.0
"""The release: its refusals, its boards, the names and sums of its files."""

from __future__ import annotations

import hashlib
import sys

import pytest

from constraints.boards import boards
from rtl.command import VERSION
from tools import digests, evidence, release, trace
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
    (tree := tmp_path / "tree").mkdir()
    monkeypatch.setattr(release, "ROOT", tree)
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
            lambda patch: patch.setattr(release, "git", lambda *_: "?? notes.txt"),
            "some files are not committed",
        ),
        (
            lambda patch: patch.setenv("FIRMWARE_DEFINES", "-DDIAGNOSTICS=1"),
            "FIRMWARE_DEFINES is set; the images of a release have their own options",
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


def test_the_commit_has_one_name_in_each_clone_and_a_new_file_is_not_committed(releasable, tmp_path):
    """Neither a tag nor a setting of git changes the name."""
    own = ("-c", "user.name=a", "-c", "user.email=a@b")
    release.git("init", "-q")
    release.git(*own, "commit", "-q", "--allow-empty", "-m", "first")

    def named() -> list[str]:
        release.Dist(tmp_path, "1.2.3", draft=False).write_contents()
        content = tmp_path / "rtu2fc-1.2.3-contents.txt"
        lines = content.read_text().splitlines()
        content.unlink()
        return [line for line in lines if line.startswith("commit ")]

    first = named()
    release.git(*own, "tag", "-a", "v1.2.3", "-m", "1.2.3")
    release.git("config", "core.abbrev", "12")
    assert named() == first and len(first[0].split()[1]) == 40
    assert release.refusals(NUMBER, "") == []
    (release.ROOT / "notes.txt").write_text("private")
    assert named() == [f"{first[0]}-dirty"]
    assert release.refusals(NUMBER, "") == ["some files are not committed"]


def test_other_bytes_than_those_of_the_digests_are_no_release(monkeypatch, tmp_path):
    """Neither those of an image, before a board is built, nor those of a design. A draft may have them."""
    made, kept, boards_built = {"firmware-8k-card.hex": "1"}, tmp_path / "digests.txt", []
    for name in ("add_documents", "add_wheels", "add_firmware"):
        monkeypatch.setattr(release, name, lambda *_: None)
    monkeypatch.setattr(release, "ROOT", tmp_path)
    monkeypatch.setattr(release, "DIST", tmp_path / "dist")
    monkeypatch.setattr(release, "add_bitstreams", lambda *_: boards_built.append(1))
    monkeypatch.setattr(release, "licences", str)
    monkeypatch.setattr(release, "firmware", list)
    monkeypatch.setattr(digests, "compiler", lambda: "gcc")
    monkeypatch.setattr(digests, "FILE", kept)
    monkeypatch.setattr(digests, "of_images", lambda _: made)
    monkeypatch.setattr(digests, "of_designs", lambda _: {"design-a.bin": "2"})
    for text, reason, built in (
        ("3  firmware-8k-card.hex\n2  design-a.bin\n", "firmware-8k-card.hex: another digest than in", 0),
        ("1  firmware-8k-card.hex\n3  design-a.bin\n", "design-a.bin: another digest than in", 1),
    ):
        kept.write_text(f"{digests.COMPILER}gcc\n{text}")
        with pytest.raises(release.ReleaseError, match=reason):
            release.build(False, [None], "1.2.3")
        assert len(boards_built) == built and not (tmp_path / "dist").exists()
    release.build(True, [None], "1.2.3")
    kept.write_text(f"{digests.COMPILER}gcc\n1  firmware-8k-card.hex\n2  design-a.bin\n")
    release.build(False, [None], "1.2.3")
    assert (tmp_path / "dist/SHA256SUMS").exists()


def test_the_licences_of_the_soft_cores_go_with_the_bitstreams():
    text = release.licences()
    for holder in ("Apache License", "Claire Xenia Wolf", "Olof Kindgren"):
        assert holder in text


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
