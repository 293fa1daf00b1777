# SPDX-License-Identifier: Apache-2.0
"""Ties the figures in sentences that people wrote to the page or file that has the figure.

    python -m tools.facts

docs/facts.toml has a table for each sentence with figures in README.md, docs/ and docs/guide/. Each `{}` of
`says` is a figure. `from` and `find` say where it comes from: a file, and a regular expression with one group
for each `{}`. `scale` multiplies it first. A figure that no command prints has `why` instead: a setting, a
figure of the manual, a rule, a result of an earlier card. UNITS names the units of a figure. A figure in no
sentence of docs/facts.toml is a mistake, as is one that differs from its source. The pages of `aside` are
left out, with a reason. Prints one line for each mistake; exit 1 if there is one.
"""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path

from rtl.command import run_main
from rtl.sources import ROOT

FACTS = ROOT / "docs/facts.toml"
FIGURE = r"\d[\d,]*(?:\.\d+)?"
UNITS = (
    *("flips?", "frames", "proofs", "tasks", "tests", "cells", "LUTs?", "transactions", "mutants", "bugs"),
    *("slaves", "masters", "starts", "drive bits?", "MHz", "MB", "min", "minutes", "requests", "trials"),
    *("runs", "power-ups", "resets", "clocks", "cases", "checks", "writes", "steps", "inputs", "scenarios"),
)
# A number with one of the units after it, or with a word between, or in "5 of 8 UNITS".
ALONE = r"(?<![\w.,/#-])"
BETWEEN = rf"(?: of (?:the )?{FIGURE})?(?: (?:more|random|planted|other))?"
COUNTED = re.compile(rf"{ALONE}{FIGURE}{BETWEEN} (?:{'|'.join(UNITS)})\b")
BITS = re.compile(rf"{ALONE}\d+\.\d+ bits?\b")
FENCE = re.compile(r"^(```|~~~).*?^\1", re.DOTALL | re.MULTILINE)
SPACE = re.compile(r"\s+")


def pages() -> list[Path]:
    """Pages that people write. The handbook's tables and the reports are generated."""
    return [
        ROOT / "README.md",
        *sorted((ROOT / "docs").glob("*.md")),
        *sorted((ROOT / "docs/guide").glob("*.md")),
    ]


def plain(text: str) -> str:
    return SPACE.sub(" ", FENCE.sub("", text))


@cache
def source(name: str) -> str:
    return (ROOT / name).read_text()


def sentence(fact: dict) -> tuple[str, str]:
    """The sentence with its figures, and what is wrong with the fact."""
    says, places = fact["says"], fact["says"].count("{}")
    if "why" in fact:
        return says, "" if not places else "a sentence with `why` has no {}"
    found = re.search(fact["find"], source(fact["from"]), re.MULTILINE)
    if found is None:
        return says, f"{fact['from']} has no {fact['find']!r}"
    if len(found.groups()) != places:
        return says, f"{places} {{}} in the sentence, {len(found.groups())} groups in `find`"
    return says.format(*(scaled(text, fact.get("scale", 1)) for text in found.groups())), ""


def scaled(text: str, scale: float) -> str:
    if scale == 1:
        return text
    return f"{float(text.replace('_', '').replace(',', '')) * scale:g}"


def mistakes(texts: dict[str, str], facts: list[dict]) -> list[str]:
    """`texts`: each page by its name."""
    found, covered = [], {name: [] for name in texts}
    for fact in facts:
        says, wrong = sentence(fact)
        name = fact["page"]
        if name not in texts:
            found.append(f"docs/facts.toml: no page {name}")
        elif wrong:
            found.append(f"docs/facts.toml: {fact['says']!r}: {wrong}")
        elif says not in plain(texts[name]):
            found.append(f"{name}: does not say {says!r}, as docs/facts.toml has it")
        covered.get(name, []).append(says)
    for name, text in texts.items():
        words = plain(text)
        spans = [
            (match.start(), match.end())
            for says in covered[name]
            for match in re.finditer(re.escape(says), words)
        ]
        for match in sorted([*COUNTED.finditer(words), *BITS.finditer(words)], key=re.Match.start):
            if not any(start <= match.start() and match.end() <= end for start, end in spans):
                near = words[max(0, match.start() - 40) : match.end() + 30].strip()
                found.append(f"{name}: {match[0]!r} is in no sentence of docs/facts.toml: ...{near}...")
    return found


def main() -> int:
    said = tomllib.loads(FACTS.read_text())
    aside = {entry["page"] for entry in said["aside"]}
    texts = {name: path.read_text() for path in pages() if (name := str(path.relative_to(ROOT))) not in aside}
    found = mistakes(texts, said["fact"])
    print("\n".join(found), end="\n" if found else "")
    return 1 if found else 0


if __name__ == "__main__":
    run_main("facts", main)
