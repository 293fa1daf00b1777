# SPDX-License-Identifier: Apache-2.0
"""The data sheet: the reports' figures, on two pages, with the same bytes in each run."""

from __future__ import annotations

import re
import shutil
import time
import tomllib

import pytest

from constraints.boards import boards
from rtl.sources import ROOT
from tools import datasheet, figures
from tools.datasheet import DatasheetError


@pytest.fixture
def reports(monkeypatch, tmp_path):
    """A copy of the reports, to change."""
    folder = tmp_path / "reports"
    shutil.copytree(figures.REPORTS, folder)
    monkeypatch.setattr(figures, "REPORTS", folder)
    monkeypatch.setattr(figures.bench_report, "RESULTS", folder / "results.md")
    monkeypatch.setattr(datasheet, "ROOT", tmp_path)
    return folder


def change(path, was: str, now: str) -> None:
    text = path.read_text()
    assert was in text
    path.write_text(text.replace(was, now, 1))


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
    ("page", "row", "column"),
    [
        ("results", "| local request: reply", 3),
        ("results", "| 19200 | 0.", 2),
        ("results", "| reply latency", 2),
        ("synthesis", "| `icebreaker`", 10),
        ("synthesis", "| **front end**", 5),
        ("line-quality", "| sender slow", 2),
    ],
)
def test_figures_are_those_of_the_reports(reports, page, row, column):
    path = reports / f"{page}.md"
    line = next(line for line in path.read_text().splitlines() if line.startswith(row))
    cells = line.split("|")
    cells[column] = " 98.765 "
    assert "98.765" not in datasheet.page()
    change(path, line, "|".join(cells))
    assert "98.765" in datasheet.page()


def test_the_card_of_the_figures_is_named(reports):
    path = reports / "results.md"
    card = re.search(r"Measured on card `(\w+)`", path.read_text())[1]
    assert card in datasheet.page()
    change(path, f"Measured on card `{card}`", "Measured on card `0123456789ab`")
    assert "<code>0123456789ab</code>" in datasheet.page()
    assert re.search(r"older card:</b> [^.]*\bresults\b", datasheet.page())


def test_the_results_of_the_conformance_suite_are_printed(reports):
    path = reports / "conformance.md"
    change(
        path,
        re.search(r"^\| tiny card \| pins \|.*$", path.read_text(), re.MULTILINE)[0],
        "| tiny card | pins | x | 1 | 2 | 3 | 4 | 5 |",
    )
    assert re.search(
        r"standard card \d+ passed, \d+ own code, \d+ failed; tiny card 1 passed, 2 own code, 3 failed",
        datasheet.page(),
    )
    change(path, "| tiny card | pins |", "| tiny card | air |")
    with pytest.raises(DatasheetError, match="no result of both cards"):
        datasheet.page()


def test_without_older_pages_there_is_no_notice(monkeypatch):
    monkeypatch.setattr(figures, "older_pages", dict)
    assert "older card" not in datasheet.page()


@pytest.mark.parametrize(
    ("page", "was", "now", "line"),
    [
        ("results", "## The targets", "## Targets", "reports/results.md has no heading 'The targets'"),
        (
            "results",
            "| full transactions",
            "| transactions",
            "reports/results.md: 0 rows begin with 'full transactions', one is needed",
        ),
        (
            "synthesis",
            "| Fmax, MHz |",
            "| speed |",
            "reports/synthesis.md: no column begins with 'Fmax, MHz'",
        ),
        (
            "results",
            "Measured on card",
            "On card",
            "reports/results.md does not say on which design it was measured",
        ),
        (
            "line-quality",
            "0.05 % of a rate or 0.004 bit",
            "rate",
            "reports/line-quality.md does not say how fine its steps are",
        ),
    ],
)
def test_a_figure_that_is_missing_is_one_line(reports, page, was, now, line):
    change(reports / f"{page}.md", was, now)
    with pytest.raises(DatasheetError) as error:
        datasheet.page()
    assert str(error.value) == line


@pytest.mark.parametrize(
    ("was", "now", "line"),
    [
        ("27 mA", "31 mA", "docs/guide/hardware.md does not have 27 mA, the data sheet's Supply"),
        (
            "\N{MINUS SIGN}20 to +60 °C",
            "0 to +60 °C",
            "docs/guide/hardware.md does not have -20 to +60 °C, the data sheet's Environment",
        ),
        ("4.7 kΩ", "14.7 kΩ", "docs/guide/hardware.md does not have 4.7 kΩ, the data sheet's Lines"),
    ],
)
def test_an_electrical_value_that_the_guide_does_not_have_is_one_line(monkeypatch, tmp_path, was, now, line):
    guide = tmp_path / "hardware.md"
    guide.write_text(datasheet.HARDWARE.read_text().replace(was, now))
    monkeypatch.setattr(datasheet, "HARDWARE", guide)
    with pytest.raises(DatasheetError) as error:
        datasheet.page()
    assert str(error.value) == line


def test_every_value_of_the_electrical_notes_is_compared():
    facts = tomllib.loads(datasheet.FACTS.read_text())
    found = [value for note in facts["electrical"] for value in datasheet.VALUE.findall(note["text"])]
    assert len(found) == 12 and {"24 V", "38 mA", "12 MHz", "100 ppm", "120 Ω", "-20 to +60 °C"} <= set(found)


def test_a_new_port_needs_words(monkeypatch, tmp_path):
    top = tmp_path / "rtu2fc.v"
    top.write_text(
        datasheet.TOP.read_text().replace(
            "input  wire       clk,", "input  wire       clk, \n input wire other,"
        )
    )
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
    assert datasheet.pdf(page.replace(end, f"<p style='height: 12mm'></p>{end}"), tmp_path)
    with pytest.raises(DatasheetError, match="the PDF has 3 pages, 2 are right"):
        datasheet.pdf(page.replace(end, f"<p style='height: 20cm'></p>{end}"), tmp_path)
