# SPDX-License-Identifier: Apache-2.0
"""Ties the figures in sentences that people wrote to the page or file that has the figure.

    python -m tools.facts

docs/facts.toml has a `fact` for each sentence with figures in README.md, docs/ and docs/guide/. Each `{}` of
`says` is a figure. `from` and `find` say where it comes from: a file, and a regular expression with one group
for each `{}`. `scale` multiplies it first (one number, or one for each group), or `over` is divided by it;
`{:.2f}` rounds it. With `tested`, a test that compares the page with its source, `says` is a regular
expression. A figure without a source has `why`: a manual's, or a result of an earlier card. With `from` and
`find` too, `why` is arithmetic, from numbers that `find` has.

A `constant` means the same on every page. It has no `page`, and each match of its `find` is one. In any other
source the matches of `find` must agree, or `sum` adds them up. UNITS names the units of a figure. A figure in
no sentence of docs/facts.toml is a mistake, as is one that differs from its source, or a count in letters.
Pages of `aside` are left out, with a reason. Prints one line for each mistake; exit 1 if there is one.
"""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path
from string import Formatter

from rtl.command import run_main
from rtl.sources import ROOT

FACTS = ROOT / "docs/facts.toml"
FIGURE = r"\d[\d,]*(?:\.\d+)?"
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
)
# A number or a range and one of the units, or with a word between, or in "5 of 8 UNITS", or "16-bit".
ALONE = r"(?<![\w.,/#-])(?<!\bbit )(?<!\bcoil )(?<!\bfunction )(?<!= )"
RANGE = rf"(?:{FIGURE}(?: to | and | or |-|…))?{FIGURE}"
BETWEEN = rf"(?: of (?:the )?{FIGURE})?(?: (?:more|random|planted|other))?"
WITH_UNIT = rf"{RANGE}(?:-bit\b|{BETWEEN} (?:%|(?:{'|'.join(UNITS)})\b))(?!/)"
COUNTED = re.compile(rf"{ALONE}(?:{WITH_UNIT}|(?<=\bone in |\bbit in ){FIGURE}\b)")
# Counts in letters would have no source. Small ones, and those of bits and bytes, are no results.
LETTERS = "four|five|six|seven|eight|nine|ten|eleven|twelve|twenty(?:-[a-z]+)?|thirty|fifty|hundred|thousand"
IN_LETTERS = re.compile(
    rf"\b(?:{LETTERS})(?: other| more| random)? (?:{'|'.join(RESULTS)})\b(?!-)", re.IGNORECASE
)
FENCE = re.compile(r"^(```|~~~).*?^\1", re.DOTALL | re.MULTILINE)
TABLE = re.compile(r"<!-- generated: .*?<!-- end -->", re.DOTALL)
SPACE = re.compile(r"\s+")


def pages() -> list[Path]:
    """Pages that people write. The reports and the reference are generated."""
    return [
        ROOT / "README.md",
        *sorted((ROOT / "docs").glob("*.md")),
        *sorted((ROOT / "docs/guide").rglob("*.md")),
    ]


def plain(text: str) -> str:
    """The text without listings and tables that a command writes."""
    return SPACE.sub(" ", FENCE.sub("", TABLE.sub("", text)))


@cache
def source(name: str) -> str:
    return (ROOT / name).read_text()


class Figure(str):
    """A figure as its source has it, which a format may round."""

    def __format__(self, form: str) -> str:
        return format(float(self.replace(",", "")), form) if form else str(self)


def scaled(text: str, scale: float, over: float | None) -> Figure:
    figure = Figure(text.replace("_", ""))
    if over is None and scale == 1:
        return figure
    number = float(figure.replace(",", ""))
    return Figure(f"{number * scale if over is None else over / number:.10g}")


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
    groups = len(found[0].groups())
    scale = fact.get("scale", 1)
    scales = scale if isinstance(scale, list) else [scale] * groups
    if not places == groups == len(scales):
        return whole, f"{places} {{}} in the sentence, {groups} groups in `find`, {len(scales)} in `scale`"
    used, over = [match.groups() for match in found], fact.get("over")
    if fact.get("sum"):
        used = [
            [f"{sum(int(text.replace(',', '')) for text in column):,}" for column in zip(*used, strict=True)]
        ]
    elif "page" in fact and len(set(used)) > 1:
        return whole, f"{len(used)} matches of {fact['find']!r} that differ"
    return [
        filled(says, [scaled(text, by, over) for text, by in zip(texts, scales, strict=True)])
        for texts in (used[:1] if "page" in fact else used)
    ], ""


def mistakes(texts: dict[str, str], facts: list[dict]) -> list[str]:
    """`texts`: each page by its name. `facts`: without `page` a constant."""
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
        for name in on:
            said_in[name] += met[name]
    for name, text in words.items():
        for figure in COUNTED.finditer(text):
            if not any(covers(sentence, figure) for sentence in said_in[name]):
                near = text[max(0, figure.start() - 40) : figure.end() + 30].strip()
                found.append(f"{name}: {figure[0]!r} is in no sentence of docs/facts.toml: ...{near}...")
        found += [
            f"{name}: {count[0]!r} is a count in letters; write digits" for count in IN_LETTERS.finditer(text)
        ]
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
    texts = {name: path.read_text() for path in pages() if (name := str(path.relative_to(ROOT))) not in aside}
    found = mistakes(texts, [*said["constant"], *said["fact"]])
    print("\n".join(found), end="\n" if found else "")
    return 1 if found else 0


if __name__ == "__main__":
    run_main("facts", main)
