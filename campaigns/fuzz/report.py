# SPDX-License-Identifier: Apache-2.0
"""Merges the result files of any number of fuzz shards into one table; `make fuzz-report`.

    python -m campaigns.fuzz.report [FOLDER | FILE.json ...]     default: build/fuzz

Exit 0: no shard found anything; 1: one did; 2: no results, an invalid file, or shards of different cards.
"""

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from pathlib import Path

from rtl.command import run_main
from rtl.sources import ROOT

FOLDER = ROOT / "build/fuzz"
RESULT = re.compile(r"fuzz-\w+-\d+\.json")  # cases and results of flips are in the same folder
SUMS = ("frames", "judged", "cases", "wall_s", "simulated_s")
COUNTS = ("events", "outcomes", "rates", "unclear")


class ReportError(Exception):
    """Error for the user, in one line."""


def load(path: Path) -> dict:
    try:
        result = json.loads(path.read_text())
        if not all(
            key in result for key in ("seed", "config", "card", "differences", "worst", *SUMS, *COUNTS)
        ):
            raise ValueError
    except (OSError, ValueError, TypeError) as error:
        raise ReportError(f"{path} is no result of a fuzz shard") from error
    return result


def find(arguments: list[str]) -> list[Path]:
    found = []
    for path in map(Path, arguments or [FOLDER]):
        if not path.exists():
            raise ReportError(f"{path} does not exist; run `make fuzz` first")
        inside = sorted(p for p in path.iterdir() if RESULT.fullmatch(p.name)) if path.is_dir() else [path]
        found += inside
    if not found:
        raise ReportError("no results of fuzz shards; run `make fuzz` first")
    return found


def merge_each(results: list[dict]) -> list[dict]:
    """The results of each card as one."""
    configs = sorted({result["config"] for result in results})
    return [merge([result for result in results if result["config"] == config]) for config in configs]


def merge(results: list[dict]) -> dict:
    """Merges results of one card; of several results with one seed only one counts."""
    results = list({result["seed"]: result for result in results}.values())
    if len({result["card"] for result in results}) > 1:
        raise ReportError("the results come from different cards; remove the older ones")
    merged: dict = {key: sum(result[key] for result in results) for key in SUMS}
    for key in COUNTS:
        merged[key] = sum((Counter(result[key]) for result in results), Counter())
    merged["worst"] = {
        what: max(result["worst"].get(what, 0.0) for result in results)
        for what in sorted({what for result in results for what in result["worst"]})
    }
    merged["differences"] = [{"seed": r["seed"], **d} for r in results for d in r["differences"]]
    merged["seeds"], merged["card"] = sorted(result["seed"] for result in results), results[0]["card"]
    merged["config"] = results[0]["config"]
    return merged


def table(title: str, counts: Counter) -> list[str]:
    rows = sorted(counts.items(), key=lambda row: -row[1])
    return ["", f"| {title} | |", "|---|---|", *(f"| {what} | {count} |" for what, count in rows)]


def report(merged: dict) -> str:
    per_s = merged["frames"] / merged["wall_s"] if merged["wall_s"] else 0.0
    lines = [
        f"{merged['config']} card {merged['card']}: {len(merged['seeds'])} shards, "
        f"{merged['frames']} network frames in {merged['cases']} cases, "
        f"{merged['judged']} of them judged to their end: "
        f"{len(merged['differences'])} differences",
        f"{merged['simulated_s']:.0f} s simulated in {merged['wall_s']:.0f} s of the shards' time, "
        f"{per_s:.0f} frames/s",
    ]
    titles = {
        "events": "made",
        "outcomes": "seen",
        "rates": "frames at",
        "unclear": "judged in part because of",
    }
    for key, title in titles.items():
        lines += table(title, merged[key])
    for found in merged["differences"]:
        lines.append(f"DIFFERENCE case {found['case']} {found.get('file', '')}: {'; '.join(found['what'])}")
    return "\n".join(lines)


def main() -> int:
    merged = merge_each([load(path) for path in find(sys.argv[1:])])
    print("\n\n".join(map(report, merged)))
    return int(any(card["differences"] for card in merged))


if __name__ == "__main__":
    run_main("fuzz-report", main, ReportError)
