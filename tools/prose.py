# SPDX-License-Identifier: Apache-2.0
"""Checks spelling and links: codespell over pages, comments and code, links of pages, pages that code cites.

    python -m tools.prose

A link must lead to a file or folder of the project. Its anchor must be a heading or an `<a id="...">` of
that page. A page that code cites must exist. A list has an empty line before it, and a list within a list
four blanks: the site shows no list otherwise. Each Verilog module and each C file needs a row in the tables
of docs/guide/architecture.md. tools/words.txt lists right words that codespell does not know. All pages have
at most WORDS_AT_MOST words. Prints one line for each mistake; exit 1 if there is one.
"""

import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

from rtl.command import run_main
from rtl.report_page import REPORTS, evidence
from rtl.sources import ROOT

WORDS = ROOT / "tools/words.txt"
# Generated tables, recorded bytes and pictures are no prose.
NO_PROSE = re.compile(
    r"^regs/generated/|^sw/test/corpus/|^docs/recordings/|^campaigns/fuzz/cases/|\.(svg|csv|png|pcapng|bin|sr)$"
)
FENCE = re.compile(r"^(```|~~~).*?^\1", re.DOTALL | re.MULTILINE)
CODE = re.compile(r"`[^`\n]*`")
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)[^)]*\)")
HEADING = re.compile(r"^#{1,6} +(.*?) *#*$", re.MULTILINE)
ANCHOR = re.compile(r"<a (?:id|name)=\"([^\"]+)\"")
SHALLOW = re.compile(r"^ {1,3}(?:[-*+]|\d+\.) ", re.MULTILINE)
UNPARTED = re.compile(r"^(?![-*+] |\d+\. |[\s|#>]).+\n(?=(?:[-*+]|1\.) )", re.MULTILINE)
ELSEWHERE = re.compile(r"[a-z]+:")
CITED = re.compile(r"\bdocs/[\w/-]+\.md\b")
# Above the title of a page: its place on the documentation site, by a number, and its section.
PLACE = re.compile(r"^<!-- site: (\d+)( \w[\w ]*)? -->$", re.MULTILINE)
TITLE = re.compile(r"^# +([^:\n]+)", re.MULTILINE)
REPORT_LIST = ROOT / "docs/reports.md"
ARCHITECTURE = ROOT / "docs/guide/architecture.md"
# All pages together must stay readable: words written by hand, outside code and generated parts.
WORDS_AT_MOST, PAGES_AT_MOST = 45_000, 30
GENERATED_PAGES = (ROOT / "docs/reference/pins.md",)
GENERATED = re.compile(r"<!-- generated:.*?<!-- end -->", re.DOTALL)
WORD = re.compile(r"\w[\w'.-]*")
WRAPPED = re.compile(r"[ \t]*\n[ \t]*(?://|\*|#)?[ \t]*")
SOURCES = {".v", ".vh", ".vlt", ".rdl", ".c", ".h", ".cpp", ".S", ".ld", ".py", ".sh", ".mk", ".lua", ".toml"}
SOURCES |= {".core", ".lpf", ".pcf"}


def project_files() -> list[str]:
    """Names of all files of the project: no build output, no caches, no tools."""
    tops = [path for path in ROOT.iterdir() if not path.name.startswith(".") and path.name != "build"]
    tops += [ROOT / name for name in (".ci", ".devcontainer", ".github", ".pre-commit-config.yaml")]
    found = [path for top in tops for path in ([top] if top.is_file() else top.rglob("*")) if path.is_file()]
    return sorted(str(path.relative_to(ROOT)) for path in found if "__pycache__" not in path.parts)


def spelling(names: list[str]) -> list[str]:
    """Lines of codespell: file, line, word and proposal."""
    command = [sys.executable, "-m", "codespell_lib", "--ignore-words", str(WORDS)]
    done = subprocess.run([*command, *names], cwd=ROOT, capture_output=True, text=True, check=False)
    output = (done.stdout + done.stderr).splitlines()
    return output or [f"codespell: exit code {done.returncode}"] if done.returncode else []


