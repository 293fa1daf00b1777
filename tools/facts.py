# SPDX-License-Identifier: Apache-2.0
"""Ties the figures in sentences that people wrote to the page or file that has the figure.

    python -m tools.facts

A figure is a number, or a count in letters: from "four" on, or "two" and "three" before a word of KINDS.
Figures stand in README.md, CONTRIBUTING.md, docs/, docs/guide/ and sim/card/README.md. Of CHANGELOG.md the
version that is not yet released counts. NO_FIGURE lists the numbers that are no figures: names such as
"coil 7", values such as "= 1", code and links. On a page of `loose` most numbers are such names. There a
figure has a unit, is a fraction, or counts one of THINGS. Generated tables, listings and the pages of `aside`
are left out.

docs/facts.toml has a `fact` for each sentence with figures. Each `{}` of `says` is a figure. `from` and
`find` say where it comes from: a file, and a regular expression with one group for each `{}`. `scale`
multiplies it first (one number, or one for each group), or `over` is divided by it. `reckon` has an
expression for each `{}`, in which `a` is the first group. With `count` the group is the number of matches.
`{:.2f}` rounds, `{:letters}` and `{:Letters}` write a count in letters. With `tested`, a test that compares
the page with its source, `says` is a regular expression. A figure without a source has `why`: a manual's, or
a result of an earlier card. With `from` and `find` too, `why` is arithmetic, from numbers that `find` has.

A `constant` means the same on every page. It has no `page`, and each match of its `find` is one. In any
other source the matches of `find` must agree, or `sum` adds them up, or the page says `each` of them. A
figure in no sentence of docs/facts.toml is a mistake, as is one that differs from its source. Prints one
line for each mistake; exit 1 if there is one.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from string import Formatter, ascii_lowercase

from rtl.command import run_main
from rtl.sources import ROOT

FACTS = ROOT / "docs/facts.toml"
FIGURE = r"\d+(?:,\d{3})*(?:\.\d+)?"
RESULTS = (
    *("flips?", "frames", "proofs", "tasks", "tests", "cells", "LUTs?", "transactions", "mutants", "bugs"),
    *("slaves", "masters", "starts", "drive bits?", "MHz", "MB", "min", "minutes", "requests", "trials"),
    *("runs", "power-ups", "resets", "clocks", "cases", "checks", "writes", "steps", "inputs", "scenarios"),
    *("seeds", "wires", "telegrams?", "replies", "limits", "rules"),
)
UNITS = (
    *RESULTS,
    "k?bit/s",
    "(?:data |stop )?bits?",
    "bytes",
    "KiB",
    "characters?",
    "[mµu]?s",
    "seconds?",
    "hours?",
    "mA",
)
# A number or a range and one of the units, or with a word between, or in "5 of 8 UNITS", or "16-bit".
ALONE = r"(?<![\w.,/#-])(?<!\bbit )(?<!\bcoil )(?<!\bfunction )(?<!= )"
RANGE = rf"(?:{FIGURE}(?: to | and | or |-|…))?{FIGURE}"
BETWEEN = rf"(?: of (?:the )?{FIGURE})?(?: (?:more|random|planted|other))?"
WITH_UNIT = rf"{RANGE}(?:-bit\b|{BETWEEN} (?:%|(?:{'|'.join(UNITS)})\b))(?!/)"
COUNTED = re.compile(rf"{ALONE}(?:{WITH_UNIT}|(?<=\bone in |\bbit in ){FIGURE}\b)")
# Every number, alone or with a fraction: 12, 1,500, 0.63, 1.1e-4, 9/16, ¼.
FRACTION = r"\d+/\d+(?![\d/])"
NUMBER = re.compile(
    rf"(?<![\w.,/#-])(?:{FRACTION}|\d+(?:,\d{{3}})*+(?:\.\d+)?+(?:e-\d+|[snrt][tdh])?+|[¼½¾])(?![\w/]|[.,]\d)"
)
PARTS = re.compile(rf"(?<![\w.,/#-]){FRACTION}|[¼½¾]")
# A count in letters. Small ones mostly say how a thing is built: "two flip-flops".
SMALL = ("zero", "one", "two", "three")
LARGE = (
    *("four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve", "thirteen", "fourteen"),
    *("fifteen", "sixteen", "seventeen", "eighteen", "nineteen", "twenty"),
)
ROUND = (
    *("thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety"),
    "hundred",
    "thousand",
    "dozen",
)
LARGE_WORDS = rf"(?:(?:{'|'.join((*LARGE, *ROUND))})(?:-(?:one|two|three|{'|'.join(LARGE)}))?)"
KINDS = (
    *("benches", "boards", "bugs", "cases", "dialects", "drives", "functions", "lists", "masters", "modules"),
    *("mutants", "plants", "profiles", "recordings", "rows", "scenarios", "shards", "tables", "tests"),
)
SMALL_THINGS = (
    "beats?",
    "ticks?",
    "samples?",
    "registers",
    "flip-flops",
    "files",
    "places",
    "rounds",
    "times",
)
THINGS = (*RESULTS, *KINDS, *SMALL_THINGS)
IN_LETTERS = re.compile(rf"\b{LARGE_WORDS}\b(?![-_])", re.IGNORECASE)
FEW = re.compile(
    rf"\b(?:two|three)(?: [a-z-]+)? (?:{'|'.join(KINDS)})\b(?!-)|"
    rf"\b{LARGE_WORDS}(?: [a-z-]+)? (?:{'|'.join(THINGS)})\b(?!-)",
    re.IGNORECASE,
)
DIGITS = re.compile(rf"{ALONE}{RANGE}(?: [a-z-]+)? (?:{'|'.join(THINGS)})\b(?!/)")
# Numbers that name a thing or a value, in any page.
NAMED = (
    *("coils?", "registers?", "parameters?", "functions?", "sub-functions?", "sub", "exceptions?", "codes?"),
    *("bits?", "addresses", "address", "unit", "lanes?", "steps?", "ticket", "pins?", "terminals?", "fault"),
    *("switch(?:es)?", "examples?", "seeds?", "PNU", "AK", "Debian", "Icarus", "Python", "FuseSoC"),
    *("interface", "USER"),
)
ONE = r"\d[\dA-F]*(?:[.,]\d+)*\b"
SEVERAL = rf"{ONE}(?:(?: to | and | or |-|…|, ){ONE})*"
NO_FIGURE = re.compile(
    "|".join(
        (
            r"(?<!`)(?P<ticks>`+)(?!`).*?(?<!`)(?P=ticks)(?!`)",  # code
            r"\]\([^)]*\)|<a [^>]*>|https?://\S+",  # where a link leads
            r"\bVLT \d+(?:, \d{4}| [A-Z]+, \d{4})*",  # a drive
            rf"\b(?i:{'|'.join(NAMED)}) {SEVERAL}",  # the name of a thing
            rf"[=≠] {SEVERAL}",  # a setting
            r"(?<![\d.,/])[01](?![\d/%]|[.,]\d)",  # the value of a bit
            r"(?<![\d.,/])0\d\b",  # a byte
            r"\b\d[\dA-F]*h\b",  # hexadecimal
            r"\b4\d{4}\b(?:-4\d{4})?",  # a register of the Modbus map
            r"\bv?\d+\.\d+\.\d+\b|\d{4}-\d\d-\d\d",  # a version, a date
        )
    ),
)
# The number of an item or of a step, before the item.
ITEM = re.compile(r"^( *)\d+\. |^\| \d{1,2} \|", re.MULTILINE)
SECTION = re.compile(r"^## ", re.MULTILINE)
FENCE = re.compile(r"^(```|~~~).*?^\1", re.DOTALL | re.MULTILINE)
TABLE = re.compile(r"<!-- generated: .*?<!-- end -->", re.DOTALL)
SPACE = re.compile(r"\s+")


def pages() -> list[Path]:
    """Pages that people write. The reports and the reference are generated."""
    return [
        ROOT / "README.md",
        *sorted((ROOT / "docs").glob("*.md")),
        *sorted((ROOT / "docs/guide").rglob("*.md")),
        ROOT / "sim/card/README.md",
        ROOT / "CONTRIBUTING.md",
        ROOT / "CHANGELOG.md",
    ]


def written(path: Path) -> str:
    """A page's text; of the list of changes only the part of a version that is not yet released."""
    text = path.read_text()
    if path.name != "CHANGELOG.md":
        return text
    newest = SECTION.split(text)[1]
    return newest if "not yet released" in newest.split("\n")[0] else ""


