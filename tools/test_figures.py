# SPDX-License-Identifier: Apache-2.0
"""The notices of measured pages: a page of another card, or of no named card, is an older one."""

from __future__ import annotations

import re

import pytest

from rtl.sources import ROOT
from tools import figures, report

NOW = {"standard": "0123456789ab", "tiny": "ba9876543210"}
OTHER = "000000000000"
PAGE = "# Title\n\nMeasured on card `0123456789ab`.\n"


@pytest.fixture(autouse=True)
def _cards(monkeypatch):
    monkeypatch.setattr(figures.fingerprint, "card", lambda config="standard": NOW[config])


@pytest.mark.parametrize(
    ("text", "older"),
    [
        (PAGE, ""),
        ("Card `0123456789ab`, card `0123456789ab`", ""),
        (
            f"card `0123456789ab`, card `{OTHER}`",
            f"measured on card `{OTHER}`; the sources are card `0123456789ab`",
        ),
        ("Measured.", "it does not name the card that it was measured on"),
    ],
)
def test_a_page_of_one_card(text, older):
    assert figures.one_card(text) == older


@pytest.mark.parametrize(
    ("standard", "tiny", "older"),
    [
        ("standard card `0123456789ab`", "tiny card `ba9876543210`", ""),
        ("standard card `0123456789ab`", f"tiny card `{OTHER}`", "measured on another card: tiny"),
        ("standard card `ba9876543210`", "", "measured on another card: standard, tiny"),
        (
            f"standard card `0123456789ab`, standard card `{OTHER}`",
            "",
            "measured on another card: standard, tiny",
        ),
    ],
)
def test_a_page_of_both_cards(standard, tiny, older):
    assert figures.both_cards(f"{standard}, {tiny}") == older


def firmware_page(*stamps: str) -> str:
    blocks = zip(figures.FIRMWARE_BLOCKS, stamps, strict=True)
    return "".join(f"```{name}\nfirmware sources {stamp}\n1 run\n```\n\n" for name, stamp in blocks)


@pytest.mark.parametrize(
    ("text", "older"),
    [
        (firmware_page(OTHER, OTHER), ""),
        (firmware_page(OTHER, "111111111111"), "measured on an earlier firmware: mutants"),
        ("```fuzz\n1 run\n```\n\n```mutate\n```\n", "measured on an earlier firmware: fuzzing, mutants"),
    ],
)
def test_a_page_of_the_firmware(monkeypatch, text, older):
    monkeypatch.setattr(figures.host, "fingerprint", lambda: OTHER)
    assert figures.firmware(text) == older


def test_every_report_has_its_check_and_its_place():
    pages = {path.stem for path in (ROOT / "docs/reports").glob("*.md")}
    assert pages == figures.PAGES.keys()
    assert pages <= set(report.PAGES)


def test_older_pages_are_named_with_their_commands(monkeypatch, tmp_path):
    monkeypatch.setattr(figures, "REPORTS", tmp_path)
    monkeypatch.setattr(figures, "PAGES", {name: (figures.one_card, f"make {name}") for name in ("a", "b")})
    (tmp_path / "a.md").write_text(PAGE)
    (tmp_path / "b.md").write_text(PAGE.replace("ab`", "ff`"))
    assert figures.older_pages() == {"b": "make b"}


def test_a_page_of_the_soak_names_sources_that_need_no_build(monkeypatch):
    """A new checkout has no image. Cards, sources of the firmware and judge are compared."""
    monkeypatch.setattr(figures.host, "fingerprint", lambda: "0123abcd0123")
    monkeypatch.setattr(figures.fingerprint, "soak", lambda: "4567abcd4567")
    monkeypatch.setattr(figures.fingerprint, "firmware", lambda *_: pytest.fail("an image was read"))
    cards = " ".join(f"{config} card `{digits}`" for config, digits in NOW.items())
    page = f"{cards}, firmware sources `0123abcd0123`, judge `4567abcd4567`"
    check, _ = figures.PAGES["soak"]
    assert check(page) == ""
    assert check(page.replace("0123abcd", "ffffabcd")) == "measured on another firmware"
    assert check(page.replace("4567abcd", "ffffabcd")) == "measured by another judge"
    assert check(page.replace(NOW["tiny"], OTHER)) == "measured on another card: tiny"