def slug(heading: str) -> str:
    """The anchor of a heading, as GitHub makes it."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading.replace("`", ""))
    return re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")


@cache
def anchors(page: Path) -> set[str]:
    """All places of a page that a link can name. Equal headings get -1, -2 and so on."""
    text = FENCE.sub("", page.read_text())
    found: set[str] = set(ANCHOR.findall(text))
    seen: dict[str, int] = {}
    for heading in HEADING.findall(text):
        name = slug(heading)
        count = seen.get(name, 0)
        seen[name] = count + 1
        found.add(f"{name}-{count}" if count else name)
    return found


def dead_links(page: Path, known: set[Path]) -> list[str]:
    """Relative links of a page that lead nowhere; `known` are the files of the project."""
    # Same length, so that the offsets of the links stay.
    text = page.read_text()
    for skipped in (FENCE, CODE):
        text = skipped.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    wrong = []
    for link in LINK.finditer(text):
        target, _, anchor = unquote(link[1]).partition("#")
        if ELSEWHERE.match(target):
            continue
        folder = REPORTS if page.suffix == ".in" else page.parent
        file = (folder / target).resolve() if target else page.resolve()
        if file.is_relative_to(ROOT / "build"):
            continue  # a report or picture that a command writes
        reason = ""
        if file not in known and not any(file in path.parents for path in known):
            reason = "no such file"
        elif file == REPORT_LIST and anchor in evidence():
            continue  # the site leads to the report itself
        elif anchor and file.suffix == ".md" and anchor not in anchors(file):
            reason = "no such heading"
        if reason:
            line = text.count("\n", 0, link.start()) + 1
            wrong.append(f"{page.relative_to(ROOT)}:{line}: {link[1]}: {reason}")
    return wrong


def lost_lists(page: Path) -> list[str]:
    """Lists that GitHub sees and Python-Markdown does not: no line before it, or less than four blanks."""
    text = FENCE.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), page.read_text())
    return [
        f"{page.relative_to(ROOT)}:{text.count(chr(10), 0, found.start()) + 1}: {reason}"
        for kind, reason in (
            (SHALLOW, "an inner list needs four blanks"),
            (UNPARTED, "a list needs an empty line before it"),
        )
        for found in kind.finditer(text)
    ]


def written(pages: list[Path]) -> int:
    """Words of the pages that people wrote."""
    texts = [page.read_text() for page in pages if page not in GENERATED_PAGES]
    return sum(len(WORD.findall(FENCE.sub("", GENERATED.sub("", text)))) for text in texts)


def too_much(pages: list[Path]) -> list[str]:
    documents = sum(page.is_relative_to(ROOT / "docs") for page in pages)
    found = (("words by hand", written(pages), WORDS_AT_MOST), ("pages in docs/", documents, PAGES_AT_MOST))
    return [f"{number} {what}, at most {most}" for what, number, most in found if number > most]


class Place(NamedTuple):
    """A page of the documentation site; the section is empty if it stands alone."""

    order: int
    section: str
    title: str
    page: Path


def places() -> list[Place]:
    """The pages of the site in their order."""
    found = []
    for page in (ROOT / name for name in project_files() if name.endswith(".md")):
        text = page.read_text()
        if place := PLACE.search(text):
            title = TITLE.search(text)
            found.append(
                Place(int(place[1]), (place[2] or "").strip(), title[1] if title else page.stem, page)
            )
    return sorted(found)


def unlisted_parts(names: list[str], page: str) -> list[str]:
    """Verilog modules and C files of the card without a row in a table of docs/guide/architecture.md."""
    rows = "\n".join(line.split("|")[1] for line in page.splitlines() if line.startswith("| `"))
    listed = set(re.findall(r"`([\w.]+)`", rows))
    parts = [Path(name).stem for name in names if name.startswith("rtl/") and name.endswith(".v")]
    parts += [Path(name).name for name in names if name.startswith("sw/src/") and name.endswith(".c")]
    return [
        f"{ARCHITECTURE.relative_to(ROOT)}: no row of a table has `{part}`"
        for part in parts
        if part not in listed
    ]


def dead_citations(name: str, text: str, known: set[Path]) -> list[str]:
    """Pages that a source cites and that are not there."""
    pages = sorted(set(CITED.findall(WRAPPED.sub(" ", text))))
    return [f"{name}: {page}: no such file" for page in pages if (ROOT / page).resolve() not in known]


def check() -> list[str]:
    names = project_files()
    known = {(ROOT / name).resolve() for name in names}
    pages = [ROOT / name for name in names if name.endswith(".md")]
    wrong = spelling([name for name in names if not NO_PROSE.search(name)])
    templates = [ROOT / name for name in names if name.endswith(".md.in")]
    wrong += [line for page in [*pages, *templates] for line in dead_links(page, known)]
    wrong += [line for page in pages for line in lost_lists(page)]
    for name in names:
        if Path(name).suffix in SOURCES and not name.startswith("tools/prose.py"):
            wrong += dead_citations(name, (ROOT / name).read_text(), known)
    # The list of changes grows with each release.
    wrong += too_much([page for page in pages if ".github" not in page.parts and page.name != "CHANGELOG.md"])
    return wrong + unlisted_parts(names, ARCHITECTURE.read_text())


def main() -> int:
    wrong = check()
    print("\n".join(wrong), end="\n" if wrong else "")
    return 1 if wrong else 0


if __name__ == "__main__":
    run_main("prose", main)
