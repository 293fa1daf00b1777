# SPDX-License-Identifier: Apache-2.0
"""tools/prose.py finds misspelt words and links that lead nowhere, and nothing else."""

from pathlib import Path

import pytest

from tools import prose

PAGE = """# The page

A [heading](#a-heading-of-two_words), another [page](other.md#second-1), an [anchor](other.md#word), a
[folder](pictures) and a [site](https://example.org/nothing#there).

```
[not](a-link.md)
```

## A `heading` of two_words
"""
OTHER = '# Second\n\n## Second\n\n| <a id="word"></a>word |\n'


@pytest.fixture
def pages(tmp_path: Path) -> Path:
    (tmp_path / "page.md").write_text(PAGE)
    (tmp_path / "other.md").write_text(OTHER)
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures/one.svg").write_text("")
    prose.anchors.cache_clear()
    return tmp_path


def dead(pages: Path) -> list[str]:
    known = {path.resolve() for path in pages.rglob("*") if path.is_file()}
    return [line.split(":", 1)[1] for line in prose.dead_links(pages / "page.md", known)]


def test_good_links_pass(pages: Path):
    assert dead(pages) == []


@pytest.mark.parametrize(
    ("link", "reason"),
    [
        ("third.md", "no such file"),
        ("other.md#third", "no such heading"),
        ("other.md#second-2", "no such heading"),
        ("#nothing", "no such heading"),
    ],
)
def test_a_dead_link_is_found_with_its_line(pages: Path, link: str, reason: str):
    with (pages / "page.md").open("a") as page:
        page.write(f"\n[dead]({link})\n")
    assert dead(pages) == [f"12: {link}: {reason}"]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("- outer\n  - inner\n", "2: an inner list needs four blanks"),
        ("- outer\n   1. inner\n", "2: an inner list needs four blanks"),
        ("These are:\n- one\n", "1: a list needs an empty line before it"),
    ],
)
def test_a_list_that_the_site_would_lose_is_found(tmp_path: Path, text: str, reason: str):
    page = tmp_path / "page.md"
    page.write_text(text)
    assert prose.lost_lists(page) == [f"{page}:{reason}"]


def test_each_page_has_a_place_on_the_site(monkeypatch, tmp_path):
    monkeypatch.setattr(prose, "ROOT", tmp_path)
    one, two = tmp_path / "one.md", tmp_path / "two.md"
    one.write_text("<!-- site: 7 Its section -->\n# One: more of it\n")
    two.write_text("Only text.\n")
    assert prose.without_place([one, two]) == [
        "two.md: a line `<!-- site: ORDER SECTION -->` is missing",
        "two.md: a title is missing",
    ]
    monkeypatch.setattr(prose, "project_files", lambda: ["one.md", "two.md"])
    assert prose.places() == [(7, "Its section", "One", one)]


def test_each_module_and_each_c_file_has_a_row():
    names = ["rtl/gate/one.v", "rtl/two.v", "rtl/rtl.f", "sw/src/three.c", "sw/src/three.h", "sw/test/four.c"]
    page = "| `two` `three.c` | purpose of `one` |\n"
    assert prose.unlisted_parts(names, page) == [
        "docs/guide/architecture.md: no row of a table has `one`",
    ]


@pytest.mark.nightly("lint")
def test_a_misspelt_word_is_found(tmp_path: Path):
    page = tmp_path / "page.md"
    page.write_text("One word here is rec" + "ieved.\n")  # in two, because this file is checked as well
    assert [line.split(": ")[1] for line in prose.spelling([str(page)])] == ["rec" + "ieved ==> received"]
