# SPDX-License-Identifier: Apache-2.0
"""Hooks of MkDocs: the navigation, pages from outside docs/, links that lead out of docs/, lists and anchors.

A page has its place by the comment `<!-- site: ORDER SECTION -->` above its title, in docs/ or elsewhere.

A report is a page of its main figures (docs/evidence.json). Timing diagrams come from build/diagrams; one
that is not there becomes its description. A line
`<!-- evidence: REPORT, HEADING -->` of a guide becomes that table, and `<!-- evidence: summaries -->` a few
lines of each report.
"""

from __future__ import annotations

import re
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING

from rtl.command import VERSION
from rtl.report_page import REPORTS, evidence, markdown, measured_by, page_of, summary
from rtl.sources import ROOT
from tools.prose import CODE, ELSEWHERE, FENCE, LINK, REPORT_LIST, places, slug

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

DOCS = ROOT / "docs"
# Pages of the site with their names in it.
PAGES = {
    place.page: str(place.page.relative_to(DOCS if DOCS in place.page.parents else ROOT))
    for place in places()
}
BUILT = ROOT / "build"
EVIDENCE = re.compile(r"^<!-- evidence: ([\w-]+), (.*) -->$", re.MULTILINE)
SUMMARIES = "<!-- evidence: summaries -->"
# Code is found first, so that a link in it stays. The last group is the target of a link.
IN_PAGE = re.compile(f"{FENCE.pattern}|{CODE.pattern}|!?{LINK.pattern}", FENCE.flags)
INDENT = re.compile(f"{FENCE.pattern}|^ {{3}}", FENCE.flags)


def navigation() -> list[dict]:
    """The pages in their order, sections where their first page stands; all reports follow their list."""
    found: dict[str, list] = {}
    for place in places():
        pages = found.setdefault(place.section or place.title, [])
        pages.append({place.title: PAGES[place.page]})
        if place.page == REPORT_LIST:
            pages += [f"reports/{name}.md" for name in evidence()]
    alone = {place.title for place in places() if not place.section}
    return [pages[0] if name in alone else {name: pages} for name, pages in found.items()]


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    config.nav = navigation()
    config.site_name += f" {VERSION.read_text().strip()}"
    config.mdx_configs["toc"]["slugify"] = lambda text, _separator: slug(text)
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    from mkdocs.structure.files import File

    for source, name in PAGES.items():
        if DOCS not in source.parents:
            files.append(File.generated(config, name, abs_src_path=str(source)))
    for name in evidence():
        files.append(File.generated(config, f"reports/{name}.md", content=page_of(name)))
    for path in sorted((BUILT / "diagrams").glob("*.svg")):
        files.append(File.generated(config, f"diagrams/{path.name}", abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    if page.parent is None:  # no neighbours to list beside it
        page.meta["hide"] = ["navigation"]
    name = page.file.src_uri
    source = page.file.abs_src_path or REPORTS / Path(name).name  # the figures of a report
    return indented(moved(filled(markdown), Path(source), name))


def filled(text: str) -> str:
    """The text with the tables of docs/evidence.json, each with its command."""

    def table(found: re.Match) -> str:
        entry = evidence()[found[1]]
        return f"{markdown(entry['tables'][found[2]])}\n\nMeasured by {measured_by(entry)}."

    return EVIDENCE.sub(table, text).replace(SUMMARIES, "\n\n".join(map(summary, evidence())))


def moved(markdown: str, source: Path, name: str) -> str:
    """The text of the file `source` as the page `name`: its links lead to pages of the site.

    Files that are no page and lie outside docs/ are not part of the site. Of a link to one of them the text
    remains, with the file's name after it where the text does not say it.
    """

    def link(found: re.Match) -> str:
        path, hash_, anchor = (found[2] or "").partition("#")
        if not path or ELSEWHERE.match(path):
            return found[0]
        shown, text = found[0][: found[0].index("](")].split("[", 1)
        file = (source.parent / path).resolve()
        if file == REPORT_LIST and anchor in evidence():
            file, hash_, anchor = REPORTS / f"{anchor}.md", "", ""
        top = BUILT if file.is_relative_to(BUILT) else DOCS
        if shown and top == BUILT and not file.exists():
            return f"*{text}: `make diagrams` draws this picture.*"
        if file in PAGES or file.is_relative_to(top):
            place = PAGES.get(file) or str(file.relative_to(top))
            return f"{shown}[{text}]({relpath(place, Path(name).parent)}{hash_}{anchor})"
        outside = str(file.relative_to(ROOT))
        return text if outside in text else f"{text} (`{outside}`)"

    return IN_PAGE.sub(link, markdown)


def indented(markdown: str) -> str:
    """Python-Markdown takes a paragraph or table into a list only from four blanks on; GitHub from three."""
    return INDENT.sub(lambda found: found[0] if found[1] else "    ", markdown)
