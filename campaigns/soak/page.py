# SPDX-License-Identifier: Apache-2.0
"""Writes docs/reports/soak.md from the results in build/soak; `make soak-page`.

    python -m campaigns.soak.page

Both cards must have been soaked as they are now. Exit 2: a result is missing, or is of another card.
"""

from __future__ import annotations

import json
from pathlib import Path

from campaigns.bench import fingerprint
from campaigns.fuzz import bound
from campaigns.soak.run import FOLDER
from rtl.command import run_main
from rtl.sources import ROOT, configurations

TEMPLATE = ROOT / "campaigns/soak/soak.md.in"
PAGE = ROOT / "docs/reports/soak.md"


class PageError(Exception):
    """Error for the user, in one line."""


def read(folder: Path, config: str) -> dict:
    """The result of one card as it is now."""
    path, command = folder / f"{config}.json", f"make soak CONFIG={config}"
    try:
        result = json.loads(path.read_text())
        stated = result["card"], result["firmware"]
    except FileNotFoundError:
        raise PageError(f"{path.name} is missing in {folder}; run `{command}` first") from None
    except (ValueError, KeyError, TypeError) as error:
        raise PageError(f"{path} is no result of `{command}`") from error
    if stated != (fingerprint.card(config), fingerprint.firmware(config)):
        raise PageError(f"{path.name} is of another card; run `{command}` again")
    return result


def section(config: str, result: dict) -> str:
    """One card: a row for each dialect, and the replies."""
    rows = []
    for run in result["runs"]:
        count, seen = run["transactions"], len(run["mismatches"])
        seeds = f"{run['seeds'][0]} to {run['seeds'][-1]}"
        cells = (
            *(run["dialect"], run["profile"], seeds, ", ".join(run["lines"]), f"{count:,}", seen),
            *(bound.words(seen, count), f"{run['simulated_s'] / 60:.0f} min"),
        )
        rows.append(f"| {' | '.join(map(str, cells))} |")
    kinds = [
        f"{run['dialect']}: " + ", ".join(f"{count:,} {what}" for what, count in run["replies"].items()) + "."
        for run in result["runs"]
    ]
    return "\n".join(
        [
            f"## The {config} card",
            "",
            f"Measured on the {config} card `{result['card']}`, firmware `{result['firmware']}`.",
            "",
            "| dialect | drive | seeds | rates and formats | transactions | mismatches "
            f"| at {bound.SURE} at most | simulated |",
            "|---|---|---|---|---:|---:|---:|---:|",
            *rows,
            "",
            "Replies:",
            "",
            *(f"- {kind}" for kind in kinds),
        ]
    )


def page(folder: Path) -> str:
    sections = [section(config, read(folder, config)) for config in configurations()]
    return TEMPLATE.read_text().format(cards="\n\n".join(sections))


def main() -> int:
    PAGE.write_text(page(FOLDER))
    print(f"wrote {PAGE.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    run_main("soak-page", main, PageError)
