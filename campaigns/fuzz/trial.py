# SPDX-License-Identifier: Apache-2.0
"""Plays and judges one case of the fuzzer (case.py).

The judge follows the two lines up to the point at which the rules leave the outcome open. After that point
only safety is checked (aftermath.py).
"""

from __future__ import annotations

from pathlib import Path

from campaigns.fuzz.aftermath import asked, possible_frames, unanswered, unasked
from campaigns.fuzz.case import LONG_WAIT, Played, Player, probes
from sim.harness.library import Target
from tb.model.card import DIALECTS, CardModel
from tb.model.told import Verdict as Told
from tb.model.told import judge
from tb.model.whole_card import LineJudge, Verdict
from tb.model.wire import LineFormat

LOCAL = 3  # number of the last requests that need no drive
# Of register 40003, in 10 ms: up to here the wait ends before the drive's answer about a parameter (21 ms).
SHORT_WAIT = 2


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
