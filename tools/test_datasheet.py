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
        ("bench", "The targets", "local request"),
        ("bench", "Turnaround, rate by rate", "19200"),
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
