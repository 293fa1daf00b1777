# SPDX-License-Identifier: Apache-2.0
"""One page about the card: tests, rules, figures, pictures, in a file that needs no network.

    python -m tools.report [--out FILE]

Takes the reports of build/reports, or their figures in docs/evidence.json where a report was not written
here, the results of the last tests (build/results.json) and the rule table, and writes build/report.html with
all of it inside. A result says of which commit it is; what no longer exists is left out, what is of another
commit than the newest results is marked. Exit 2 when there is nothing to report or no place for it.
"""

from __future__ import annotations

import argparse
import base64
import html
import re
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt

from rtl.command import run_main
from rtl.report_page import REPORTS, evidence, page_of
from rtl.sources import ROOT, commit
from tools import trace
from tools.trace import Result

OUT = ROOT / "build/report.html"
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
    names = evidence()

    def picture(found: re.Match) -> str:
        file = page.parent / found[1]
        if not file.exists():
            return '<img src="data:,"'  # its text remains
        content = base64.b64encode(file.read_bytes()).decode()
        return f'<img src="data:{KINDS[file.suffix]};base64,{content}"'

    def link(found: re.Match) -> str:
        target = Path(found[1].split("#")[0]).stem
        return f'<a href="#{target}">{found[2]}</a>' if target in names else found[2]

    return LINK.sub(link, IMAGE.sub(picture, text))


WIDE = 9  # columns
LONG = re.compile(r"(?<=\w)([/_])(?=\w)")


def fitted(found: re.Match) -> str:
    """A table that fits a narrow window: names may be broken at slashes, many columns are set smaller."""
    text = re.sub(r">([^<]+)<", lambda cell: ">" + LONG.sub(r"\1<wbr>", cell[1]) + "<", found[0])
    return text.replace("<table>", '<table class="wide">') if text.count("<th>") >= WIDE else text


def page(name: str, command: str) -> Section:
    """A report, its headings a step lower than they stand there."""
    text = MarkdownIt("commonmark", {"html": True}).enable("table").render(page_of(name))
    title = re.search(r"<h1>(.*?)</h1>", text)
    text = HEADING.sub(lambda found: f"<{found[1]}h{int(found[2]) + 1}>", inline(REPORTS / name, text))
    text = re.sub(r"<table>.*?</table>", fitted, text, flags=re.DOTALL)
    text = text.replace("<table", '<div class="tables"><table').replace("</table>", "</table></div>")
    source = f'<p class="source">from <code>{command}</code></p>'
    return Section(name, title[1], text.replace("</h2>", f"</h2>{source}", 1))


def table(header: list[str], rows: list[list[str]]) -> str:
    def row(cells: list[str], kind: str) -> str:
        return "<tr>" + "".join(f"<{kind}>{cell}</{kind}>" for cell in cells) + "</tr>"

    lines = [row(header, "th"), *(row(cells, "td") for cells in rows)]
    return '<div class="tables"><table>' + "".join(lines) + "</table></div>"


@dataclass
class Run:
    """The results that count, and the tests that there are."""

    results: dict[str, Result]
    collected: set[str]
    shown: dict[str, list[str]]  # rule to its tests

    def __post_init__(self) -> None:
        now = self.newest()
        # Other cards and netlists are run by commands of their own, such as make test-gates.
        self.results = {
            test: result
            for test, result in self.results.items()
            if test in self.collected or (now and result.commit == now)
        }

    def newest(self) -> str:
        """The commit of the latest results."""
        return max(self.results.values(), key=lambda result: result.at, default=Result("")).commit

    def is_older(self, result: Result) -> bool:
        return not result.commit or result.commit != self.newest()

    @property
    def outcomes(self) -> dict[str, str]:
        return {test: result.outcome for test, result in self.results.items()}

    def provenance(self) -> str:
        """In words: how many, from when."""
        run = sum(test in self.results for test in self.collected)
        older = Counter(r.commit or "unknown" for r in self.results.values() if self.is_older(r))
        newest = [result.at for result in self.results.values() if not self.is_older(result)]
        when = f" on {min(newest)} to {max(newest)} UTC" if newest else ""
        words = f"{run} of {len(self.collected)} tests have been run"
        words += f", the newest of commit <code>{html.escape(self.newest())}</code>{when}" if newest else ""
        more = len(self.results) - run
        words += f"; {more} more on other cards or netlists." if more else "."
        for which, count in sorted(older.items()):
            words += f' <span class="old">{count} older, of commit <code>{html.escape(which)}</code>.</span>'
        return words


