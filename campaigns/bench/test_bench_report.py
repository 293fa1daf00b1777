# SPDX-License-Identifier: Apache-2.0
"""docs/reports/results.md is consistent: verdicts and numbers, counts and sums, pictures and text.

`make bench-fast` checks whether it describes the card of this tree.
"""

from __future__ import annotations

import re

import pytest

from campaigns.bench import report as bench_report
from campaigns.bench.card import STANDARD
from campaigns.bench.cases import CASES, SLOWEST
from campaigns.bench.work import RANDOM
from rtl.sources import ROOT, configurations
from tb.lib import bound
from tools import figures, panel_picture


def tables_under(first_cell: str) -> list[list[list[str]]]:
    """Rows of each table of docs/reports/results.md whose header starts so: one for each card."""
    lines = bench_report.RESULTS.read_text().splitlines()
    tables = []
    for at, line in enumerate(lines):
        if line.startswith(f"| {first_cell} |"):
            end = next((n for n in range(at, len(lines)) if not lines[n].startswith("|")), len(lines))
            tables.append(
                [[cell.strip() for cell in row.strip("|").split("|")] for row in lines[at + 2 : end]]
            )
    return tables


def table_under(first_cell: str) -> list[list[str]]:
    """The table of the standard card."""
    return tables_under(first_cell)[0]


def number(cell: str) -> float:
    return float(re.sub(r"[^\d.-]", "", cell))


def test_results_verdicts_are_those_of_their_numbers() -> None:
    tables = tables_under("case")
    assert len(tables) == len(configurations())
    assert {row[3] for rows in tables for row in rows} == {"met"}
    for name, target, worst, _, of in [row for rows in tables for row in rows]:
        low, high = {"≤": (-1e9, None), "≥": (0.0, 1e9), "0": (0.0, None), "n": (0.0, 0.0)}[target[0]]
        if high is None:
            high = number(re.search(r"(?:≤|…) ([\d.]+)", target)[1])
        assert all(low <= number(part) <= high for part in worst.split("…")), name
        assert number(of.split(",")[0]) > 0, name


def test_the_zero_of_random_requests_has_its_bound() -> None:
    rows = [row for rows in tables_under("case") for row in rows if row[0].startswith("random: right bytes")]
    assert len(rows) == len(configurations())
    for row in rows:
        checks = int(number(row[4].split(",")[0]))
        assert row[4].endswith(f"at most {bound.words(int(number(row[2])), checks)} at {bound.SURE}")


def test_results_counts_add_up() -> None:
    requests = int(re.search(r"^(\d+) requests, legal", bench_report.RESULTS.read_text(), re.MULTILINE)[1])
    outcomes = table_under("what came of it")
    counts = [int(row[1]) for row in outcomes[:-1]]
    assert sum(counts) == int(outcomes[-1][1]) == requests == sum(RANDOM.values())
    assert any(row[0].startswith(f"random, {requests} requests") for row in table_under("case"))

    def requests_that(came_of_it: str) -> int:
        return sum(int(row[1]) for row in outcomes if came_of_it in row[0])

    answers = table_under("the drive's answer")
    taken = sum(int(cell) for row in answers if row[1] == "yes" for cell in row[2:] if cell != "-")
    refused_repeats = sum(int(row[3]) for row in answers if row[1] == "no" and row[3] != "-")
    assert taken == requests_that("by the drive")
    assert refused_repeats == requests_that("exception 255")


def test_results_budgets_are_those_of_the_configuration() -> None:
    # A page of an older card has that card's budgets.
    older = bench_report.RESULTS.stem in figures.older_pages()
    rows = table_under("bit/s | candidate to t3.5, clocks")
    for baud, allowed, worst, share, allowed_drive, worst_drive, share_drive in rows:
        budgets = tuple(map(round, bench_report.budgets(STANDARD.clk_hz, int(baud))))
        assert older or (number(allowed), number(allowed_drive)) == budgets
        assert number(share) == round(100 * number(worst) / number(allowed)) < 100
        assert number(share_drive) == round(100 * number(worst_drive) / number(allowed_drive)) < 100


def test_results_and_pictures_are_of_one_run() -> None:
    of = bench_report.measured_on(bench_report.stated())
    assert {"card", "firmware", "bench"} <= bench_report.stated().keys()
    others = re.findall(r"pictures/([\w-]+\.svg)", (ROOT / "docs/reports/line-quality.md").read_text())
    others.append(panel_picture.PICTURE.name)
    pictures = sorted(path for path in (ROOT / "docs/pictures").glob("*.svg") if path.name not in others)
    shown = re.findall(r"\((?:\.\./)?pictures/([\w-]+\.svg)\)", bench_report.RESULTS.read_text())
    assert sorted(shown) == [path.name for path in pictures]
    assert [path.name for path in pictures if of not in path.read_text()] == []


def test_results_stack_seen_is_within_the_call_graph_s() -> None:
    _, _, by_graph, seen = map(number, table_under("code and constants")[0])
    assert 0 < seen <= by_graph


@pytest.mark.parametrize("part", ["## The firmware", "### Firmware of the small card"])
def test_the_cases_of_many_phases_are_the_slowest_ones(part: str) -> None:
    """By the published clocks: of the requests, of the drive's replies, of the broadcasts."""
    text = bench_report.RESULTS.read_text().partition(f"{part}\n")[2].partition("\n#")[0]
    rows = re.findall(r"^\| (\w[^|]*) \| \d+ \| (\d+) \| [\d-]+ \| ([\d-]+) \|$", text, re.MULTILINE)
    clocks = {name: (int(request), int(reply.replace("-", "0"))) for name, request, reply in rows}
    alone = {name: clocks[name] for name, case in CASES.items() if not case.to_all}
    to_all = {name: clocks[name] for name, case in CASES.items() if case.to_all}
    request, reply = (max(alone, key=lambda name: alone[name][column]) for column in (0, 1))
    broadcast = max(to_all, key=lambda name: to_all[name][0])
    assert (request, reply, broadcast) == SLOWEST