JUDGED = {
    "starts": ["Judge `{starts}`."],
    "soak": ["judge `{soak}`"],
    "fuzz": [
        "| firmware `0123` | `{fuzz_judge}` |",
        "at most 7 frames each, with judge `{fuzz_judge}`.",
        "Judge of both campaigns below: `{flips_judge}`.",
    ],
}


@pytest.mark.parametrize("page", JUDGED)
def test_a_page_of_another_judge_is_out_of_date(page, monkeypatch):
    monkeypatch.setattr(figures.host, "fingerprint", lambda: "0123abcd0123")
    cards = " ".join(f"{config} card `{digits}`" for config, digits in NOW.items())
    check, _ = figures.PAGES[page]
    names = ("starts", "soak", "fuzz_judge", "flips_judge")
    now = {name: getattr(figures.fingerprint, name)() for name in names}
    lines = [line.format(**now) for line in JUDGED[page]]
    head = f"{cards}, firmware sources `0123abcd0123`"
    assert check("\n".join([head, *lines])) == ""
    for number, line in enumerate(JUDGED[page]):
        other = [*lines[:number], line.format(**dict.fromkeys(names, "another")), *lines[number + 1 :]]
        assert check("\n".join([head, *other])) == "measured by another judge"
        left_out = [*lines[:number], *lines[number + 1 :]]
        assert check("\n".join([head, *left_out])) == "measured by another judge"
    said = figures.path_of(page).read_text()
    assert all(figures.re.search(rf"{words}`\w+`", said) for words in figures.JUDGES[page])


@pytest.mark.parametrize("name", ["card", "tiny card", "bench"])
def test_the_page_of_the_bench_names_both_cards_and_the_bench(name, monkeypatch):
    stated = {"card": "0123", "tiny card": "4567", "bench": "89ab", "firmware": "cdef"}
    monkeypatch.setattr(figures.bench_report, "stated", lambda: stated)
    monkeypatch.setattr(figures.fingerprint, "tree", lambda: stated)
    assert figures.bench("") == ""
    monkeypatch.setattr(figures.fingerprint, "tree", lambda: stated | {name: OTHER})
    assert figures.bench("") == f"measured with another {name}"


@pytest.mark.parametrize("page", ["mutants", "proofs", "proved-flips"])
def test_a_row_of_a_module_that_has_changed_is_out_of_date(page, monkeypatch):
    for maker in (figures.mutate, figures.prove, figures.flips):
        monkeypatch.setattr(maker, "fingerprint", lambda _: NOW["standard"])
    row = re.compile(r"^(\| `(\w+)` \|.*\| `)[0-9a-f]+(` \|\n)", re.MULTILINE)
    text = row.sub(rf"\g<1>{NOW['standard']}\3", figures.path_of(page).read_text())
    check, _ = figures.PAGES[page]
    assert check(text) == ""
    changed = row.sub(lambda of: f"{of[1]}{OTHER}{of[3]}" if of[2] == "rtu_rx" else of[0], text)
    assert check(changed) == "these modules have changed: rtu_rx"


def test_a_synthesis_of_another_design_is_out_of_date(monkeypatch, tmp_path):
    page = tmp_path / "synthesis.md"
    monkeypatch.setattr(figures.synth, "DOCS", page)
    check, _ = figures.PAGES["synthesis"]
    assert check("") == "synthesised from another design"
    page.write_text(figures.synth.measured_from())
    assert check("") == ""


@pytest.mark.parametrize("sources", ["0123abcd0123", ""])
def test_a_page_names_the_sources_of_its_images(monkeypatch, sources):
    monkeypatch.setattr(figures.host, "fingerprint", lambda: "0123abcd0123")
    check = figures.with_firmware(figures.one_card)
    page = f"card `{NOW['standard']}`, firmware\nsources `{sources}`"
    assert check(page) == ("" if sources else "measured on another firmware")
    assert check(page.replace(NOW["standard"], OTHER)).startswith("measured on card")


WITHOUT_FIRMWARE = ("mutants", "proofs", "proved-flips", "synthesis")  # measured on modules or netlists alone


def test_after_a_change_of_the_firmware_each_page_that_ran_it_says_so(monkeypatch):
    """The report of synthesis has the images in its netlists; `make synth` compares them itself."""
    monkeypatch.undo()
    monkeypatch.setattr(figures.host, "fingerprint", lambda: "0123abcd0123")
    silent = {
        page for page, (check, _) in figures.PAGES.items() if not check(figures.path_of(page).read_text())
    }
    assert silent == set(WITHOUT_FIRMWARE)
