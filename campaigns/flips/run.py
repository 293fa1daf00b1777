# SPDX-License-Identifier: Apache-2.0
"""Flips single bits of the running card under traffic (COUNT=, BAUD=, TRIAL=one flip); `make flips`.

    python -m campaigns.flips.run [--seed N] [--count FLIPS] [--baud RATE] [--config NAME]  # a shard:
    build/fuzz/flips-CONFIG-SEED-RATE.json
    python -m campaigns.flips.run --report                           # a table of all shards for each card
    python -m campaigns.flips.run --trial SEED/NUMBER [--baud RATE] [--config NAME]  # one flip, with the
    traffic on both lines

A shard is stateless: the same seed, count, rate and card flip the same bits anywhere. Exit 0: no
unrequested or altered telegram and no driver that stays on (SAFE-4, SAFE-2); 1: at least one; 2: an invalid
command line or a missing tool.
"""

from __future__ import annotations

import json
import os
import random
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from campaigns.bench import fingerprint
from campaigns.flips.group import GroupError, outcomes
from campaigns.flips.trial import (
    BAUDS,
    FORBIDDEN,
    FORMS,
    GROUP,
    OUTCOMES,
    PACES,
    PARTS,
    Outcome,
    Places,
    flipped_card,
    trial,
)
from campaigns.fuzz.run import FOLDER, FuzzError, refuse_to_lose_a_longer_result, story
from rtl.command import Parser, run_main
from rtl.sources import configurations
from sim.harness.library import BuildError
from sim.harness.registers import RegistersError
from tb.lib import bound
from tb.lib.options import at_least

KEPT_EACH = 50
BOUND = f"first five rows together, at most, at {bound.SURE}"
KEYS = {"seed", "config", "card", "baud", "bits", "counts", "notable", "flips", "cpu_s"}  # of a result
# Effects that the report lists one by one.
WRONG = ("telegram again or late", "wrong reply", "silent for good")
NOTABLE = (*OUTCOMES[: OUTCOMES.index("driver stuck") + 1], *WRONG)


class FlipsError(Exception):
    """Error for the user, in one line."""


def shard(seed: int, count: int, places: Places) -> dict:
    """Effects of `count` flips by part, with a list of the notable flips."""
    began = cpu_s()
    result = {
        "seed": seed,
        "config": places.target.config,
        "card": fingerprint.flips(places.target.config),
        "baud": places.baud,
        "bits": {part: places.bits(part) for part in PARTS},
        "counts": Counter(),
        "notable": [],
        "flips": 0,
        "cpu_s": 0.0,
    }
    for number, outcome in enumerate(each_outcome(seed, count, places)):
        result["counts"][f"{outcome.flip.part}: {outcome.what}"] += 1
        if outcome.what in NOTABLE:
            result["notable"].append(
                {
                    "trial": f"{seed}/{number}",
                    "flip": str(outcome.flip),
                    "what": outcome.what,
                    "why": outcome.why,
                }
            )
            if outcome.what in FORBIDDEN:
                print(f"flips: {seed}/{number} {outcome.flip}: {outcome.what}: {outcome.why}", flush=True)
        result |= {"flips": number + 1, "cpu_s": cpu_s() - began}
        if (number + 1) % KEPT_EACH == 0 or number + 1 == count:
            keep(result)
    return result


def cpu_s() -> float:
    """Seconds of one core that this process and its copies have taken."""
    now = os.times()
    return now.user + now.system + now.children_user + now.children_system


def each_outcome(seed: int, count: int, places: Places) -> Iterator[Outcome]:
    for first in range(0, count, GROUP):
        yield from outcomes([f"{seed}/{n}" for n in range(first, min(first + GROUP, count))], places)


def file_of(seed: int, baud: int, config: str) -> Path:
    return FOLDER / f"flips-{config}-{seed}-{baud}.json"


def keep(result: dict) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = file_of(result["seed"], result["baud"], result["config"])
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(result, indent=1) + "\n")
    partial.rename(path)


def merge_each(results: list[dict]) -> list[dict]:
    """The shards of each card as one."""
    configs = sorted({result["config"] for result in results})
    return [merge([result for result in results if result["config"] == config]) for config in configs]


def merge(results: list[dict]) -> dict:
    """The shards of one card as one."""
    results = list({(result["seed"], result["baud"]): result for result in results}.values())
    # At another clock the dividers have other widths, so the number of bits differs.
    rates = {(result["baud"], *result["bits"].values()) for result in results}
    if len({result["card"] for result in results}) > 1 or len(rates) > len({rate for rate, *_ in rates}):
        raise FlipsError("the results in build/fuzz come from different cards; remove the older ones")
    flips_at: Counter = Counter()
    for result in results:
        flips_at[result["baud"]] += result["flips"]
    return {
        "shards": len(results),
        "config": results[0]["config"],
        "card": results[0]["card"],
        "flips": sum(flips_at.values()),
        "flips_at": dict(sorted(flips_at.items())),
        "bits": {part: sorted({result["bits"][part] for result in results}) for part in PARTS},
        "counts": sum((Counter(result["counts"]) for result in results), Counter()),
        "notable": [entry for result in results for entry in result["notable"]],
        "cpu_s": sum(result["cpu_s"] for result in results),
    }


