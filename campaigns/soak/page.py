# SPDX-License-Identifier: Apache-2.0
"""Writes build/reports/soak.md from the results in build/soak; `make soak-page`.

    python -m campaigns.soak.page

Both cards must have been soaked as they are now. Exit 2: a result is missing.
"""

from __future__ import annotations

import json
from collections import Counter

from campaigns.bench import fingerprint
from campaigns.soak import run
from rtl.command import run_main
from rtl.report_page import publish
from rtl.sources import ROOT, configurations
from sw.test import host
from tb.lib import bound

TEMPLATE = ROOT / "campaigns/soak/soak.md.in"


class PageError(Exception):
    """Error for the user, in one line."""


def read(config: str) -> list[dict]:
    """The blocks of one card as it is now. Of two with the same seed the longer contains the other one."""
    path, command = run.file_of(config), f"make soak CONFIG={config}"
    if not path.exists():
        raise PageError(f"no result of the {config} card as it is now; run `{command}` first")
    blocks: dict[tuple, dict] = {}
    try:
        for block in map(json.loads, path.read_text().splitlines()):
            key = block["dialect"], block["profile"], block["seed"]
            if block["firmware"] != fingerprint.firmware(config, block["dialect"]):
                continue
            blocks[key] = max(block, blocks.get(key, block), key=_weight)
    except (ValueError, KeyError, TypeError) as error:
        raise PageError(f"{path} is no result of `{command}`") from error
    if not blocks:
        raise PageError(f"no result of the {config} card's firmware as it is now; run `{command}` first")
    return [blocks[key] for key in sorted(blocks)]


def _weight(block: dict) -> tuple[bool, int]:
    """What was found once stays on the page."""
    return block["mismatches"] > 0, block["transactions"]


def in_short(lines: list[str]) -> str:
    """Rates with their formats: 9600 bit/s 8E1 and 9600 bit/s 8N1 as `9600: 8E1 8N1`."""
    rates: dict[int, list[str]] = {}
    for line in sorted(set(lines)):
        rate, _, line_format = line.split()
        rates.setdefault(int(rate), []).append(line_format)
    return "; ".join(f"{rate}: {' '.join(rates[rate])}" for rate in sorted(rates))


def section(config: str, blocks: list[dict]) -> str:
    """One card: a row for each dialect and drive, and the replies."""
    rows, kinds = [], []
    runs: dict[tuple[str, str], list[dict]] = {}
    for block in blocks:
        runs.setdefault((block["dialect"], block["profile"]), []).append(block)
    for (dialect, profile), run_blocks in runs.items():
        count = sum(block["transactions"] for block in run_blocks)
        seen = sum(block["mismatches"] for block in run_blocks)
        cells = (
            *(dialect, f"`{run_blocks[0]['firmware']}`", profile, len(run_blocks)),
            in_short([block["line"] for block in run_blocks]),
            *(f"{count:,}", seen, bound.words(seen, count)),
            f"{sum(block['simulated_s'] for block in run_blocks) / 60:.0f} min",
        )
        rows.append(f"| {' | '.join(map(str, cells))} |")
        replies = sum((Counter(block["replies"]) for block in run_blocks), Counter())
        kinds.append(
            f"- {dialect}, {profile}: "
            + ", ".join(f"{replies[what]:,} {what}" for what in sorted(replies))
            + "."
        )
    return "\n".join(
        [
            f"## The {config} card",
            "",
            f"Measured on the {config} card `{fingerprint.card(config)}`.",
            "",
            "| dialect | image | drive | blocks | bit/s: formats | transactions | with a mismatch "
            f"| bound of their share at {bound.SURE} | simulated |",
            "|---|---|---|---:|---|---:|---:|---:|---:|",
            *rows,
            "",
            "Replies:",
            "",
            *kinds,
        ]
    )


def page() -> str:
    sections = [section(config, read(config)) for config in configurations()]
    return TEMPLATE.read_text().format(
        cards="\n\n".join(sections), block=run.BLOCK, judge=fingerprint.soak(), sources=host.fingerprint()
    )


def main() -> int:
    of = fingerprint.now("standard card", "tiny card", "firmware", "soak judge")
    keep = [f"The {config} card" for config in configurations()]
    publish("soak", page(), "make soak COUNT=20000 of both cards, and soak-page", of, keep=keep)
    return 0


if __name__ == "__main__":
    run_main("soak-page", main, PageError)
