# SPDX-License-Identifier: Apache-2.0
"""The report page: all in one file, nothing left out, and what failed stands there as failed."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections import Counter
from dataclasses import asdict
from html.parser import HTMLParser

import pytest

from rtl.sources import ROOT, commit
from tools import chromium, report, trace
from tools.report import Run
from tools.trace import Result

pytestmark = pytest.mark.nightly("pages")

pytest_plugins = ("pytester",)

RULES = trace.read_rules()
SHOWN = {
    "SAFE-1": ["tb/test_b.py::test_gate", "tb/test_b.py::test_line"],
    "FC-1": ["tb/test_a.py::test_frame"],
}
NEW, OLD = {"commit": "abc1234", "at": "2026-01-02 03:04"}, {"commit": "0dd0123", "at": "2025-12-31 23:59"}
RESULTS = {
    "tb/test_a.py::test_frame": Result("passed", **NEW),
    "tb/test_b.py::test_gate": Result("passed", **OLD),
    "tb/test_b.py::test_line": Result("failed", **NEW),
    "tb/test_b.py::test_gone": Result("failed", **OLD),
    "tb/gates/all.py::test_netlist": Result("passed", **NEW),
}
COLLECTED = {
    *(test for test in RESULTS if "gone" not in test and "gates" not in test),
    "tb/test_c.py::test_new",
}


def built(**changed: Result) -> str:
    return report.build(Run(RESULTS | changed, COLLECTED, SHOWN))


class Page(HTMLParser):
    """What the page asks for, where its links lead, its identifiers, and whether each element is closed."""

    EMPTY = ("meta", "img", "br", "hr", "link", "input", "wbr")

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
    return built()


def test_the_page_needs_nothing_but_itself(text: str):
    page = Page(text)
    assert page.open == []
    assert all(asked.startswith("data:image/") for asked in page.asked)
    assert all(link.startswith("#") and link[1:] in page.ids for link in page.links)
    assert page.count["script"] == 0 and "@import" not in text and "url(" not in text


def test_every_rule_stands_in_it_with_its_result(text: str):
    rows = dict(re.findall(r"<tr><td>([A-Z0-9-]+)</td>(.*?)</tr>", text))
    assert set(RULES) <= set(rows)
    older = ' <span class="old">(1 older)</span>'
    assert f"<td>1 failed, 1 passed{older}</td><td>test_b.py</td>" in rows["SAFE-1"]
    assert "<td>1 passed</td><td>test_a.py</td>" in rows["FC-1"]
    assert "<td>-</td><td></td>" in rows["FC-2"], "no test has shown it"


def test_a_failed_test_is_named(text: str):
    assert '<b class="bad">1</b><span>tests failed</span>' in text
    assert "failed: <code>tb/test_b.py::test_line</code>" in text
    good = built(**{"tb/test_b.py::test_line": Result("passed", **NEW)})
    assert '<b class="good">0</b><span>tests failed</span>' in good


def test_results_say_of_what_they_are(text: str):
    """How many of all, of which commit; what is gone is not shown, what is old is marked."""
    assert '<b class="">3 of 4</b><span>tests run</span>' in text
    words = "3 of 4 tests have been run, the newest of commit <code>abc1234</code>"
    assert f"{words} on 2026-01-02 03:04 to 2026-01-02 03:04 UTC; 1 more on other cards or netlists." in text
    assert '<span class="old">1 older, of commit <code>0dd0123</code>.</span>' in text
    assert "test_gone" not in text
    rows = dict(re.findall(r"<tr><td><code>([\w./]+)</code></td>(.*?)</tr>", text))
    assert rows["test_b.py"] == "<td>1</td><td>1</td><td></td><td>1</td>"
    assert rows["test_c.py"] == "<td></td><td></td><td>1</td><td></td>"
    assert rows["gates/all.py"] == "<td>1</td><td></td><td></td><td></td>"


def test_red_is_only_what_has_failed():
    """After a part of the tests, all of which passed: nothing is red."""
    run = Run({"tb/test_a.py::test_frame": Result("passed", **NEW)}, COLLECTED, SHOWN)
    for section in (report.summary(run), report.rules(run), report.tests(run)):
        assert 'class="bad"' not in section.body
    older = Run(RESULTS | {"tb/test_b.py::test_line": Result("passed", **OLD)}, COLLECTED, SHOWN)
    assert 'class="old"' in report.summary(older).body and 'class="bad"' not in report.summary(older).body


# What of a scrolled table does not stay in sight.
PHONE = """
document.body.style.width = "390px"; // the browser's window is never narrower than 500
const hidden = [];
if (document.body.scrollWidth > 390) hidden.push(`page: ${document.body.scrollWidth}`);
for (const box of document.querySelectorAll(".tables")) {
  const wide = box.scrollWidth > box.clientWidth + 1;
  const name = box.closest("section").id;
  if (wide && !getComputedStyle(box).maskImage.includes("gradient")) hidden.push(`${name}: no sign of more`);
  box.scrollLeft = 9999;
  const [edge, first, last] = [box, ...["first", "last"].map(which => box.querySelector(`td:${which}-child`))]
    .map(one => one.getBoundingClientRect());
  if (first.left < edge.left - 1) hidden.push(`${name}: first column`);
  if (last.right > edge.right - 20) hidden.push(`${name}: last column`);
}
return hidden;
"""


def test_a_table_can_be_read_on_a_phone(text: str, tmp_path):
    assert chromium.evaluate(text, PHONE, tmp_path, 500).found == []


def test_a_run_writes_its_commit_and_time(pytester: pytest.Pytester):
    """The real hooks of tb/lib/pytest_plugin.py in a session of their own."""
    results = pytester.path / "results.json"
    results.write_text('{"test_x.py::test_y": "passed"}')
    pytester.makeconftest(
        "from pathlib import Path\n"
        "from tb.lib import pytest_plugin\n"
        f"pytest_plugin.RESULTS = Path({str(results)!r})\n"
        "from tb.lib.pytest_plugin import pytest_runtest_logreport, pytest_sessionfinish\n"
    )
    pytester.makepyfile("def test_good(): pass\ndef test_bad(): assert False")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    subprocess.run(command, cwd=pytester.path, env=environment, capture_output=True, check=False)
    written = json.loads(results.read_text())
    name = "test_a_run_writes_its_commit_and_time.py"
    assert written["test_x.py::test_y"] == "passed", "a part run takes nothing away"
    for test, outcome in (("test_good", "passed"), ("test_bad", "failed")):
        entry = written[f"{name}::{test}"]
        assert (entry["outcome"], entry["commit"]) == (outcome, commit())
        assert re.fullmatch(r"20\d\d-\d\d-\d\d \d\d:\d\d", entry["at"])


def run(*arguments: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "tools.report", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_bad_input_ends_in_a_line(tmp_path, monkeypatch, capsys):
    done = run("--paper", "A4")
    assert done.returncode == 2 and "unrecognized arguments" in done.stderr
    wrong = (("{", "report: "), ('{"a": {"b": 1}}', "report: "), (None, "report: no test has run yet"))
    for content, said in wrong:
        results = tmp_path / "results.json"
        results.unlink(missing_ok=True)
        if content is not None:
            results.write_text(content)
        monkeypatch.setattr(trace, "RESULTS", results)
        monkeypatch.setattr(sys, "argv", ["report", "--out", str(tmp_path / "x.html")])
        assert report.main() == 2
        captured = capsys.readouterr().err
        assert captured.startswith(said) and captured.count("\n") == 1
    results.write_text(json.dumps({test: asdict(result) for test, result in RESULTS.items()}))
    collector = trace.Collector()
    collector.all, collector.tests = COLLECTED, SHOWN
    monkeypatch.setattr(trace, "collect", lambda: collector)
    monkeypatch.setattr(sys, "argv", ["report", "--out", str(tmp_path)])
    assert report.main() == 2, "the place is a folder"


def test_a_cocotb_test_that_no_run_has_chosen_is_named(tmp_path):
    written = "@cocotb.test()\nasync def one(dut): pass\n@cocotb.test()\n@cocotb.parametrize(a=[1])\n"
    (tmp_path / "tb").mkdir()
    (tmp_path / "tb/test_x.py").write_text(f"{written}async def two(dut, a): pass\n")
    run = tmp_path / "runs/test_x.test_x-icarus"
    run.mkdir(parents=True)
    for names, left in ((["one"], ["two"]), (["one", "two/a=1"], [])):
        cases = "".join(f'<testcase classname="tb.test_x" name="{name}"/>' for name in names)
        (run / "results.xml").write_text(f"<testsuites><testsuite>{cases}</testsuite></testsuites>")
        tests = {"tb/test_x.py::test_x"}
        found = trace.never_chosen(tests, dict.fromkeys(tests, "passed"), tmp_path, tmp_path / "runs")
        assert found == [f"tb/test_x.py: no run has chosen {name}" for name in left]
        assert trace.never_chosen(tests, {}, tmp_path, tmp_path / "runs") == []
