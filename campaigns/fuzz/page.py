# SPDX-License-Identifier: Apache-2.0
"""Writes docs/reports/fuzz.md from the results in build/fuzz; `make fuzz-page`.

    python -m campaigns.fuzz.page

Four campaigns must have run on one card, firmware and judge: the fuzzer, the planted bugs, the flips of the
whole card, and those of the core alone. Exit 2: a result is missing, or is of another card.
"""

from __future__ import annotations

import json
from pathlib import Path

from campaigns.flips import core
from campaigns.flips import report as flips_report
from campaigns.flips import run as flips
from campaigns.fuzz import bound
from campaigns.fuzz import report as fuzz
from campaigns.fuzz import run as fuzz_run
from campaigns.fuzz.plants import PLANTS
from rtl.command import run_main
from rtl.sources import ROOT, configurations

TEMPLATE = ROOT / "campaigns/fuzz/fuzz.md.in"
PAGE = ROOT / "docs/reports/fuzz.md"
# campaigns/fuzz/aftermath.py checks these two after the point to which the judge can follow.
UNJUDGED = "no unrequested telegram; every last request answered"


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


def seeds(results: list[dict]) -> str:
    return ", ".join(str(seed) for seed in sorted({result["seed"] for result in results}))


def minutes(seconds: float) -> str:
    return f"{seconds / 60:.0f}"


def plant_rows(found: dict[str, int | None]) -> list[str]:
    """A row for each planted bug, in the order of plants.py."""
    lacking = [plant.name for plant in PLANTS if plant.name not in found]
    if lacking:
        raise PageError(f"no result of {', '.join(lacking)}; run `make fuzz-plants` again")
    return [
        f"| {plant.name} | {plant.description} | "
        + ("not found" if found[plant.name] is None else f"{found[plant.name]:,}")
        + " |"
        for plant in PLANTS
    ]


def core_table(config: str, results: dict[str, dict[str, int]]) -> list[str]:
    """A row for each request, a column for each result."""
    rows = [
        f"| {name} | " + " | ".join(f"{found.get(what, 0):,}" for what in core.RESULTS) + " |"
        for name, found in results.items()
    ]
    titles = f"| scenario on the {config} card | {' | '.join(core.RESULTS)} |"
    return [titles, f"|---|{'---:|' * len(core.RESULTS)}", *rows]


def core_count(result: dict, *wanted: str) -> int:
    """Flips of the core with these results, in all scenarios of both cards."""
    scenarios = [found for of_card in result["results"].values() for found in of_card.values()]
    return sum(found.get(what, 0) for found in scenarios for what in wanted)


def in_all(merged: list[dict]) -> str:
    """Flips of all cards, and how often one can do what is forbidden."""
    count = sum(card["flips"] for card in merged)
    harm = sum(entry["what"] in flips.FORBIDDEN for card in merged for entry in card["notable"])
    return (
        f"{count:,} flips of both cards: {harm} unrequested or altered telegrams and stuck drivers, "
        f"at most {bound.words(harm, count)} of the flips at {bound.SURE}"
    )


def card_flips(merged: dict) -> str:
    """The section of one card."""
    card, firmware, _ = merged["card"].split()
    return "\n".join(
        [
            f"#### Of the {merged['config']} card",
            "",
            f"{merged['config']} card `{card}`, firmware `{firmware}`: {merged['flips']:,} flips in "
            f"{merged['shards']} shards, {flips.rates(merged)}, "
            f"in {minutes(merged['wall_s'])} minutes of one core.",
            "",
            *flips.table(merged),
        ]
    )


def page(folder: Path) -> str:
    """The text of the page, from the results in `folder`."""
    shards = [fuzz.load(path) for path in fuzz.find([str(folder)])]
    random_frames = fuzz.merge(shards)
    plants = read(folder / "plants.json", "make fuzz-plants", fuzz_run.PLANTS_KEYS)
    core_flips = read(folder / "core-flips.json", "make core-flips", core.KEYS)
    flip_shards = flips.load(folder)
    all_flips = {merged["config"]: merged for merged in flips.merge_each(flip_shards)}
    lacking = [config for config in configurations() if config not in all_flips]
    if lacking:
        raise PageError(f"no flips of the card {lacking[0]}; run `make flips CONFIG={lacking[0]}` first")
    cards = {result["card"] for result in (random_frames, plants, all_flips["standard"])}
    judges = {result["card"].split()[-1] for result in all_flips.values()}
    same_cores = core_flips["cards"] == {config: merged["card"] for config, merged in all_flips.items()}
    if len(cards) > 1 or len(judges) > 1 or not same_cores:
        raise PageError("the results come from different cards; remove the older ones")
    card, firmware, judge = random_frames["card"].split()
    differences = len(random_frames["differences"])
    return TEMPLATE.read_text().format(
        measured_on=f"card `{card}`, firmware `{firmware}`, judge `{judge}`",
        fuzz_seeds=seeds(shards),
        frames=f"{random_frames['frames']:,}",
        cases=f"{random_frames['cases']:,}",
        fuzz_minutes=minutes(random_frames["wall_s"]),
        judged=f"{random_frames['judged']:,}",
        differences=f"differences: {differences}" if differences else "no difference",
        others="with the differences above" if differences else UNJUDGED,
        plants_seed=plants["seed"],
        plants_count=f"{plants['count']:,}",
        plants="\n".join(plant_rows(plants["frames"])),
        core_flips=f"{core_flips['flips']:,}",
        core_altered=f"{core_count(core_flips, *core.ALTERED):,}",
        core_altered_1=f"{core_count(core_flips, core.ALTERED[0]):,}",
        core_altered_0=f"{core_count(core_flips, core.ALTERED[1]):,}",
        core="\n\n".join("\n".join(core_table(*each)) for each in core_flips["results"].items()),
        bound=bound.words(differences, random_frames["judged"]),
        flips=in_all(list(all_flips.values())),
        flips_tables="\n\n".join(map(card_flips, all_flips.values())),
        rare="\n".join(
            flips_report.rare(entry for merged in all_flips.values() for entry in merged["notable"])
        ),
    )


def main() -> int:
    PAGE.write_text(page(fuzz.FOLDER))
    print(f"wrote {PAGE.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    run_main("fuzz-page", main, PageError, fuzz.ReportError, flips.FlipsError)