def plain(text: str) -> str:
    """The text without listings and tables that a command writes."""
    return SPACE.sub(" ", ITEM.sub(lambda item: item[1] or "| |", FENCE.sub("", TABLE.sub("", text))))


def figures(text: str, loose: bool) -> list[re.Match]:
    """The figures of a plain text."""
    bare = NO_FIGURE.sub(lambda name: "_" * len(name[0]), text)
    found = [*COUNTED.finditer(text)]
    for pattern in (DIGITS, PARTS, FEW) if loose else (NUMBER, FEW, IN_LETTERS):
        for figure in pattern.finditer(bare):
            start, end = figure.span()
            if not any(other.start() < end and start < other.end() for other in found):
                found.append(figure)
    return sorted(found, key=lambda figure: figure.start())


@cache
def source(name: str) -> str:
    return (ROOT / name).read_text()


class Figure(str):
    """A figure as its source has it, which a format may round."""

    def __format__(self, form: str) -> str:
        if form in ("letters", "Letters"):
            words, number = (*SMALL, *LARGE), round(float(self.replace(",", "")))
            word = words[number] if number < len(words) else str(number)
            return word.capitalize() if form == "Letters" else word
        return format(float(self.replace(",", "")), form) if form else str(self)


def scaled(text: str, scale: float, over: float | None) -> Figure:
    figure = Figure(re.sub(r"(?<=\d)_(?=\d)", "", text))
    if over is None and scale == 1:
        return figure
    number = float(figure.replace(",", ""))
    return Figure(f"{number * scale if over is None else over / number:.10g}")


