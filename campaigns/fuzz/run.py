# SPDX-License-Identifier: Apache-2.0
"""Random lines and drives, judged by the models (1 min for COUNT=2000 frames; REPLAY=case); `make fuzz`.

    python -m campaigns.fuzz.run [--config tiny] [--seed N] [--count FRAMES] [--bauds 9600]
    python -m campaigns.fuzz.run [--config tiny] --replay build/fuzz/case-FILE.json [--wave FILE.fst]
    python -m campaigns.fuzz.run --plants [NAME ...]     # frames until each planted bug is found

A run is a stateless shard: the same seed and count make the same cases anywhere. During the run it writes
build/fuzz/fuzz-CONFIG-SEED.json. For each difference it writes the smallest case found and its waveform,
case-CONFIG-SEED-N.json and .fst. `make fuzz-page` merges the results of any number of shards. Exit 0: no
difference; 1: differences; 2: an invalid command line or a missing tool.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from campaigns.bench import fingerprint
from campaigns.fuzz import case_file
from campaigns.fuzz.case import Pace, Played, clk_hz, own_pace
from campaigns.fuzz.case_file import CaseError
from campaigns.fuzz.plants import PLANTS, PlantError, card_with, named
from campaigns.fuzz.shrink import shrink
from campaigns.fuzz.traffic import make
from campaigns.fuzz.trial import run
from rtl.command import Parser, run_main
from rtl.sources import ROOT, SourcesError, configurations
from sim.harness.library import BuildError, Target
from sim.harness.pins import BAUDS
from tb.lib.options import at_least
from tb.model import fc_telegram
from tb.model.whole_card import Verdict

FOLDER = ROOT / "build/fuzz"
PLANTS_FILE = FOLDER / "plants.json"
PLANTS_KEYS = {"seed", "count", "card", "frames"}  # keys of that file
OWN = Target()
Play = Callable[..., tuple[Verdict, Played]]
KEPT_EACH_S = 20
DIFFERENCES_MAX = 10  # a shard with more differences stops


@dataclass
class Result:
    """Findings of a shard. Counts: events, actions of the card, rates; `unclear`: partly judged cases.

    `judged`: frames that the judge finished; for other frames only unrequested telegrams are checked.
    """

    seed: int
    config: str = "standard"
    card: str = ""  # Verilog, image and judge, campaigns/bench/fingerprint.py
    frames: int = 0
    judged: int = 0
    cases: int = 0
    events: Counter = field(default_factory=Counter)
    outcomes: Counter = field(default_factory=Counter)
    rates: Counter = field(default_factory=Counter)
    unclear: Counter = field(default_factory=Counter)
    worst: dict[str, float] = field(default_factory=dict)  # clocks after the earliest time
    differences: list[dict] = field(default_factory=list)
    wall_s: float = 0.0
    simulated_s: float = 0.0

    def __str__(self) -> str:
        per_s = self.frames / self.wall_s if self.wall_s else 0
        return (
            f"{self.frames} network frames in {self.cases} cases, {self.judged} of them judged to their end, "
            f"{len(self.differences)} differences; {self.simulated_s:.0f} s simulated in "
            f"{self.wall_s:.0f} s, {per_s:.0f} frames/s"
        )


def shard(
    seed: int,
    count: int,
    *,
    bauds: tuple[int, ...] = (),
    target: Target = OWN,
    folder: Path = FOLDER,
    small: bool = True,
    stop_at: int = DIFFERENCES_MAX,
    strict_t15: bool = True,
    so_far: Callable[[Result], None] = lambda result: None,
) -> Result:
    """Plays cases until `count` network frames were judged."""
    result, began = Result(seed, target.config, fingerprint.fuzz(target.config)), time.monotonic()
    kept_at = began
    play = functools.partial(run, target=target, strict_t15=strict_t15)
    while result.judged < count and len(result.differences) < stop_at:
        name = f"{seed}/{result.cases}"
        case = make(name, bauds, target.config)
        verdict, played = play(case)
        result.cases += 1
        result.frames += len(played.frames)
        result.judged += played.judged(verdict.until)
        result.simulated_s += played.end / clk_hz(case["baud"], own_pace(target.config))
        result.events.update(event["what"] for event in case["events"])
        result.rates[f"{case['baud']} {case['form']}"] += len(played.frames)
        result.outcomes.update(verdict.counts)
        if verdict.unclear:
            result.unclear[verdict.unclear.split(" of ")[0]] += 1
        for what, clocks in verdict.worst.items():
            result.worst[what] = max(clocks, result.worst.get(what, 0.0))
        if verdict.differences:
            # Report at once: shrinking takes time, and the shard may be stopped during it.
            found = {"case": name, "what": verdict.differences, "events": len(case["events"])}
            result.differences.append(found)
            so_far(result)
            print(f"fuzz: DIFFERENCE in case {name}: {'; '.join(verdict.differences)}", flush=True)
            if small:
                found |= _shrunk(target.config, name, case, play, folder)
                so_far(result)
        result.wall_s = time.monotonic() - began
        if result.wall_s > kept_at - began + KEPT_EACH_S:
            kept_at = time.monotonic()
            so_far(result)
    result.wall_s = time.monotonic() - began
    return result


def file_of(seed: int, config: str) -> Path:
    return FOLDER / f"fuzz-{config}-{seed}.json"


def keep(result: Result) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = file_of(result.seed, result.config)
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(vars(result), indent=1) + "\n")
    partial.rename(path)
    if sys.stderr.isatty():
        print(f"fuzz: {result.judged} frames", end="\r", file=sys.stderr, flush=True)


def refuse_to_lose_a_longer_result(path: Path, count: int, card: str, what: str = "judged") -> None:
    """Refuses to overwrite a longer result of the same seed and card."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        before = json.loads(path.read_text())
        if before["card"] == card and before[what] > count:
            said = f"{shown(path)} has {before[what]} of this seed and card already"
            raise FuzzError(f"{said}; take another seed or remove it")


