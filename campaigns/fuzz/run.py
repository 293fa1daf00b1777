# SPDX-License-Identifier: Apache-2.0
"""Random lines and drives, judged by the models (1 min for COUNT=50 cases; REPLAY=case); `make fuzz`.

    python -m campaigns.fuzz.run [--config tiny] [--seed N] [--count CASES] [--bauds 9600]
    python -m campaigns.fuzz.run [--config tiny] --replay build/fuzz/case-FILE.json [--wave FILE.fst]

A case has about 40 network frames. Of the first ones with a difference the smallest case found and its
waveform are written to build/fuzz, as case-CONFIG-SEED-N.json and .fst. Exit 0: no difference; 1:
differences; 2: an invalid command line or a missing tool. Other options: campaigns/engine.py.
"""

from __future__ import annotations

import functools
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any

from campaigns.engine import Campaign, EngineError, Row, Store, total
from campaigns.flips.run import CAMPAIGN as FLIPS
from campaigns.fuzz import case_file, report
from campaigns.fuzz.case import Played, own_pace
from campaigns.fuzz.case_file import CaseError
from campaigns.fuzz.impatient import CAMPAIGN as IMPATIENT
from campaigns.fuzz.shrink import shrink
from campaigns.fuzz.traffic import make
from campaigns.fuzz.trial import rates, row_of, run, story
from rtl.command import Parser, run_main
from rtl.sources import ROOT, SourcesError
from sim.harness.library import BuildError, Target
from tb.model.whole_card import Verdict

FOLDER = ROOT / "build/fuzz"
Play = Callable[..., tuple[Verdict, Played]]


class Fuzz(Campaign):
    every_dialect = True
    name, module = "fuzz", "campaigns.fuzz.run"
    command = "make fuzz, impatient and flips of both cards"
    count = 50
    keep = ("Random frames", "Masters that do not wait")

    def options(self, parser: Parser) -> None:
        parser.add_argument("--bauds", default="", help="these rates only, with commas")
        parser.add_argument(
            "--replay", type=Path, metavar="FILE.json", help="play one case again and tell it"
        )
        parser.add_argument("--wave", type=Path, metavar="FILE.fst", help="with --replay: its waveform")

    def cases(self, given: Namespace) -> list[str]:
        rates(given.bauds)
        return [f"{case}/{given.bauds}" if given.bauds else case for case in super().cases(given)]

    def run(self, config: str, case: str) -> Row:
        return row_of(case, Target(config=config))

    def instead(self, given: Namespace) -> int | None:
        if not given.replay:
            if given.wave:
                raise EngineError("--wave is of a case: --replay FILE.json")
            return None
        if given.wave and (given.wave.is_dir() or not given.wave.resolve().parent.is_dir()):
            raise EngineError(f"--wave {given.wave}: no file can be written there")
        return replay(given.replay, given.wave, Target(config=given.config))

    def wrong(self, row: Row) -> str:
        return "; ".join(what for each in row["differences"] for what in each["what"])

    def follow(self, config: str, case: str) -> str:
        return smaller(case, config, functools.partial(run, target=Target(config=config)), FOLDER)

    def tries(self, rows: dict[str, Row]) -> int:
        return sum(row["judged"] for row in rows.values())

    def said(self, rows: dict[str, Row]) -> str:
        sums = total(rows.values())
        return (
            f"{sums['frames']} network frames in {len(rows)} cases, {sums['judged']} of them judged to their "
            f"end, {len(sums['differences'])} differences; {sums['simulated_s']:.0f} s simulated in "
            f"{sums['cpu_s']:.0f} s of one core, {sums['frames'] / sums['cpu_s']:.0f} frames/s"
        )

    def context(self, store: Store) -> dict[str, Any]:
        return report.context(self.found(store), IMPATIENT.found(store), FLIPS.found(store))

    def about(self, store: Store) -> str:
        return report.statements(self.context(store))

    def subjects(self) -> list[str]:
        return [*super().subjects(), "flips judge"]


def shown(path: Path) -> Path:
    return path.relative_to(ROOT) if path.is_relative_to(ROOT) else path


def smaller(name: str, config: str, play: Play, folder: Path) -> str:
    """Shrinks a case with a difference and keeps it with its waveform; how it is played again."""
    seed, number, *bauds = name.split("/")
    case = make(f"{seed}/{number}", rates(*bauds), config)
    path = folder / f"case-{config}-{seed}-{number}.json"
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(case_file.text(case))
    case = shrink(case, lambda tried: bool(play(tried)[0].differences))
    path.write_text(case_file.text(case))
    play(case, wave=path.with_suffix(".fst"))
    setting = "" if config == Target().config else f"CONFIG={config} "
    return f"{shown(path)} and .fst; make fuzz {setting}REPLAY={shown(path)}"


def replay(path: Path, wave: Path | None, target: Target) -> int:
    case = case_file.read(path)
    verdict, played = run(case, target, wave)
    print(f"{case['baud']} bit/s {case['form']}, address {case['address']}, dialect {case['dialect']}; ms")
    print("\n".join(story(case, played, verdict, own_pace(target.config))))
    if verdict.unclear:
        print(f"judged in part: {verdict.unclear}")
    return 1 if verdict.differences else 0


CAMPAIGN = Fuzz()

if __name__ == "__main__":
    run_main("fuzz", CAMPAIGN.main, BuildError, CaseError, EngineError, SourcesError)
