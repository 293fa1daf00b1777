#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""One page about the card: tests, rules, figures, pictures, in a file that needs no network.

    python -m tools.report [--out FILE]

Takes the pages of docs/ as their commands wrote them (make bench, synth, formal, diagrams, ...), the results
of the last tests (build/results.json) and the rule table, and writes build/report.html with all of it inside.
A page that is not there is named as missing. Exit 2 when there is nothing to report or no place for it.
"""

from __future__ import annotations

import argparse
import base64
import html
import json
import re
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt

from tools import trace
from tools.sources import ROOT

OUT = ROOT / "build/report.html"
# Page of docs/, and the command that writes it.
PAGES = {
    "results": "make bench",
    "synthesis": "make synth",
    "timing": "make diagrams",
    "line-quality": "make line-quality",
    "proofs": "make formal",
    "coverage": "make coverage-rtl",
    "firmware-quality": "make coverage-firmware, fuzz-firmware, mutate-firmware",
    "fuzz": "make fuzz, make flips",
}
KINDS = {".svg": "image/svg+xml", ".png": "image/png"}
IMAGE = re.compile(r'<img src="([^"]+)"')
LINK = re.compile(r'<a href="([^"]*)">(.*?)</a>', re.DOTALL)
HEADING = re.compile(r"<(/?)h([1-5])>")
STYLE = ROOT / "tools/report.css"


class ReportError(Exception):
    """Nothing to report, in a line."""


@dataclass
class Section:
    name: str
    title: str
    body: str


def inline(page: Path, text: str) -> str:
    """The pictures into the page; links to what is in it stay, all others become plain text."""

    def picture(found: re.Match) -> str:
        file = page.parent / found[1]
        content = base64.b64encode(file.read_bytes()).decode()
        return f'<img src="data:{KINDS[file.suffix]};base64,{content}"'

    def link(found: re.Match) -> str:
        target = Path(found[1].split("#")[0]).stem
        return f'<a href="#{target}">{found[2]}</a>' if target in PAGES else found[2]

    return LINK.sub(link, IMAGE.sub(picture, text))


def page(name: str, command: str) -> Section:
    """A page of docs/, its headings a step lower than they stand there."""
    file = ROOT / f"docs/{name}.md"
    if not file.exists():
        return Section(
            name, name, f"<h2>{name}</h2><p class=bad>Not there yet: <code>{command}</code> writes it.</p>"
        )
    text = MarkdownIt("commonmark", {"html": True}).enable("table").render(file.read_text())
    title = re.search(r"<h1>(.*?)</h1>", text)
    text = HEADING.sub(lambda found: f"<{found[1]}h{int(found[2]) + 1}>", inline(file, text))
    text = text.replace("<table>", '<div class="tables"><table>').replace("</table>", "</table></div>")
    source = f'<p class="source">docs/{name}.md, from <code>{command}</code></p>'
    return Section(name, title[1] if title else name, text.replace("</h2>", f"</h2>{source}", 1))


def table(header: list[str], rows: list[list[str]]) -> str:
    def row(cells: list[str], kind: str) -> str:
        return "<tr>" + "".join(f"<{kind}>{cell}</{kind}>" for cell in cells) + "</tr>"

    lines = [row(header, "th"), *(row(cells, "td") for cells in rows)]
    return '<div class="tables"><table>' + "".join(lines) + "</table></div>"


def tests(results: dict[str, str]) -> Section:
    files: dict[str, Counter] = {}
    for test, outcome in results.items():
        files.setdefault(test.split("::")[0].removeprefix("tb/"), Counter())[outcome] += 1
    rows = [
        [f"<code>{name}</code>", str(count.total()), str(count["passed"]), str(count["failed"] or "")]
        for name, count in sorted(files.items())
    ]
    failed = [name for name, outcome in sorted(results.items()) if outcome == "failed"]
    body = "<h2>Tests</h2>" + table(["bench", "tests", "passed", "failed"], rows)
    body += "".join(f'<p class="bad">failed: <code>{html.escape(name)}</code></p>' for name in failed)
    return Section("tests", "Tests", body)


def rules(results: dict[str, str], shown: dict[str, list[str]]) -> Section:
    texts = (trace.ROW.match(line) for line in trace.REQUIREMENTS.read_text().splitlines())
    render = MarkdownIt("commonmark").renderInline
    rows = []
    for found in texts:
        if found and found[1] != "ID":
            benches = sorted({test.split("::")[0].removeprefix("tb/") for test in shown.get(found[1], [])})
            said = trace.verdict(shown[found[1]], results) if found[1] in shown else "-"
            rows.append(
                [found[1], inline(trace.REQUIREMENTS, render(found[2])), found[3], said, ", ".join(benches)]
            )
    header = ["rule", "the card …", "shown by", "last result", "benches"]
    return Section("rules", "Rules", "<h2>Rules</h2>" + table(header, rows))


def summary(results: dict[str, str]) -> Section:
    count = Counter(results.values())
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.strip()
    known = trace.read_rules()
    still = [rule for rule, by in known.items() if by == "open"]
    tiles = [
        (str(count["passed"]), "tests passed", "good"),
        (str(count["failed"]), "tests failed", "bad" if count["failed"] else "good"),
        (f"{len(known) - len(still)} of {len(known)}", "rules shown", "" if still else "good"),
    ]
    shown = "".join(
        f'<div class="tile"><b class="{kind}">{n}</b><span>{what}</span></div>' for n, what, kind in tiles
    )
    rest = f"<p>Still open: {', '.join(still)}.</p>" if still else ""
    body = (
        "<h1>rtu2fc</h1><p>The Modbus RTU option card of Danfoss VLT 6000 drives, rebuilt as open hardware. "
        f"This page was made from commit <code>{html.escape(commit or 'unknown')}</code>; what stands in it "
        "was printed by the commands named with each part.</p>"
        f'<div class="tiles">{shown}</div>{rest}'
        "<p>Not affiliated with Danfoss; VLT is their trademark.</p>"
    )
    return Section("summary", "Summary", body)


def build(results: dict[str, str], shown: dict[str, list[str]]) -> str:
    sections = [
        summary(results),
        *(page(name, command) for name, command in PAGES.items()),
        rules(results, shown),
        tests(results),
    ]
    menu = "".join(f'<a href="#{s.name}">{s.title}</a>' for s in sections)
    parts = "".join(f'<section id="{s.name}">{s.body}</section>\n' for s in sections)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>rtu2fc: report</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{STYLE.read_text()}</style></head>\n<body><nav><b>rtu2fc</b>{menu}</nav><main>{parts}</main></body></html>\n"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=OUT, help="where to (build/report.html)")
    options = parser.parse_args()
    try:
        if not trace.RESULTS.exists():
            raise ReportError("no test has run yet; run `make test` first")
        results = json.loads(trace.RESULTS.read_text())
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(build(results, trace.collect()))
    except (ReportError, OSError, json.JSONDecodeError) as error:
        print(f"report: {error}", file=sys.stderr)
        return 2
    print(f"wrote {options.out} ({options.out.stat().st_size / 1e6:.1f} MB, nothing in it needs a network)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