def shown(path: Path) -> Path:
    return path.relative_to(ROOT) if path.is_relative_to(ROOT) else path


def _shrunk(config: str, name: str, case: dict, play: Play, folder: Path) -> dict:
    """Shrinks a case with a difference and keeps it with its waveform."""
    path = folder / f"case-{config}-{name.replace('/', '-')}.json"
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(case_file.text(case))
    case = shrink(case, lambda tried: bool(play(tried)[0].differences))
    path.write_text(case_file.text(case))
    verdict, _ = play(case, wave=path.with_suffix(".fst"))
    setting = "" if config == OWN.config else f"CONFIG={config} "
    print(f"fuzz:   {shown(path)} and .fst; make fuzz {setting}REPLAY={shown(path)}")
    return {"what": verdict.differences, "events": len(case["events"]), "file": path.name}


def story(case: dict, played: Played, verdict: Verdict, pace: Pace) -> list[str]:
    """All traffic on the two lines, one line each; times in ms."""
    ms = case.get("clk_hz", clk_hz(case["baud"], pace)) / 1000
    lines: list[tuple[float, str]] = []
    for line, heard in (("network", played.network), ("drive", played.drive)):
        run_of: list = []
        for character in [*heard, None]:
            if run_of and (character is None or character.start - run_of[-1].end > 0.1 * ms):
                text = " ".join(f"{c.byte:02x}" + ("" if c.good else "!") for c in run_of)
                lines.append((run_of[0].start, f"to {run_of[-1].end / ms:9.3f}  {line:7} <- {text}"))
                run_of = []
            if character is not None:
                run_of.append(character)
    for burst in played.replies:
        lines.append((burst.rise, f"to {burst.fall / ms:9.3f}  network -> {burst.data.hex(' ')}"))
    for burst in played.telegrams:
        words = fc_telegram.describe(burst.data)
        lines.append((burst.rise, f"to {burst.fall / ms:9.3f}  drive   -> {burst.data.hex(' ')}  ({words})"))
    story_lines = [f"{at / ms:9.3f} {text}" for at, text in sorted(lines)]
    return [*story_lines, *(f"DIFFERENCE {what}" for what in verdict.differences or ["none"])]


