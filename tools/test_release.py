# SPDX-License-Identifier: Apache-2.0
"""The release: its refusals, its boards, the names and sums of its files."""

from __future__ import annotations

import hashlib
import sys
import tarfile

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
    """Neither those of an image, before a board is built, nor those of a bitstream. A draft may have them."""
    made, kept, boards_built = {"firmware-8k-card.hex": "1"}, tmp_path / "digests.txt", []
    bitstream = f"rtu2fc-{NUMBER}-a-card.bin"
    for name in ("add_documents", "add_wheels", "add_sources", "add_firmware"):
        monkeypatch.setattr(release, name, lambda *_: None)
    monkeypatch.setattr(release, "ROOT", tmp_path)
    monkeypatch.setattr(release, "DIST", tmp_path / "dist")
    monkeypatch.setattr(release, "add_bitstreams", lambda *_: boards_built.append(1) or {bitstream: "2"})
    monkeypatch.setattr(release, "licences", str)
    monkeypatch.setattr(release, "firmware", list)
    monkeypatch.setattr(digests, "compiler", lambda: "gcc")
    monkeypatch.setattr(digests, "FILE", kept)
    monkeypatch.setattr(digests, "of_images", lambda _: made)
    for text, reason, built in (
        (f"3  firmware-8k-card.hex\n2  {bitstream}\n", "firmware-8k-card.hex: another digest than in", 0),
        (f"1  firmware-8k-card.hex\n3  {bitstream}\n", f"{bitstream}: another digest than in", 1),
    ):
        kept.write_text(f"{digests.COMPILER}gcc\n{text}")
        with pytest.raises(release.ReleaseError, match=reason):
            release.build(False, [None], "1.2.3")
        assert len(boards_built) == built and not (tmp_path / "dist").exists()
    release.build(True, [None], "1.2.3")
    kept.write_text(f"{digests.COMPILER}gcc\n1  firmware-8k-card.hex\n2  {bitstream}\n")
    release.build(False, [None], "1.2.3")
    assert (tmp_path / "dist/SHA256SUMS").exists()


def test_the_digest_of_a_bitstream_is_that_of_the_file(monkeypatch, tmp_path):
    """So a firmware that changes after its check, while a board is placed, is no release."""
    (packed := tmp_path / "image.bin").write_bytes(b"bits")
    one = digests.Image(digests.Path("build/delay20/firmware.hex"))
    monkeypatch.setattr(release, "bitstreams", lambda *_: [(one, packed)])
    dist = release.Dist(tmp_path, "1.2.3", draft=False)
    made = release.add_bitstreams(dist, boards()["icebreaker"], [])
    name = "rtu2fc-1.2.3-icebreaker-card-delay20.bin"
    assert made == {name: hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()}


def test_no_firmware_of_a_release_promises_a_stop(monkeypatch, tmp_path):
    """No design of the release stops the drive by itself, whatever its firmware says."""
    monkeypatch.setattr(release, "ROOT", tmp_path)
    monkeypatch.chdir(tmp_path)
    images = [digests.Image(digests.Path(f"build{folder}/firmware.hex")) for folder in ("", "/stop")]
    for one in images:
        one.path.parent.mkdir()
        one.path.write_text("00000013\n" * 2048)
    dist = release.Dist(tmp_path, "1.2.3", draft=False)
    release.add_firmware(dist, images)
    assert list(dist.described) == ["rtu2fc-1.2.3-firmware-8k-card.hex"]


def test_the_sources_are_those_of_the_commit(monkeypatch, tmp_path):
    """The same bytes with other settings of git; neither a changed nor an unknown file is in them."""
    (tree := tmp_path / "tree").mkdir()
    monkeypatch.setattr(release, "ROOT", tree)
    (tree / "a.txt").write_text("first\n")
    release.git("init", "-q")
    release.git("add", "a.txt")
    release.git("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-q", "-m", "first")
    dist = release.Dist(tmp_path, "1.2.3", draft=False)
    file = tmp_path / "rtu2fc-1.2.3-source.tar.gz"
    release.add_sources(dist)
    before = file.read_bytes()
    (tree / "a.txt").write_text("second\n")
    (tree / "notes.txt").write_text("private\n")
    release.git("config", "tar.umask", "0")
    release.git("config", "core.autocrlf", "true")
    release.add_sources(dist)
    assert file.read_bytes() == before
    with tarfile.open(file) as packed:
        assert packed.getnames() == ["rtu2fc-1.2.3-source", "rtu2fc-1.2.3-source/a.txt"]
        assert packed.extractfile("rtu2fc-1.2.3-source/a.txt").read() == b"first\n"


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
