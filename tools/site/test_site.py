# SPDX-License-Identifier: Apache-2.0
"""The documentation site: every page once, no request to a host, no dead link, nothing cut off on a phone."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

from rtl.report_page import evidence, measured_by
from rtl.sources import ROOT
from tools import chromium
from tools.site import hooks

# The browser opens pages as files here; a script may look into frames of other files.
LOOK_INSIDE = ("--allow-file-access-from-files",)


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("built") / "site"
    command = [sys.executable, "-m", "tools.site.build", folder]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    # The page of switch positions is not one of MkDocs.
    assert re.fullmatch(rf"\S*index\.html: {len(hooks.PAGES) + len(evidence()) + 1} pages\n", done.stdout)
    return folder


class Asked(HTMLParser):
    """Addresses of scripts, styles, frames, fonts and pictures of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.all = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        name = "href" if tag == "link" else "data" if tag == "object" else "src"
        if tag != "a" and name in given:
            self.all.append(given[name])


def elsewhere(addresses: list[str]) -> list[str]:
    return [address for address in addresses if re.match(r"(?!data:)([a-z]+:)?//", address)]


def test_a_link_out_of_docs_becomes_text():
    def moved(text: str, source: str = "docs/guide/timing.md", name: str = "guide/timing.md") -> str:
        return hooks.moved(text, ROOT / source, name)

    assert moved("[the `rtl/x.v`](../../rtl/x.v)") == "the `rtl/x.v`"
    assert moved("see [the gate](../../rtl/gate/) too") == "see the gate (`rtl/gate`) too"
    assert moved("[a](../glossary.md#twin) [b](#c)") == "[a](../glossary.md#twin) [b](#c)"
    assert moved("[limits](../../README.md#limits)") == "[limits](../README.md#limits)"
    assert moved("![p](docs/pictures/a.svg)", "README.md", "README.md") == "![p](pictures/a.svg)"
    assert (
        moved("[a](../../docs/guide/dialects.md)", "sim/card/README.md", "sim/card/README.md")
        == "[a](../../guide/dialects.md)"
    )
    assert (
        moved("[a](../reports.md#proofs) [b](../reports.md)")
        == "[a](../reports/proofs.md) [b](../reports.md)"
    )
    missing = "![A b](../../build/diagrams/nothing.svg)"
    assert moved(missing) == "*A b: `make diagrams` draws this picture.*"
    for untouched in ("`[a](../../rtl/x.v)`", "```\n[a](../../rtl/x.v)\n```\n", "[a](https://example.org/x)"):
        assert moved(untouched) == untouched


def test_a_table_of_the_evidence_stands_in_a_guide():
    text = hooks.filled("a\n\n<!-- evidence: bench, The targets -->\n\nb")
    header, *rows = evidence()["bench"]["tables"]["The targets"]
    assert f"| {' | '.join(header)} |\n| ---" in text and text.count("\n| ") == len(rows) + 2
    assert "Measured by `make bench" in text


def test_every_table_that_a_page_names_is_in_the_evidence():
    named = {found.groups() for page in hooks.PAGES for found in hooks.EVIDENCE.finditer(page.read_text())}
    assert len(named) > 5
    assert [place for place in named if place[1] not in evidence()[place[0]]["tables"]] == []


def test_the_list_of_reports_has_a_summary_of_each():
    page = hooks.filled(hooks.REPORT_LIST.read_text())
    for name, entry in evidence().items():
        _, shown, rest = page.partition(f"**[{entry['title']}](reports.md#{name})**, by {measured_by(entry)}")
        lines = [line for line in rest.partition("\n\n**[")[0].splitlines()[1:] if line]
        lines = [line for line in lines if not line.startswith(("```", "| ---"))]
        assert shown and 1 <= len(lines) <= 10, name
        figures = entry["said"] or str(next(iter(entry["tables"].values()))[0])
        assert all(word in figures for word in lines[0].strip("| ").split(" | ")), name


def test_what_belongs_to_a_list_is_indented_by_four():
    assert hooks.indented("1. a\n\n   | b |\n") == "1. a\n\n    | b |\n"
    assert hooks.indented("```\n   a\n```\n  - b\n") == "```\n   a\n```\n  - b\n"


@pytest.mark.nightly("docs")
def test_no_page_asks_a_host(site):
    pages = {page: Asked(page.read_text()) for page in site.rglob("*.html")}
    assert {str(page): elsewhere(asked.all) for page, asked in pages.items() if elsewhere(asked.all)} == {}
    for page, asked in pages.items():
        files = [one.split("#")[0] for one in asked.all if not one.startswith("data:")]
        assert [name for name in files if not (page.parent / name).exists()] == [], page
    for style in site.rglob("*.css"):
        addresses = re.findall(r"url\(\s*[\"']?([^\"')]+)|@import\s+[\"']([^\"']+)", style.read_text())
        assert elsewhere([one for pair in addresses for one in pair]) == [], style


SEARCH = """
const word = document.querySelector('[data-md-component=search-query]');
word.focus(); word.value = 'exception 67'; word.dispatchEvent(new Event('keyup'));
for (let tries = 0; tries < 100; tries++) {
  await new Promise(resolve => setTimeout(resolve, 100));
  const found = [...document.querySelectorAll('.md-search-result__link')].map(one => one.href);
  if (found.length) return found;
}
return [];
"""


@pytest.mark.nightly("docs", "pages")
def test_a_browser_searches_without_a_server(site):
    page = (site / "index.html").read_text()
    seen = chromium.evaluate(page, SEARCH, site, options=("--virtual-time-budget=20000",))
    (site / "page.html").unlink()
    assert seen.console == []
    assert re.search(r"/guide/handbook/exceptions\.html\?h=", seen.found[0])


# Of each frame: by how much it is too wide, how many pictures are not there or too small, what is cut off.
LAYOUT = """
return [...document.querySelectorAll('iframe')].map(frame => {
  const page = frame.contentDocument, width = page.documentElement.clientWidth;
  const cut = [...page.querySelectorAll('article *')].filter(one =>
    one.getBoundingClientRect().right > width + 1 &&
    !one.closest('pre, .md-typeset__scrollwrap, p:has(> img:only-child)'));
  const poor = [...page.querySelectorAll('article img')].filter(one =>
    !one.naturalWidth || one.width < Math.min(400, 0.8 * one.naturalWidth));
  return [frame.getAttribute('src'), page.documentElement.scrollWidth - width, poor.length,
          cut.slice(0, 3).map(one => one.outerHTML.slice(0, 99))];
});
"""


@pytest.mark.nightly("docs", "pages")
def test_nothing_is_cut_off_on_a_phone(site, tmp_path):
    folder = tmp_path / "site"
    shutil.copytree(site, folder)
    names = [str(page.relative_to(site)) for page in sorted(site.rglob("*.html"))]
    frames = "".join(f'<iframe src="{name}" width="390" height="800"></iframe>' for name in names)
    seen = chromium.evaluate(f"<!doctype html><body>{frames}", LAYOUT, folder, 1600, LOOK_INSIDE)
    assert seen.console == []
    assert [found[0] for found in seen.found] == names
    assert [found for found in seen.found if found[1:] != [0, 0, []]] == []
