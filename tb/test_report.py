# SPDX-License-Identifier: Apache-2.0
"""The report page: all in one file, nothing left out, and what failed stands there as failed."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections import Counter
from html.parser import HTMLParser

import pytest

from tools import report, trace
from tools.sources import ROOT

RULES = trace.read_rules()
SHOWN = {
    "SAFE-1": ["tb/test_b.py::test_gate", "tb/test_b.py::test_line"],
    "FC-1": ["tb/test_a.py::test_frame"],
}
RESULTS = {
    "tb/test_a.py::test_frame": "passed",
    "tb/test_b.py::test_gate": "passed",
    "tb/test_b.py::test_line": "failed",
}


class Page(HTMLParser):
    """What the page asks for, where its links lead, its identifiers, and whether each element is closed."""

    EMPTY = ("meta", "img", "br", "hr", "link", "input")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.asked, self.links, self.ids, self.open = [], [], [], []
        self.count = Counter()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.count[tag] += 1
        if tag not in self.EMPTY:
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "srcset", "data") or (name == "href" and tag != "a"):
                self.asked.append(value)
            if name == "href" and tag == "a":
                self.links.append(value)
            if name == "id":
                self.ids.append(value)

    def handle_endtag(self, tag: str) -> None:
        if tag in self.EMPTY:
            return
        while self.open and self.open[-1] != tag and self.open[-1] in ("p", "li"):
            self.open.pop()
        assert self.open and self.open.pop() == tag, f"</{tag}> closes nothing"


@pytest.fixture(scope="module")
def text() -> str:
    return report.build(RESULTS, SHOWN)


def test_the_page_needs_nothing_but_itself(text: str):
    page = Page(text)
    assert page.open == []
    assert page.asked and all(asked.startswith("data:image/") for asked in page.asked)
    assert all(link.startswith("#") and link[1:] in page.ids for link in page.links)
    assert page.count["script"] == 0 and "@import" not in text and "url(" not in text


def test_every_picture_of_every_page_is_in_it(text: str):
    pictures = [
        picture
        for name in report.PAGES
        if (file := ROOT / f"docs/{name}.md").exists()
        for picture in re.findall(r"!\[.*?\]\(", file.read_text())
    ]
    assert len(pictures) >= 12
    assert Page(text).count["img"] == len(pictures)


def test_every_rule_stands_in_it_with_its_result(text: str):
    rows = dict(re.findall(r"<tr><td>([A-Z0-9-]+)</td>(.*?)</tr>", text))
    assert set(RULES) <= set(rows)
    assert "<td>1 failed, 1 passed</td><td>test_b.py</td>" in rows["SAFE-1"]
    assert "<td>1 passed</td><td>test_a.py</td>" in rows["FC-1"]
    assert "<td>-</td><td></td>" in rows["FC-2"], "no test has shown it"


def test_a_failed_test_is_named(text: str):
    assert '<b class="bad">1</b><span>tests failed</span>' in text
    assert "failed: <code>tb/test_b.py::test_line</code>" in text
    assert '<b class="good">0</b><span>tests failed</span>' in report.build(
        {"tb/test_a.py::test_frame": "passed"}, SHOWN
    )


def test_a_page_that_is_not_written_yet_is_missed(text: str, monkeypatch):
    monkeypatch.setitem(report.PAGES, "weather", "make weather")
    assert "Not there yet: <code>make weather</code> writes it." in report.build(RESULTS, SHOWN)
    assert "Not there yet: <code>make weather" not in text


def run(*arguments: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "tools.report", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_bad_input_ends_in_a_line(tmp_path, monkeypatch, capsys):
    done = run("--paper", "A4")
    assert done.returncode == 2 and "unrecognized arguments" in done.stderr
    for content, said in (("{", "report: "), (None, "report: no test has run yet")):
        results = tmp_path / "results.json"
        results.unlink(missing_ok=True)
        if content is not None:
            results.write_text(content)
        monkeypatch.setattr(trace, "RESULTS", results)
        monkeypatch.setattr(sys, "argv", ["report", "--out", str(tmp_path / "x.html")])
        assert report.main() == 2
        captured = capsys.readouterr().err
        assert captured.startswith(said) and captured.count("\n") == 1
    results.write_text(json.dumps(RESULTS))
    monkeypatch.setattr(trace, "collect", lambda: SHOWN)
    monkeypatch.setattr(sys, "argv", ["report", "--out", str(tmp_path)])
    assert report.main() == 2, "the place is a folder"
