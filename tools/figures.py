# SPDX-License-Identifier: Apache-2.0
"""Which measured page is of an older card, and which command renews it.

    python -m tools.figures            a line each; exit 1 when a page is of an older card

A page states the fingerprint of the sources that it was measured on (campaigns/bench/fingerprint.py). This
check compares it with the sources of this tree. It runs before a release, not in `make test`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from campaigns.bench import fingerprint
from campaigns.bench import report as bench_report
from campaigns.mutate import run as mutate
from constraints import synth
from formal import flips, prove
from rtl.command import run_main
from rtl.sources import ROOT, rtl_files
from sw.test import host

REPORTS = ROOT / "docs/reports"
CARD = re.compile(r"\bcard `([0-9a-f]{12})`", re.IGNORECASE)
BOTH = re.compile(r"\b(standard|tiny) card `([0-9a-f]{12})`", re.IGNORECASE)
SOURCES = re.compile(r"\bfirmware\s+sources\s+`([0-9a-f]{12})`")
# Of a page: the words before a judge's name, and the function of fingerprint.py that gives it.
JUDGES = {
    "starts": {"Judge ": "starts"},
    "soak": {r"\bjudge ": "soak"},
    "fuzz": {
        r"firmware `\w+` \| ": "fuzz_judge",
        "frames each, with judge ": "fuzz_judge",
        "Judge of both campaigns below: ": "flips_judge",
    },
}
ROW = re.compile(r"^\| `(\w+)` \|.*\| `([0-9a-f]+)` \|$", re.MULTILINE)


def bench(_: str) -> str:
    stated, tree = bench_report.stated(), fingerprint.tree()
    other = [name for name in ("card", "tiny card", "bench") if stated.get(name) != tree.get(name)]
    return f"measured with another {' and another '.join(other)}" if other else ""


def one_card(text: str) -> str:
    """Pages that name the standard card, once for each of their parts."""
    now, stated = fingerprint.card(), set(CARD.findall(text))
    if not stated:
        return "it does not name the card that it was measured on"
    older = sorted(stated - {now})
    return f"measured on card `{', '.join(older)}`; the sources are card `{now}`" if older else ""


def both_cards(text: str) -> str:
    """A page that names the standard card and the small one."""
    stated = set(BOTH.findall(text))
    now = {config: fingerprint.card(config) for config in ("standard", "tiny")}
    older = [
        config for config in now if {card for name, card in stated if name.lower() == config} != {now[config]}
    ]
    return f"measured on another card: {', '.join(older)}" if older else ""


def with_firmware(check: Callable[[str], str]) -> Callable[[str], str]:
    """The check of the cards, then that of the images' sources. Images are not built in a new checkout."""

    def both(text: str) -> str:
        stated = set(SOURCES.findall(text))
        return check(text) or ("" if stated == {host.fingerprint()} else "measured on another firmware")

    return both


def judged(page: str) -> Callable[[str], str]:
    """Both cards, the sources of their images, and the page's judges."""

    def check(text: str) -> str:
        if older := with_firmware(both_cards)(text):
            return older
        for said, judge in JUDGES[page].items():
            if set(re.findall(rf"{said}`(\w+)`", text)) != {getattr(fingerprint, judge)()}:
                return "measured by another judge"
        return ""

    return check


def mutants(text: str) -> str:
    """The page has a row for each module, with the fingerprint of the module's code."""
    rows = dict(ROW.findall(text))
    benches = set(mutate.benches())
    paths = {path.stem: path for path in rtl_files() if path.stem in benches}
    older = sorted(name for name, path in paths.items() if rows.get(name) != mutate.fingerprint(path))
    return f"these modules have changed: {', '.join(older)}" if older else ""


def proved_flips(text: str) -> str:
    """The page has a row for each module, with the fingerprint of what was proved."""
    rows = dict(ROW.findall(text))
    older = sorted(name for name in flips.known() if rows.get(name) != flips.fingerprint(name))
    return f"these modules have changed: {', '.join(older)}" if older else ""


def proofs(text: str) -> str:
    """The page has rows for each module, with the fingerprint of what was proved."""
    rows = set(ROW.findall(text))
    older = sorted({name for name, of in rows if of != prove.fingerprint(name)})
    return f"these modules have changed: {', '.join(older)}" if older else ""


def synthesis(_: str) -> str:
    return "synthesised from another design" if synth.stale() else ""


# Blocks of the firmware's page that name the sources that they were measured on. The block of the branches is
# compared by `make coverage-firmware CHECK=1`.
FIRMWARE_BLOCKS = {"fuzz": "fuzzing", "mutate": "mutants"}


def firmware(text: str) -> str:
    stamp = f"firmware sources {host.fingerprint()}"
    older = [
        subject
        for block, subject in FIRMWARE_BLOCKS.items()
        if not re.search(rf"^```{block}\n{stamp}\n", text, re.MULTILINE)
    ]
    return f"measured on an earlier firmware: {', '.join(older)}" if older else ""


# Page of docs/reports: its check, which returns why it is an older page (empty: it is not), and its command.
PAGES: dict[str, tuple[Callable[[str], str], str]] = {
    "results": (with_firmware(bench), "make bench"),
    "conformance": (with_firmware(both_cards), "make conformance"),
    "coverage": (with_firmware(both_cards), "make coverage-rtl"),
    "line-quality": (with_firmware(one_card), "make line-quality"),
    "fuzz": (
        judged("fuzz"),
        "make fuzz, fuzz-plants, flips (of both cards), core-flips and fuzz-page",
    ),
    "starts": (
        judged("starts"),
        "make starts (of both cards) and starts-page",
    ),
    "soak": (
        judged("soak"),
        "make soak COUNT=20000 (of both cards) and soak-page",
    ),
    "mutants": (mutants, "make mutate"),
    "proofs": (proofs, "make formal"),
    "proved-flips": (proved_flips, "make formal-flips"),
    "synthesis": (synthesis, "make synth"),
    "masters": (with_firmware(one_card), "make masters"),
    "firmware-quality": (firmware, "make fuzz-firmware RUNS=10000000, mutate-firmware"),
}


def path_of(page: str) -> Path:
    return REPORTS / f"{page}.md"


def older_pages() -> dict[str, str]:
    """Pages of an older card, each with the command that renews it."""
    return {page: command for page, (check, command) in PAGES.items() if check(path_of(page).read_text())}


def main() -> int:
    wrong = 0
    for page, (check, command) in PAGES.items():
        path = path_of(page)
        if not path.exists():
            wrong += 1
            print(f"{path.relative_to(ROOT)}: not there; {command} writes it")
            continue
        older = check(path.read_text())
        wrong += bool(older)
        state = f"out of date: {older}; {command} renews it" if older else "of this card"
        print(f"{path.relative_to(ROOT)}: {state}")
    return 1 if wrong else 0


if __name__ == "__main__":
    run_main("figures", main)