def rates(merged: dict) -> str:
    """Number of flips at each rate, in words."""
    return ", ".join(f"{count} at {baud} bit/s {FORMS[baud]}" for baud, count in merged["flips_at"].items())


def table(merged: dict) -> list[str]:
    """Effects by part, a row each."""
    parts = [part for part in PARTS if any(merged["bits"][part])]
    lines = ["| outcome | " + " | ".join(parts) + " | all |"]
    lines.append("|---|" + "---|" * (len(parts) + 1))
    for what in OUTCOMES:
        row = [merged["counts"].get(f"{part}: {what}", 0) for part in parts]
        lines.append(f"| {what} | " + " | ".join(map(str, [*row, sum(row)])) + " |")
    flips = [sum(n for k, n in merged["counts"].items() if k.startswith(f"{part}: ")) for part in parts]
    lines.append("| flips | " + " | ".join(map(str, [*flips, sum(flips)])) + " |")
    harm = [sum(merged["counts"].get(f"{part}: {what}", 0) for what in FORBIDDEN) for part in parts]
    harms = zip([*harm, sum(harm)], [*flips, sum(flips)], strict=True)
    lines.append(f"| {BOUND} | " + " | ".join(bound.words(seen, tries) for seen, tries in harms) + " |")
    there = [" or ".join(map(str, merged["bits"][part])) for part in parts]
    return [*lines, "| bits there | " + " | ".join(there) + " | |"]


def report(merged: dict) -> str:
    """Table of the effects, and a line for each notable flip."""
    lines = [
        f"{merged['config']} card {merged['card']}: {merged['flips']} flips in {merged['cpu_s']:.0f} s of "
        f"one core: {rates(merged)}",
        "",
    ]
    lines += table(merged)
    lines += [f"{e['trial']}: {e['flip']}: {e['what']}: {e['why']}" for e in merged["notable"]]
    return "\n".join(lines)


def load(folder: Path) -> list[dict]:
    files = sorted(folder.glob("flips-*.json"))
    if not files:
        raise FlipsError("no results of flips; run `make flips` first")
    try:
        results = [json.loads(path.read_text()) for path in files]
        if not all(result.keys() >= KEYS for result in results):
            raise ValueError
    except (ValueError, AttributeError) as error:
        raise FlipsError(f"a file flips-*.json in {folder} is no result") from error
    return results


def tell(name: str, places: Places) -> int:
    outcome, case, played, verdict = trial(name, places)
    print(f"{outcome.flip} ({outcome.flip.part}): {outcome.what}: {outcome.why}")
    print("\n".join(story(case, played, verdict, PACES[places.target.config])))
    return int(outcome.what in FORBIDDEN)


def main() -> int:
    parser = Parser(prog="flips", description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=at_least(0))
    parser.add_argument("--count", type=at_least(1), help="flips; default 500")
    parser.add_argument("--baud", type=int, default=BAUDS[0], choices=BAUDS, help="network line")
    parser.add_argument("--config", choices=list(configurations()), default="standard", help="the card")
    parser.add_argument("--report", action="store_true", help="merge the results of all shards")
    parser.add_argument("--trial", metavar="SEED/NUMBER", help="one flip again, with its traffic")
    options = parser.parse_args()
    if options.trial:
        if not re.fullmatch(r"\d+/\d+", options.trial):
            parser.error(f"--trial {options.trial}: SEED/NUMBER")
        if options.seed is not None or options.count is not None:
            parser.error("--trial is one flip: no --seed, no --count")
        return tell(options.trial, Places(flipped_card(options.config), options.baud))
    if options.report:
        merged = merge_each(load(FOLDER))
    else:
        seed = random.randrange(1 << 31) if options.seed is None else options.seed
        count = options.count or 500
        path = file_of(seed, options.baud, options.config)
        refuse_to_lose_a_longer_result(path, count, fingerprint.flips(options.config), "flips")
        about = f"{count} flips at {options.baud} bit/s, {options.config} card"
        print(f"flips: seed {seed}, {about}", flush=True)
        merged = [merge([shard(seed, count, Places(flipped_card(options.config), options.baud))])]
    print("\n\n".join(map(report, merged)))
    return int(any(entry["what"] in FORBIDDEN for card in merged for entry in card["notable"]))


if __name__ == "__main__":
    run_main("flips", main, BuildError, RegistersError, FlipsError, FuzzError, GroupError)
