# SPDX-License-Identifier: Apache-2.0
"""Writes build/reports/fuzz.md from the results of three campaigns; `make fuzz-page`.

    python -m campaigns.fuzz.page

The campaigns are the fuzzer, the planted bugs, and the flips of each card. Their results are in build/fuzz.
Exit 2: a result is missing, or is of another card than the present one.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from campaigns.bench import fingerprint
from campaigns.flips import report as flips_report
from campaigns.flips import run as flips
from campaigns.flips.trial import PACES
from campaigns.fuzz import report as fuzz
from campaigns.fuzz import run as fuzz_run
from campaigns.fuzz.case import clk_hz
from campaigns.fuzz.plants import PLANTS
from rtl.command import run_main
from rtl.report_page import publish
from rtl.sources import ROOT, configurations
from sw.test import host
from tb.lib import bound

TEMPLATE = ROOT / "campaigns/fuzz/fuzz.md.in"
# campaigns/fuzz/aftermath.py checks these two after the point to which the judge can follow.
UNJUDGED = "no unrequested telegram; every last request answered"
COMMAND = "make fuzz, fuzz-plants, flips (of both cards) and fuzz-page"


class PageError(Exception):
    """Error for the user, in one line."""


def read(path: Path, command: str, keys: set[str]) -> dict:
    """One result file; PageError names the command that writes it."""
    if not path.exists():
        raise PageError(f"{path.name} is missing in {path.parent}; run `{command}` first")
    try:
        result = json.loads(path.read_text())
        if not keys <= result.keys():
            raise ValueError
    except (ValueError, AttributeError) as error:
        raise PageError(f"{path} is no result of `{command}`") from error
    return result


def minutes(seconds: float) -> str:
    return f"{seconds / 60:.0f}"


def plant_rows(found: dict[str, int | None]) -> list[str]:
    """A row for each planted bug, in the order of tb/planted.toml."""
    lacking = [plant.name for plant in PLANTS if plant.name not in found]
    if lacking:
        raise PageError(f"no result of {', '.join(lacking)}; run `make fuzz-plants` again")
    return [
        f"| {plant.name} | {', '.join(plant.rules)}: {plant.what} | "
        + ("not found" if found[plant.name] is None else f"{found[plant.name]:,}")
        + " |"
        for plant in PLANTS
    ]


def in_all(cards: list[dict]) -> str:
    """Flips of all cards, and how often one can do what is forbidden."""
    count = sum(card["flips"] for card in cards)
    harm = sum(entry["what"] in flips.FORBIDDEN for card in cards for entry in card["notable"])
    return (
        f"{count:,} flips of both cards: {harm} unrequested or altered telegrams and stuck drivers, "
        f"at most {bound.words(harm, count)} of the flips at {bound.SURE}"
    )


def conditions(config: str, bauds: list[int]) -> str:
    """What the flips of one card did not vary."""
    clocks = sorted({clk_hz(baud, PACES[config]) / 1e6 for baud in bauds})
    return (
        f"The model's clock was {in_words(f'{clock:.4g}' for clock in clocks)} MHz, not the card's own. "
        "Dialect `card`, and a drive that always answers."
    )


def in_words(words: Iterable[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} or {last}" if first else last


def card_flips(merged: dict) -> str:
    """The section of one card."""
    card, firmware, _ = merged["card"].split()
    return "\n".join(
        [
            f"### Of the {merged['config']} card",
            "",
            f"{merged['config']} card `{card}`, firmware `{firmware}`: {merged['flips']:,} flips in "
            f"{merged['shards']} shards, {flips.rates(merged)}, "
            f"in {minutes(merged['cpu_s'])} minutes of one core.",
            conditions(merged["config"], list(merged["flips_at"])),
            "",
            *flips.table(merged),
        ]
    )


def rare_flips(card: dict) -> str:
    """The rare outcomes of one card."""
    return "\n".join(
        [f"Of the {card['config']} card:", "", *flips_report.rare(flips_report.rare_counts(card["notable"]))]
    )


def differing(cards: list[dict]) -> int:
    return sum(len(card["differences"]) for card in cards)


def frames_in_all(cards: list[dict]) -> str:
    """Frames of all cards, and how often one can differ."""
    differences, judged = differing(cards), sum(card["judged"] for card in cards)
    found = f"differences: {differences}" if differences else "no difference"
    return (
        f"{judged:,} frames of both cards judged to their end, each with the judge of its row: {found}, "
        f"at most {bound.words(differences, judged)} of the frames at {bound.SURE}"
    )


def random_row(card: dict) -> str:
    """The fuzzer's results on one card."""
    its_card, firmware, judge = card["card"].split()
    cells = [
        f"{card['config']} card `{its_card}`, firmware `{firmware}`",
        f"`{judge}`",
        ", ".join(map(str, card["seeds"])),
        f"{card['frames']:,}",
        f"{card['cases']:,}",
        minutes(card["wall_s"]),
        f"{card['judged']:,}",
        str(differing([card])),
        bound.words(differing([card]), card["judged"]),
    ]
    return f"| {' | '.join(cells)} |"


