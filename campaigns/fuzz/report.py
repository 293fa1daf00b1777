# SPDX-License-Identifier: Apache-2.0
"""What the page of the fuzzer shows: its frames, the impatient masters, the planted bugs and the flips."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from campaigns.flips import run as flips
from campaigns.flips.trial import FORBIDDEN, PACES
from campaigns.fuzz.case import clk_hz
from tb.lib import bound

# campaigns/fuzz/aftermath.py checks these two after the point to which the judge can follow.
UNJUDGED = "no unrequested telegram; every last request answered"


def seeds(rows: dict[str, Any]) -> str:
    return ", ".join(map(str, sorted({int(case.split("/")[0]) for case in rows})))


def frames_in_all(cards: list[Namespace]) -> str:
    """Frames of all cards, and how often one can differ."""
    differences, judged = sum(card.wrong for card in cards), sum(card.tries for card in cards)
    found = f"cases with a difference: {differences}" if differences else "no difference"
    return (
        f"{judged:,} frames of both cards judged to their end, each with the judge of its row: {found}, "
        f"at most {bound.words(differences, judged)} of the frames at {bound.SURE}"
    )


def masters_in_all(cards: list[Namespace]) -> str:
    wrong, tries = sum(card.wrong for card in cards), sum(card.tries for card in cards)
    count = sum(len(card.rows) for card in cards)
    return (
        f"{count:,} sequences of masters that do not wait, on both cards: {wrong} with a difference, "
        f"at most {bound.words(wrong, tries)} of those that came to rest at {bound.SURE}"
    )


def flips_in_all(cards: list[Namespace]) -> str:
    """Flips of all cards, and how often one can do what is forbidden."""
    count = sum(card.total["flips"] for card in cards)
    harm = sum(entry["what"] in FORBIDDEN for card in cards for entry in card.total["notable"])
    return (
        f"{count:,} flips of both cards: {harm} unrequested or altered telegrams and stuck drivers, "
        f"at most {bound.words(harm, count)} of the flips at {bound.SURE}"
    )


def conditions(card: Namespace) -> str:
    """What the flips of one card did not vary."""
    clocks = sorted({clk_hz(int(baud), PACES[card.config]) / 1e6 for baud in card.total["flips_at"]})
    return (
        f"The model's clock was {' or '.join(f'{clock:.4g}' for clock in clocks)} MHz, not the card's own. "
        "Dialect `card`, and a drive that always answers."
    )


def context(fuzzed: list[Namespace], masters: list[Namespace], flipped: list[Namespace]) -> dict[str, Any]:
    for card in flipped:
        card.rates, card.table = flips.rates(card.total), "\n".join(flips.table(card.total))
        card.conditions = conditions(card)
    for card in (*fuzzed, *masters):
        card.seeds = seeds(card.rows)
    return {
        "fuzzed": fuzzed,
        "masters": masters,
        "flipped": flipped,
        "frames_in_all": frames_in_all(fuzzed),
        "masters_in_all": masters_in_all(masters),
        "flips_in_all": flips_in_all(flipped),
        "events": sorted({name for card in fuzzed for name in card.total["events"]}),
        "others": "the differences above include theirs" if any(card.wrong for card in fuzzed) else UNJUDGED,
        "flips_judge": flips.CAMPAIGN.judge(),
    }


def statements(found: dict[str, Any]) -> str:
    return "\n".join(f"{found[name]}." for name in ("frames_in_all", "masters_in_all", "flips_in_all"))
