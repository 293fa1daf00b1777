# SPDX-License-Identifier: Apache-2.0
"""The data sheet: the figures of docs/evidence.json, on two pages, with the same bytes in each run."""

from __future__ import annotations

import json
import re
import time

import pytest

from constraints.boards import boards
from rtl import report_page
from rtl.sources import ROOT
from tools import datasheet
from tools.datasheet import DatasheetError

pytestmark = pytest.mark.nightly("pages")


@pytest.fixture
def change(written):
    """Writes a copy of docs/evidence.json with another text in it."""
    text = (ROOT / "docs/evidence.json").read_text()
    report_page.EVIDENCE.write_text(text)

    def changed(was: str, now: str) -> None:
        assert was in text
        report_page.EVIDENCE.write_text(text.replace(was, now, 1))

    return changed


def test_everything_is_named():
    page = datasheet.page()
    top = (ROOT / "rtl/rtu2fc.v").read_text().split(");", 1)[0]
    for name in re.findall(r"^ +(?:parameter|input|output)\b.*?(\w+)(?: =.*)?,?$", top, re.MULTILINE):
        assert re.search(rf"<code>{name}(\[\d:\d\])?</code>", page), name
    for name, entry in boards().items():
        assert page.count(f"<code>{name}</code>") == 2 and page.count(entry.part) == 2
    assert page.count("not published") > 5
    assert not re.search(r"\{\w+\}|https?:", page)


@pytest.mark.parametrize(
    ("report", "heading", "row"),
    [
        ("results", "The targets", "local request"),
        ("results", "Turnaround, rate by rate", "19200"),
        ("synthesis", "", "`icebreaker`"),
        ("line-quality", "", "sender slow"),
    ],
)
def test_figures_are_those_of_the_evidence(change, report, heading, row):
    cells = next(
        cells for cells in report_page.evidence()[report]["tables"][heading] if cells[0].startswith(row)
    )
    assert "98.765" not in datasheet.page()
    change(
        json.dumps(cells, ensure_ascii=False),
        json.dumps([cells[0], *["98.765"] * (len(cells) - 1)], ensure_ascii=False),
    )
    assert "98.765" in datasheet.page()


def test_the_card_of_the_figures_is_named(change):
    card = report_page.evidence()["results"]["of"]["standard card"]
    entry = report_page.evidence()["results"]
    now = entry["of"] | {"standard card": "0123456789ab"}
    change(json.dumps(entry["of"]), json.dumps(now))
    page = datasheet.page()
    assert card != "0123456789ab" and "<code>0123456789ab</code>" in page
    assert re.search(r"older card:</b> [^.]*\bresults\b", page)


@pytest.mark.parametrize(
    ("was", "now", "line"),
    [
        ('"The targets"', '"Targets"', "docs/evidence.json has no results, The targets; run `make bench`"),
        (
            "full transactions",
            "transactions",
            "results: 0 rows begin with 'full transactions', one is needed",
        ),
        ("Fmax, MHz", "speed", "synthesis: no column begins with 'Fmax, MHz'"),
        ('"line-quality"', '"lines"', "docs/evidence.json has no line-quality; run `make line-quality`"),
        ('"tiny card", "pins"', '"tiny card", "air"', "conformance: no result of both cards on the pins"),
    ],
)
def test_a_figure_that_is_missing_is_one_line(change, was, now, line):
    change(was, now)
    with pytest.raises(DatasheetError) as error:
        datasheet.page()
    assert str(error.value).startswith(line) and "\n" not in str(error.value)


def test_an_electrical_value_that_the_guide_does_not_have_is_one_line(monkeypatch, tmp_path):
    guide = tmp_path / "hardware.md"
    guide.write_text(datasheet.HARDWARE.read_text().replace("27 mA", "31 mA"))
    monkeypatch.setattr(datasheet, "HARDWARE", guide)
    with pytest.raises(DatasheetError, match=r"^docs/guide/hardware\.md does not have 27 mA, .* Supply$"):
        datasheet.page()


def test_a_new_port_needs_words(monkeypatch, tmp_path):
    top = tmp_path / "rtu2fc.v"
    text = datasheet.TOP.read_text()
    top.write_text(text.replace("input  wire       clk,", "input  wire       clk, \n input wire other,"))
    monkeypatch.setattr(datasheet, "TOP", top)
    with pytest.raises(DatasheetError, match="has no words for other of"):
        datasheet.ports()


@pytest.mark.nightly("pages")
def test_two_pages_and_the_same_bytes_at_another_time(tmp_path):
    """pdf() refuses another number of pages."""
    page = datasheet.page()
    printed = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        printed.append(datasheet.pdf(page, tmp_path / name))
        time.sleep(1.1)
    assert printed[0] == printed[1] and printed[0].startswith(b"%PDF-")
    end = "</section>\n</body>"
    with pytest.raises(DatasheetError, match="the PDF has 3 pages, 2 are right"):
        datasheet.pdf(page.replace(end, f"<p style='height: 20cm'></p>{end}"), tmp_path)
