# SPDX-License-Identifier: Apache-2.0
"""Hooks of MkDocs: pages from outside docs/, links that lead out of docs/, lists and anchors as GitHub's."""

from __future__ import annotations

import re
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING

from rtl.sources import ROOT
from tools.prose import CODE, ELSEWHERE, FENCE, LINK, slug

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

DOCS = ROOT / "docs"
# Pages of the site that lie outside docs/.
PAGES = {
    ROOT / "README.md": "index.md",
    ROOT / "CONTRIBUTING.md": "contributing.md",
    ROOT / "CHANGELOG.md": "changelog.md",
    ROOT / "sim/card/README.md": "guide/virtual-card.md",
    ROOT / "tb/agents/README.md": "guide/agents.md",
    ROOT / "tb/captures/README.md": "guide/captures.md",
}
# Code is found first, so that a link in it stays. The last group is the target of a link.
IN_PAGE = re.compile(f"{FENCE.pattern}|{CODE.pattern}|{LINK.pattern}", FENCE.flags)
INDENT = re.compile(f"{FENCE.pattern}|^ {{3}}", FENCE.flags)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    config.mdx_configs["toc"]["slugify"] = lambda text, _separator: slug(text)
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    from mkdocs.structure.files import File

    for source, name in PAGES.items():
        files.append(File.generated(config, name, abs_src_path=str(source)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    if page.parent is None:  # no neighbours to list beside it
        page.meta["hide"] = ["navigation"]
    return indented(moved(markdown, Path(page.file.abs_src_path), page.file.src_uri))


def moved(markdown: str, source: Path, name: str) -> str:
    """The text of the file `source` as the page `name`: its links lead to pages of the site.

    Files that are no page and lie outside docs/ are not part of the site. Of a link to one of them the text
    remains, with the file's name after it where the text does not say it.
    """

    def link(found: re.Match) -> str:
        path, hash_, anchor = (found[2] or "").partition("#")
        if not path or ELSEWHERE.match(path):
            return found[0]
        text = found[0][1 : found[0].index("](")]
        file = (source.parent / path).resolve()
        if file in PAGES or file.is_relative_to(DOCS):
            place = PAGES.get(file) or str(file.relative_to(DOCS))
            return f"[{text}]({relpath(place, Path(name).parent)}{hash_}{anchor})"
        outside = str(file.relative_to(ROOT))
        return text if outside in text else f"{text} (`{outside}`)"

    return IN_PAGE.sub(link, markdown)


def indented(markdown: str) -> str:
    """Python-Markdown takes a paragraph or table into a list only from four blanks on; GitHub from three."""
    return INDENT.sub(lambda found: found[0] if found[1] else "    ", markdown)
