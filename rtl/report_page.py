# SPDX-License-Identifier: Apache-2.0
"""Reports of the commands that measure: pages in build/reports, their main figures in docs/evidence.json.

A page is not part of the repository. docs/evidence.json is: for each report the command, the fingerprints of
what was measured, one statement and some tables of the page. Only the measuring commands write it. Data
sheet, site and guides take their figures from it, so that they need no measurement.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path

from rtl.sources import ROOT

REPORTS = ROOT / "build/reports"
EVIDENCE = ROOT / "docs/evidence.json"
SUMMARY_LINES = 10
HEADING = re.compile(r"^(#+) +(.*)$")
Table = list[list[str]]  # the first row is the header


def tables(text: str) -> dict[str, Table]:
    """The first table below each heading of a page; the one below the title has the name ""."""
    found: dict[str, Table] = {}
    heading, rows = "", None
    for line in text.splitlines():
        if title := HEADING.match(line):
            heading, rows = "" if title[1] == "#" else title[2], None
        elif not line.startswith("|"):
            rows = None
        elif rows is not None:
            rows.append([cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip()[1:-1])])
        elif heading not in found:
            rows = found[heading] = []
            rows.append([cell.strip() for cell in line.strip()[1:-1].split("|")])
    return {heading: [rows[0], *rows[2:]] for heading, rows in found.items()}


def markdown(table: Table) -> str:
    rows = [table[0], ["---"] * len(table[0]), *table[1:]]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def evidence() -> dict[str, dict]:
    return json.loads(EVIDENCE.read_text()) if EVIDENCE.exists() else {}


def _layout(value: object, indent: str = "") -> str:
    """JSON with a line for each row of a table."""
    nested = list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else ()
    if not any(isinstance(each, dict | list) for each in nested):
        return json.dumps(value, ensure_ascii=False)
    inner = indent + " "
    if isinstance(value, dict):
        lines = [f"{inner}{json.dumps(key)}: {_layout(each, inner)}" for key, each in value.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    return "[\n" + ",\n".join(inner + _layout(each, inner) for each in nested) + f"\n{indent}]"


def record(
    name: str, title: str, command: str, of: dict[str, str], said: str, kept: dict[str, Table]
) -> None:
    """Puts the figures of a report into docs/evidence.json; those of other reports stay."""
    entry = {"title": title, "command": command, "of": of, "said": said, "tables": kept}
    EVIDENCE.write_text(_layout(dict(sorted({**evidence(), name: entry}.items()))) + "\n")


def forget(others_than: Iterable[str]) -> None:
    """Takes out of docs/evidence.json the reports that no command makes any more."""
    kept = {name: entry for name, entry in evidence().items() if name in set(others_than)}
    EVIDENCE.write_text(_layout(kept) + "\n")


def publish(
    name: str, text: str, command: str, of: dict[str, str], said: str = "", keep: Iterable[str] = ()
) -> Path:
    """Writes build/reports/NAME.md and records its tables below the headings `keep`."""
    REPORTS.mkdir(parents=True, exist_ok=True)
    path = REPORTS / f"{name}.md"
    path.write_text(text)
    title = next(found[2] for line in text.splitlines() if (found := HEADING.match(line)))
    every = tables(text)
    record(name, title, command, of, said, {heading: every[heading] for heading in keep})
    print(f"wrote {path.relative_to(ROOT) if path.is_relative_to(ROOT) else path}")
    return path


def measured_by(entry: dict) -> str:
    """Its commands, each as one that can be given: `make fuzz`, `make flips` of both cards."""
    targets, both, _ = entry["command"].removeprefix("make ").partition(" of both cards")
    return ", ".join(f"`make {target}`" for target in re.split(", | and ", targets)) + both


def page_of(name: str) -> str:
    """The main figures of a report, whether or not it was written in this clone."""
    entry = evidence()[name]
    parts = ", ".join(f"{what} `{digits}`" for what, digits in entry["of"].items())
    lines = [
        f"# {entry['title']}",
        f"Main figures of {measured_by(entry)}. The whole report is then `build/reports/{name}.md`.",
        f"Measured on {parts}." if len(entry["of"]) < 9 else "",
        f"```\n{entry['said']}\n```" if "\n" in entry["said"] else entry["said"],
    ]
    for heading, table in entry["tables"].items():
        lines += [f"## {heading}" if heading else "", markdown(table)]
    return "\n\n".join(filter(None, lines)) + "\n"


def summary(name: str) -> str:
    """A report in ten lines at most below its title: what it says, then the first rows of its first table."""
    entry = evidence()[name]
    said = entry["said"].splitlines()
    if len(said) > SUMMARY_LINES:  # the last ones have the sums
        said = [*said[: SUMMARY_LINES - 4], "...", *said[-3:]]
    table = next(iter(entry["tables"].values()), [])
    rows = table[: max(0, SUMMARY_LINES - len(said))]
    part = f", {len(rows) - 1} of {len(table) - 1} rows" if len(rows) < len(table) else ""
    parts = [f"**[{entry['title']}](reports.md#{name})**, by {measured_by(entry)}{part}"]
    if said:
        parts.append("\n".join(["```", *said, "```"]) if len(said) > 1 else said[0])
    return "\n\n".join([*parts, markdown(rows)] if len(rows) > 1 else parts)
