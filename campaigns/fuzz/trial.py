# SPDX-License-Identifier: Apache-2.0
"""Plays and judges one case of the fuzzer (case.py).

The judge follows the two lines up to the point at which the rules leave the outcome open. After that point
only safety is checked (aftermath.py).
"""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path

from campaigns.engine import EngineError, Row, total
from campaigns.fuzz.aftermath import asked, possible_frames, unanswered, unasked
from campaigns.fuzz.case import LONG_WAIT, Pace, Played, Player, clk_hz, own_pace, probes
from campaigns.fuzz.traffic import make
from sim.harness.library import Target
from sim.harness.pins import BAUDS
from tb.model import fc_telegram
from tb.model.card import DIALECTS, CardModel
from tb.model.told import Verdict as Told
from tb.model.told import judge
from tb.model.whole_card import LineJudge, Verdict
from tb.model.wire import LineFormat

LOCAL = 3  # number of the last requests that need no drive
# Of register 40003, in 10 ms: up to here the wait ends before the drive's answer about a parameter (21 ms).
SHORT_WAIT = 2


def row_of(name: str, target: Target, strict_t15: bool = True) -> Row:
    """Plays a case. `judged`: frames that the judge finished; of others only safety is checked."""
    began = time.process_time()
    seed, number, *bauds = name.split("/")
    case = make(f"{seed}/{number}", rates(*bauds), target.config)
    verdict, played = run(case, target, strict_t15=strict_t15)
    return {
        "frames": len(played.frames),
        "judged": played.judged(verdict.until),
        "cases": 1,
        "simulated_s": played.end / clk_hz(case["baud"], own_pace(target.config)),
        "events": Counter(event["what"] for event in case["events"]),
        "rates": {f"{case['baud']} {case['form']}": len(played.frames)},
        "outcomes": verdict.counts,
        "unclear": {verdict.unclear.split(" of ")[0]: 1} if verdict.unclear else {},
        "worst": verdict.worst,  # clocks after the earliest time
        "differences": [{"case": name, "what": verdict.differences}] if verdict.differences else [],
        "cpu_s": time.process_time() - began,
    }


def rates(text: str = "") -> tuple[int, ...]:
    try:
        found = tuple(int(word) for word in text.split(",") if word)
    except ValueError as error:
        raise EngineError(f"--bauds {text}: numbers with commas") from error
    if set(found) - set(BAUDS):
        raise EngineError(f"--bauds: the rates are {', '.join(map(str, sorted(BAUDS)))}")
    return found


def until(
    seed: int,
    frames: int,
    target: Target,
    bauds: tuple[int, ...] = (),
    *,
    strict_t15: bool = True,
    stop: bool = False,
) -> Row:
    """The cases of a seed until so many network frames are judged, with `stop` until the first difference."""
    found, text = [], "/".join(["", ",".join(map(str, bauds))]) if bauds else ""
    while sum(row["judged"] for row in found) < frames and not (stop and found and found[-1]["differences"]):
        found.append(row_of(f"{seed}/{len(found)}{text}", target, strict_t15))
    return total(found)


def run(
    case: dict, target: Target, wave: Path | None = None, *, strict_t15: bool = True
) -> tuple[Verdict, Played]:
    player = Player(case, target, wave)
    played = player.play()
    verdict = followed(case, player, played, strict_t15=strict_t15)
    if verdict.unclear:
        verdict.differences += aftermath(case, played, player.line, verdict, player.wait)
    verdict.differences += told(case, player, played, strict_t15=strict_t15).differences
    return verdict, played


def followed(case: dict, player: Player, played: Played, *, strict_t15: bool = True) -> Verdict:
    """Each reply and each telegram, up to where the rules leave the outcome open."""
    card, budget = CardModel(name=case["dialect"]), player.pace.budget_clocks
    judge = LineJudge(card, player.line, case["address"], budget, strict_t15)
    return judge.evaluate(played.network, played.drive, played.replies, played.telegrams, played.end)


def told(case: dict, player: Player, played: Played, *, strict_t15: bool = True) -> Told:
    """Differences of SAFE-8 and FRAME-7, also behind the point where the judge of the lines had to stop."""
    return judge(
        played.network,
        played.drive,
        played.replies,
        played.telegrams,
        played.end,
        line=player.line,
        address=case["address"],
        dialect=case["dialect"],
        budget=player.pace.budget_clocks,
        strict_t15=strict_t15,
    )


def aftermath(case: dict, played: Played, line: LineFormat, verdict: Verdict, wait: int) -> list[str]:
    """Errors after the end of the judge; `wait`: last value of register 40003 that may count."""
    found = []
    frames = possible_frames(played.network, line, case["address"])
    if asked(frames, played.replies, case["dialect"]):
        found += unasked(frames, played.telegrams, played.drive, line.clk_hz, verdict.until, wait)
    else:
        verdict.counts["too much possible behind the judge"] += 1
    # An exchange with a wait beyond the end of the case has no end to check. If the wait is too short for the
    # drive's answer, some dialects do not answer.
    mute = wait <= SHORT_WAIT and "silent" not in DIALECTS[case["dialect"]].codes
    count = LOCAL if wait > LONG_WAIT or mute else None
    last = [bytes.fromhex(probe["pdu"]) for probe in probes(case["dialect"])]
    return found + unanswered(last, played.network, played.replies, played.end, count)


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
