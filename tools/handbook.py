# SPDX-License-Identifier: Apache-2.0
"""Writes what programs make in the guides: examples, what masters printed, tables of dialects and boards.

    python -m tools.handbook            writes the blocks into the pages of docs/guide/handbook
    python -m tools.handbook --check    exits 1 and names every outdated page

A block stands in a page between `<!-- generated: NAME -->` and `<!-- end -->`, and each name of BLOCKS once.
It also writes the codes of the exceptions. All other tables are written by hand, and tools/test_handbook.py
compares them with the card.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from campaigns.masters import page as masters
from constraints import boards
from rtl.command import run_main, write_files
from rtl.sources import ROOT
from tools import dialect_tables
from tools.handbook_examples import HandbookError, example_list, worked_examples

GUIDES = ROOT / "docs/guide"
BLOCK = re.compile(r"^<!-- generated: (\S+) -->\n(.*?)^<!-- end -->$", re.MULTILINE | re.DOTALL)
HANDBOOK = GUIDES / "handbook"
NOTE = "<!-- by `make regs`: change the source, not the page -->"
BLOCKS: dict[str, Callable[[], str]] = {
    "example-list": example_list,
    "examples": worked_examples,
    **masters.tables(),
    **dialect_tables.BLOCKS,
    **boards.BLOCKS,
}


def rows(page: str, head: str, after: str = "# ") -> list[dict[str, str]]:
    """The rows of the first table with this head, or its beginning, after a text of a handbook's page."""
    text = (HANDBOOK / f"{page}.md").read_text().partition(after)[2]
    table = re.search(rf"^ *\| {re.escape(head)}.*\n(?: *\|.*\n)*", text, re.MULTILINE)
    if table is None:
        raise HandbookError(f"{page}.md has no table that begins with '{head}'")
    heads, _, *lines = (
        [cell.strip() for cell in line.strip().removeprefix("|").removesuffix("|").split("|")]
        for line in table[0].splitlines()
    )
    return [dict(zip(heads, line, strict=True)) for line in lines]


def with_blocks(text: str) -> str:
    """A page with its blocks made anew."""

    def fresh(block: re.Match) -> str:
        name = block[1]
        if name not in BLOCKS:
            raise HandbookError(f"no block '{name}'")
        return f"<!-- generated: {name} -->\n{NOTE}\n\n{BLOCKS[name]()}\n\n<!-- end -->"

    return dialect_tables.with_codes(BLOCK.sub(fresh, text))


def pages() -> dict[Path, str]:
    """The pages with blocks, and their new text."""
    texts = {path: path.read_text() for path in sorted(GUIDES.rglob("*.md"))}
    names = [block[1] for text in texts.values() for block in BLOCK.finditer(text)]
    if wrong := [name for name in BLOCKS if names.count(name) != 1]:
        raise HandbookError(
            f"block '{wrong[0]}' stands {names.count(wrong[0])} times in the pages instead of once"
        )
    return {path: with_blocks(text) for path, text in texts.items()}


def main() -> int:
    return write_files("handbook", __doc__, pages(), "make regs")


if __name__ == "__main__":
    run_main("handbook", main, HandbookError)
