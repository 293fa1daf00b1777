# SPDX-License-Identifier: Apache-2.0
"""Reads and merges the result files of any number of fuzz shards, for the page (campaigns/fuzz/page.py)."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path

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