def tests(run: Run) -> Section:
    files: dict[str, Counter] = {}
    for test, result in run.results.items():
        counter = files.setdefault(test.split("::")[0].removeprefix("tb/"), Counter())
        counter[result.outcome] += 1
        counter["older"] += run.is_older(result)
    for test in run.collected - set(run.results):
        files.setdefault(test.split("::")[0].removeprefix("tb/"), Counter())["not run"] += 1
    columns = ("passed", "failed", "not run", "older")
    rows = [
        [f"<code>{name}</code>", *(str(count[column] or "") for column in columns)]
        for name, count in sorted(files.items())
    ]
    failed = [name for name, outcome in sorted(run.outcomes.items()) if outcome == "failed"]
    body = f"<h2>Tests</h2><p>{run.provenance()}</p>" + table(["bench", *columns], rows)
    body += "".join(f'<p class="bad">failed: <code>{html.escape(name)}</code></p>' for name in failed)
    return Section("tests", "Tests", body)


def rules(run: Run) -> Section:
    texts = (trace.ROW.match(line) for line in trace.REQUIREMENTS.read_text().splitlines())
    render = MarkdownIt("commonmark").renderInline
    rows = []
    for found in texts:
        if found and found[1] != "ID":
            own = run.shown.get(found[1], [])
            benches = sorted({test.split("::")[0].removeprefix("tb/") for test in own})
            said = trace.verdict(own, run.outcomes) if own else "-"
            older = sum(test in run.results and run.is_older(run.results[test]) for test in own)
            said += f' <span class="old">({older} older)</span>' if older else ""
            rows.append(
                [found[1], inline(trace.REQUIREMENTS, render(found[2])), found[3], said, ", ".join(benches)]
            )
    header = ["rule", "the card …", "shown by", "last result", "benches"]
    return Section("rules", "Rules", "<h2>Rules</h2>" + table(header, rows))


def summary(run: Run) -> Section:
    count = Counter(run.outcomes.values())
    known = trace.read_rules()
    green = trace.shown_rules(known, run.shown, run.outcomes)
    still = [rule for rule in known if rule not in green]
    ran = sum(test in run.results for test in run.collected)
    failed = {
        rule for rule, own in run.shown.items() if any(run.outcomes.get(test) == "failed" for test in own)
    }
    tiles = [
        (f"{ran} of {len(run.collected)}", "tests run", "good" if ran == len(run.collected) else ""),
        (str(count["passed"]), "tests passed", "good"),
        (str(count["failed"]), "tests failed", "bad" if count["failed"] else "good"),
        # A rule whose tests have not run is not red.
        (f"{len(green)} of {len(known)}", "rules shown", "bad" if failed else "" if still else "good"),
    ]
    shown = "".join(
        f'<div class="tile"><b class="{kind}">{n}</b><span>{what}</span></div>' for n, what, kind in tiles
    )
    rest = f"<p>Not shown: {', '.join(still)}.</p>" if still else ""
    body = (
        "<h1>rtu2fc</h1><p>The Modbus RTU option card of Danfoss VLT 6000 drives, rebuilt as open hardware. "
        f"This page was made from commit <code>{html.escape(commit())}</code>. "
        "Each part names the command that printed its figures.</p>"
        f'<div class="tiles">{shown}</div><p>{run.provenance()}</p>{rest}'
        "<p>Not affiliated with Danfoss; VLT is their trademark.</p>"
    )
    return Section("summary", "Summary", body)


def build(run: Run) -> str:
    sections = [
        summary(run),
        *(page(name, entry["command"]) for name, entry in evidence().items()),
        rules(run),
        tests(run),
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
        results, found = trace.read_results(), trace.collect()
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(build(Run(results, found.all, found.tests)))
    except (ReportError, OSError, ValueError, TypeError) as error:
        print(f"report: {error}", file=sys.stderr)
        return 2
    print(f"wrote {options.out} ({options.out.stat().st_size / 1e6:.1f} MB, nothing in it needs a network)")
    return 0


if __name__ == "__main__":
    run_main("report", main)
