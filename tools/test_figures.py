# SPDX-License-Identifier: Apache-2.0
"""docs/evidence.json: written by a command that measures, of another card after a change of the card."""

from __future__ import annotations

import pytest

from campaigns.bench import fingerprint
from rtl import report_page
from tools import figures

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
    assert (written / "one.md").read_text() == report_page.page_of("one") == TEXT
    entry = report_page.evidence()["one"]
    assert entry["of"] == of and entry["title"] == "A title" and entry["said"] == "7 of 7 caught."
    assert entry["tables"] == {"": [["case", "worst"], ["a \\| b", "0.63"]], "More": [["x"], ["1"], ["2"]]}
    report_page.publish("two", TEXT, "make two", {}, keep=["More"])
    assert report_page.evidence()["one"] == entry, "the figures of others stay"


def test_without_its_page_a_report_has_its_figures_and_names_its_command(written):
    report_page.publish("one", TEXT, "make one", {"standard card": "0123456789ab"}, "7 of 7.", ["More"])
    (written / "one.md").unlink()
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


def test_figures_of_another_card_are_named_with_their_command(written, monkeypatch, capsys):
    for name in ("one", "two"):
        subjects = ("standard card", "tiny card") if name == "two" else ("standard card",)
        report_page.record(name, "", f"make {name}", fingerprint.now(*subjects), "", {})
    assert figures.older() == {}
    monkeypatch.setitem(fingerprint.SUBJECTS, "tiny card", lambda: "another")
    assert figures.older() == {"two": "make two"}
    assert figures.main() == 1
    assert capsys.readouterr().out == "one: of this card\ntwo: another tiny card; make two\n"


@pytest.mark.parametrize("name", figures.SUBJECTS)
def test_a_changed_module_or_design_is_named(name):
    now = figures.SUBJECTS[name]()
    assert figures.changed(name, now) == []
    first = next(iter(now))
    assert figures.changed(name, now | {first: "another"}) == [first]


def test_each_subject_in_git_is_one_that_can_be_compared():
    judges = {f"{path.parent.name} judge" for path in (report_page.ROOT / "campaigns").glob("*/run.py")}
    for name, entry in report_page.evidence().items():
        assert name in figures.SUBJECTS or entry["of"].keys() <= fingerprint.SUBJECTS.keys() | judges, name
    assert report_page.EVIDENCE.stat().st_size < 100_000
