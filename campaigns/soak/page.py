# SPDX-License-Identifier: Apache-2.0
"""Writes docs/reports/soak.md from the results in build/soak; `make soak-page`.

    python -m campaigns.soak.page

Both cards must have been soaked as they are now. Without a result in build/soak the page's own section stays,
if it is of this card, these firmware sources and this judge. Exit 2: a result is missing.
"""

from __future__ import annotations

import json
import re
from collections import Counter

from campaigns.bench import fingerprint
from campaigns.soak import run
from rtl.command import run_main
from rtl.report_page import write_page
from rtl.sources import ROOT, configurations
from sw.test import host
from tb.lib import bound

TEMPLATE = ROOT / "campaigns/soak/soak.md.in"
PAGE = ROOT / "docs/reports/soak.md"


class PageError(Exception):
    """Error for the user, in one line."""


class NotMeasuredError(PageError):
    """This card has not been soaked as it is now."""


def read(config: str) -> list[dict]:
    """The blocks of one card as it is now. Of two with the same seed the longer contains the other one."""
    path, command = run.file_of(config), f"make soak CONFIG={config}"
    if not path.exists():
        raise NotMeasuredError(f"no result of the {config} card as it is now; run `{command}` first")
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
        raise NotMeasuredError(
            f"no result of the {config} card's firmware as it is now; run `{command}` first"
        )
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


def kept(config: str, text: str) -> str:
    """The section of this card in the page `text`, if it would be measured alike now; else empty."""
    after = " ".join(TEMPLATE.read_text().split("{cards}")[1].split()[:4])
    found = re.search(
        rf"^## The {config} card$.*?(?=\n\n(?:## |{re.escape(after)}))", text, re.DOTALL | re.MULTILINE
    )
    of = (f"sources `{host.fingerprint()}`", f"judge `{fingerprint.soak()}`")
    now = f"Measured on the {config} card `{fingerprint.card(config)}`."
    return (
        found[0] if found and now in found[0] and all(each in " ".join(text.split()) for each in of) else ""
    )


def section_of(config: str, text: str) -> str:
    """The new section of a card, or the one of the page `text`."""
    try:
        return section(config, read(config))
    except NotMeasuredError:
        if before := kept(config, text):
            return before
        raise


def page() -> str:
    text = PAGE.read_text() if PAGE.exists() else ""
    sections = [section_of(config, text) for config in configurations()]
    return TEMPLATE.read_text().format(
        cards="\n\n".join(sections), block=run.BLOCK, judge=fingerprint.soak(), sources=host.fingerprint()
    )


def main() -> int:
    write_page(PAGE, page())
    print(f"wrote {PAGE.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    run_main("soak-page", main, PageError)