def reckoned(texts: tuple[str, ...], expressions: list[str]) -> list[Figure]:
    """Each expression with the groups as `a`, `b`, ..."""
    names = dict(zip(ascii_lowercase, (float(re.sub("[_,]", "", text)) for text in texts), strict=False))
    return [Figure(f"{eval(each, {'__builtins__': {}}, names):.10g}") for each in expressions]


def filled(says: str, figures: list[Figure]) -> tuple[str, str]:
    """The sentence with its figures, and as a regular expression with each figure in a group."""
    text, pattern, following = "", "", iter(figures)
    for words, field, form, _ in Formatter().parse(says):
        text, pattern = text + words, pattern + re.escape(words)
        if field is not None:
            figure = format(figures[int(field)] if field else next(following), form)
            text, pattern = text + figure, f"{pattern}({re.escape(figure)})"
    return text, pattern


def sentences(fact: dict) -> tuple[list[tuple[str, str]], str]:
    """The sentence, of a constant one or more; what is wrong with the fact."""
    says = fact["says"]
    if "tested" in fact:
        named = Path(fact["page"]).name in source(fact["tested"])
        return [(says, f"({says})")], "" if named else f"{fact['tested']} does not name {fact['page']}"
    whole = [(says, f"({re.escape(says)})")]
    places = sum(field is not None for _, field, _, _ in Formatter().parse(says))
    if "why" in fact and places:
        return whole, "a sentence with `why` has no {}"
    if "why" in fact and "from" not in fact:
        return whole, ""
    found = list(re.finditer(fact["find"], source(fact["from"]), re.MULTILINE))
    if not found:
        return whole, f"{fact['from']} has no {fact['find']!r}"
    if "why" in fact:
        return whole, ""
    reckon = fact.get("reckon")
    used, over = [match.groups() for match in found], fact.get("over")
    if fact.get("count"):
        used = [(str(len(found)),)]
    groups = len(used[0])
    scale = fact.get("scale", 1)
    scales = scale if isinstance(scale, list) else [scale] * groups
    if reckon:
        if places != len(reckon):
            return whole, f"{places} {{}} in the sentence, {len(reckon)} expressions in `reckon`"
    elif not places == groups == len(scales):
        return whole, f"{places} {{}} in the sentence, {groups} groups in `find`, {len(scales)} in `scale`"
    if fact.get("sum"):
        used = [
            [f"{sum(int(text.replace(',', '')) for text in column):,}" for column in zip(*used, strict=True)]
        ]
    elif "page" in fact and not fact.get("each") and len(set(used)) > 1:
        return whole, f"{len(used)} matches of {fact['find']!r} that differ"
    return [
        filled(
            says,
            reckoned(texts, reckon)
            if reckon
            else [scaled(text, by, over) for text, by in zip(texts, scales, strict=True)],
        )
        for texts in (used[:1] if "page" in fact and not fact.get("each") else used)
    ], ""