class FuzzError(Exception):
    """Error for the user, in one line."""


def replay(path: Path, wave: Path | None, target: Target = OWN) -> int:
    case = case_file.read(path)
    verdict, played = run(case, target, wave)
    print(f"{case['baud']} bit/s {case['form']}, address {case['address']}, dialect {case['dialect']}; ms")
    print("\n".join(story(case, played, verdict, own_pace(target.config))))
    if verdict.unclear:
        print(f"judged in part: {verdict.unclear}")
    return 1 if verdict.differences else 0


def plants(names: list[str], seed: int, count: int, bauds: tuple[int, ...]) -> int:
    """Searches for each planted bug; 1 if one is not found in `count` frames. All bugs write PLANTS_FILE."""
    lived: list[str] = []
    frames: dict[str, int | None] = {}
    for plant in [named(name) for name in names] or PLANTS:
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
            result = shard(
                seed,
                count,
                bauds=bauds,
                target=card_with(plant),
                folder=Path(folder),
                small=False,
                stop_at=1,
            )
        what = result.differences[0]["what"][0] if result.differences else "NOT FOUND"
        print(f"{plant.name:24} {result.frames:6} frames  {what}", flush=True)
        lived += [] if result.differences else [plant.name]
        frames[plant.name] = result.frames if result.differences else None
    if not names:
        kept = {"seed": seed, "count": count, "card": fingerprint.fuzz(), "frames": frames}
        PLANTS_FILE.parent.mkdir(parents=True, exist_ok=True)
        PLANTS_FILE.write_text(json.dumps(kept, indent=1) + "\n")
    print(f"fuzz: {len(lived)} planted bugs not found {' '.join(lived)}".rstrip())
    return 1 if lived else 0


def main() -> int:
    parser = Parser(prog="fuzz", description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=at_least(0))
    parser.add_argument("--count", type=at_least(1), help="network frames, judged; default 2000")
    parser.add_argument("--config", choices=configurations(), default="standard")
    parser.add_argument("--bauds", default="", help="these rates only, with commas")
    parser.add_argument("--replay", type=Path, metavar="FILE.json", help="play one case again and tell it")
    parser.add_argument("--wave", type=Path, metavar="FILE.fst", help="with --replay: its waveform")
    parser.add_argument("--plants", nargs="*", metavar="NAME", help="look for planted bugs: these, or all")
    options = parser.parse_args()
    if options.wave and not options.replay:
        parser.error("--wave is of a case: --replay FILE.json")
    if options.replay and (options.seed is not None or options.count is not None):
        parser.error("--replay plays one case: no --seed, no --count")
    if options.wave and (options.wave.is_dir() or not options.wave.resolve().parent.is_dir()):
        parser.error(f"--wave {options.wave}: no file can be written there")
    if options.replay:
        return replay(options.replay, options.wave, Target(config=options.config))
    options.seed = random.randrange(1 << 31) if options.seed is None else options.seed
    options.count = options.count or 2000
    try:
        bauds = tuple(int(word) for word in options.bauds.split(",") if word)
    except ValueError:
        parser.error(f"--bauds {options.bauds}: numbers with commas")
    if set(bauds) - set(BAUDS):
        parser.error(f"--bauds: the rates are {', '.join(map(str, sorted(BAUDS)))}")
    if options.plants is not None and options.config != "standard":
        parser.error("--plants: the bugs are planted in the standard card")
    if options.plants is not None:
        return plants(options.plants, options.seed, options.count, bauds)
    card = fingerprint.fuzz(options.config)
    refuse_to_lose_a_longer_result(file_of(options.seed, options.config), options.count, card)
    print(f"fuzz: {options.config} card, seed {options.seed}, {options.count} frames", flush=True)
    target = Target(config=options.config)
    result = shard(options.seed, options.count, bauds=bauds, target=target, so_far=keep)
    keep(result)
    print(f"fuzz: {result}")
    return 1 if result.differences else 0


if __name__ == "__main__":
    run_main("fuzz", main, BuildError, CaseError, FuzzError, PlantError, SourcesError)
