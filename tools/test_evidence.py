# SPDX-License-Identifier: Apache-2.0
"""docs/evidence.json: written by a command that measures, of another card after a change of the card."""

from __future__ import annotations

import subprocess

import pytest

from campaigns.bench import fingerprint
from rtl import report_page
from tools import evidence as tool

TEXT = """# A title

Words.

| case | worst |
|---|---:|
| a \\| b | 0.63 |

## More

| x |
|---|
| 1 |
| 2 |
"""


def test_a_report_leaves_its_tables_and_its_page(written):
    of = {"standard card": "0123456789ab"}
    report_page.publish("one", TEXT, "make one", of, "7 of 7 caught.", ["", "More"])
    assert (written / "one.md").read_text() == TEXT
    entry = report_page.evidence()["one"]
    assert entry["of"] == of and entry["title"] == "A title" and entry["said"] == "7 of 7 caught."
    assert entry["tables"] == {"": [["case", "worst"], ["a \\| b", "0.63"]], "More": [["x"], ["1"], ["2"]]}
    report_page.publish("two", TEXT, "make two", {}, keep=["More"])
    assert report_page.evidence()["one"] == entry, "the figures of others stay"


def test_a_report_of_the_site_has_the_figures_of_the_evidence_alone(written):
    report_page.publish("one", TEXT, "make one", {"standard card": "0123456789ab"}, "7 of 7.", ["More"])
    (written / "one.md").write_text(TEXT.replace("| 2 |", "| 3 |"))
    text = report_page.page_of("one")
    for part in (
        "# A title\n",
        "`make one`",
        "`build/reports/one.md`",
        "card `0123456789ab`",
        "7 of 7.",
        "| 2 |",
    ):
        assert part in text


@pytest.fixture
def two_reports(written, monkeypatch) -> None:
    """One of the standard card, one of both, and one that nothing makes any more."""
    monkeypatch.setattr(
        tool, "REPORTS", {"one": ("make-one COUNT=2 SEED={seed}", "one PAGE=yes"), "two": ("make-two",)}
    )
    for name in ("one", "two", "gone"):
        subjects = ("standard card", "tiny card") if name == "two" else ("standard card",)
        report_page.record(name, "", f"make {name}", fingerprint.now(*subjects), "", {})


def test_figures_of_another_card_are_named(two_reports, monkeypatch, capsys):
    assert tool.check() == 0
    monkeypatch.setitem(fingerprint.SUBJECTS, "tiny card", lambda: "another")
    assert tool.older() == {"two": "another tiny card"}
    assert tool.check() == 1
    assert "two: another tiny card; make evidence ONLY=two" in capsys.readouterr().out.splitlines()


def test_only_what_is_of_another_card_is_measured_again(two_reports, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["evidence"])
    monkeypatch.setenv("MAKEFLAGS", " -- ONLY=two")
    ran: list[list[str]] = []

    def run(command: list[str], env: dict[str, str], **how) -> subprocess.CompletedProcess:
        assert "MAKEFLAGS" not in env, "a variable of this command is none of the others"
        ran.append(command[2:])
        return subprocess.CompletedProcess(command, 2)

    monkeypatch.setattr(tool.subprocess, "run", run)
    assert tool.main() == 0 and not ran
    assert set(report_page.evidence()) == {"one", "two"}
    monkeypatch.setitem(fingerprint.SUBJECTS, "standard card", lambda: "another")
    assert tool.main() == 1
    assert [command[0] for command in ran] == ["make-one", "one", "make-two"], "a failure stops nothing else"
    assert ran[0][1] == "COUNT=2" and ran[0][2].startswith("SEED=")
    assert "evidence: failed: two: make make-two: exit code 2" in capsys.readouterr().out


def test_a_report_that_its_commands_leave_as_it_was_is_a_failure(two_reports, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["evidence"])
    monkeypatch.setitem(fingerprint.SUBJECTS, "tiny card", lambda: "another")
    done = subprocess.CompletedProcess([], 0)
    monkeypatch.setattr(tool.subprocess, "run", lambda command, **how: done)
    assert tool.main() == 1
    assert "evidence: failed: two: no command renewed it" in capsys.readouterr().out


def test_a_stopped_command_stops_the_whole(two_reports, monkeypatch):
    monkeypatch.setattr("sys.argv", ["evidence"])
    monkeypatch.setitem(fingerprint.SUBJECTS, "standard card", lambda: "another")
    stopped = subprocess.CompletedProcess([], 130)
    monkeypatch.setattr(tool.subprocess, "run", lambda command, **how: stopped)
    with pytest.raises(KeyboardInterrupt):
        tool.main()


@pytest.mark.parametrize("name", tool.SUBJECTS)
def test_a_changed_module_or_design_is_named(name):
    now = tool.SUBJECTS[name]()
    assert tool.changed(name, now) == []
    first = next(iter(now))
    assert tool.changed(name, now | {first: "another"}) == [first]


def test_each_subject_in_git_is_one_that_can_be_compared():
    judges = {f"{path.parent.name} judge" for path in (report_page.ROOT / "campaigns").glob("*/run.py")}
    for name, entry in report_page.evidence().items():
        assert name in tool.SUBJECTS or entry["of"].keys() <= fingerprint.SUBJECTS.keys() | judges, name
    assert report_page.EVIDENCE.stat().st_size < 100_000