def mistakes(texts: dict[str, str], facts: list[dict], loose: Collection[str] = ()) -> list[str]:
    """`texts`: each page by its name. `facts`: without `page` a constant. `loose`: patterns of names."""
    found, words = [], {name: plain(text) for name, text in texts.items()}
    said_in = {name: [] for name in texts}
    for fact in facts:
        said, wrong = sentences(fact)
        on = [fact["page"]] if "page" in fact else list(texts)
        if not texts.keys() >= set(on):
            found.append(f"docs/facts.toml: no page {on[0]}")
            continue
        if wrong:
            found.append(f"docs/facts.toml: {fact['says']!r}: {wrong}")
        pattern = "|".join(pattern for _, pattern in said)
        met = {name: list(re.finditer(pattern, words[name])) for name in on}
        if not wrong and not any(met.values()):
            where, says = fact.get("page", "no page"), " or ".join(text for text, _ in said)
            found.append(f"{where}: does not say {says!r}, as docs/facts.toml has it")
        if fact.get("each") and not wrong:
            there = {sentence[0] for sentence in met[on[0]]}
            found += [
                f"{on[0]}: does not say {text!r}, as docs/facts.toml has it"
                for text, _ in said
                if there and text not in there
            ]
        for name in on:
            said_in[name] += met[name]
    for name, text in words.items():
        for figure in figures(text, any(fnmatch(name, pattern) for pattern in loose)):
            if not any(covers(sentence, figure) for sentence in said_in[name]):
                near = text[max(0, figure.start() - 40) : figure.end() + 30].strip()
                found.append(f"{name}: {figure[0]!r} is in no sentence of docs/facts.toml: ...{near}...")
    return found


def covers(sentence: re.Match, figure: re.Match) -> bool:
    """The figure is one that the sentence takes from its source, not one that only stands in it."""
    start, end = figure.span()
    return (
        sentence.start() <= start
        and end <= sentence.end()
        and any(first < end and start < last for first, last in sentence.regs[1:])
    )


def main() -> int:
    said = tomllib.loads(FACTS.read_text())
    aside = {entry["page"] for entry in said["aside"]}
    texts = {name: written(path) for path in pages() if (name := str(path.relative_to(ROOT))) not in aside}
    loose = [entry["page"] for entry in said["loose"]]
    found = mistakes(texts, [*said["constant"], *said["fact"]], loose)
    print("\n".join(found), end="\n" if found else "")
    return 1 if found else 0


if __name__ == "__main__":
    run_main("facts", main)
