# SPDX-License-Identifier: Apache-2.0
"""Writes build/reports/starts.md from the results in build/starts; `make starts-page`.

    python -m campaigns.starts.page

Both cards must have been started as they are now. Exit 2: a result is missing.
"""

from __future__ import annotations

from campaigns.bench import fingerprint
from campaigns.starts import run
from rtl.command import run_main
from rtl.report_page import publish
from rtl.sources import ROOT, configurations
from sw.test import host
from tb.lib import bound, starts

TEMPLATE = ROOT / "campaigns/starts/starts.md.in"


class PageError(Exception):
    """Error for the user, in one line."""


def row(config: str, kind: str) -> str:
    found = run.results(run.file_of(kind, config))
    if not found:
        raise PageError(
            f"no {kind} of the {config} card as it is now; run `make starts CONFIG={config}` first"
        )
    failed = sum(map(bool, found.values()))
    cells = (
        config,
        kind,
        f"{len(found):,}",
        f"{min(found)} to {max(found)}",
        failed,
        bound.words(failed, len(found)),
    )
    return f"| {' | '.join(map(str, cells))} |"


def page() -> str:
    cards = [
        f"{config} card `{fingerprint.card(config)}`, firmware `{fingerprint.firmware(config)}`"
        for config in configurations()
    ]
    rows = [row(config, kind) for config in configurations() for kind in starts.KINDS]
    return TEMPLATE.read_text().format(
        cards="; ".join(cards),
        sources=host.fingerprint(),
        judge=fingerprint.starts(),
        rows="\n".join(rows),
        sure=bound.SURE,
    )


def main() -> int:
    of = fingerprint.now("standard card", "tiny card", "firmware", "starts judge")
    publish("starts", page(), "make starts of both cards, and starts-page", of, keep=[""])
    return 0


if __name__ == "__main__":
    run_main("starts-page", main, PageError)