def event_rows(cards: list[dict]) -> str:
    """What the fuzzer did, by the name of its traffic (docs/guide/testing.md)."""
    rows = []
    for name in sorted({name for card in cards for name in card["events"]}):
        counts = [f"{card['events'].get(name, 0):,}" for card in cards]
        rows.append(f"| {' | '.join([name, *counts])} |")
    return "\n".join(rows)


def collected(folder: Path, cards: dict[str, str], flipped: dict[str, str]) -> dict:
    """The results in `folder`, those of each card as one.

    They must be of these cards, by configuration: `cards` for the fuzzer, `flipped` for the flips.
    """
    plants = read(folder / "plants.json", "make fuzz-plants", fuzz_run.PLANTS_KEYS)
    frames = [fuzz.load(path) for path in sorted(folder.glob("*.json")) if fuzz.RESULT.fullmatch(path.name)]
    of_flips = flips.load(folder) if any(folder.glob("flips-*.json")) else []
    found = [("standard", plants["card"], cards)]
    for shards, its_cards in ((frames, cards), (of_flips, flipped)):
        found += [(shard["config"], shard["card"], its_cards) for shard in shards]
    for config, card, its_cards in found:
        if card != its_cards[config]:
            raise PageError(f"a result in {folder.name} is of another {config} card, {card}; remove it")
    for shards, command in ((frames, "fuzz"), (of_flips, "flips")):
        if lacking := [config for config in cards if config not in {shard["config"] for shard in shards}]:
            raise PageError(f"no result of it; run `make {command} CONFIG={lacking[0]}` first")
    return {
        "plants": plants,
        "frames": fuzz.merge_each(frames),
        "flips": flips.merge_each(of_flips),
    }


def page(found: dict) -> str:
    """The text of the page."""
    cards, all_flips = found["frames"], found["flips"]
    plants = found["plants"]
    return TEMPLATE.read_text().format(
        sources=f"firmware sources `{host.fingerprint()}`",
        flips_judge=all_flips[0]["card"].split()[-1],
        frames=frames_in_all(cards),
        random="\n".join(map(random_row, cards)),
        configs=" | ".join(card["config"] for card in cards),
        events=event_rows(cards),
        others="the differences above include theirs" if differing(cards) else UNJUDGED,
        plants_seed=plants["seed"],
        plants_judge=plants["card"].split()[-1],
        plants_count=f"{plants['count']:,}",
        plants="\n".join(plant_rows(plants["frames"])),
        flips=in_all(all_flips),
        flips_tables="\n\n".join(map(card_flips, all_flips)),
        rare="\n\n".join(map(rare_flips, all_flips)),
    )


def main() -> int:
    cards = {config: fingerprint.fuzz(config) for config in configurations()}
    flipped = {config: fingerprint.flips(config) for config in configurations()}
    found = collected(fuzz.FOLDER, cards, flipped)
    text = page(found)
    said = f"{frames_in_all(found['frames'])}.\n{in_all(found['flips'])}."
    of = fingerprint.now("standard card", "tiny card", "firmware", "fuzz judge", "flips judge")
    publish("fuzz", text, COMMAND, of, said, keep=["Random frames"])
    return 0


if __name__ == "__main__":
    run_main("fuzz-page", main, PageError, fuzz.ReportError, flips.FlipsError)
