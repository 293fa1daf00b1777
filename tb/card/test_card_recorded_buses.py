# SPDX-License-Identifier: Apache-2.0
"""Recordings of real buses at the network pin of the whole card (tb/captures, FRAME-1 ... FRAME-8).

The recorded edges come at their own times. The expectation is decoded from them: frames by silence and CRC,
and the answers by the model of the card. A silence within a quarter bit of 3.5 characters may count as one or
not (FRAME-1). Some replies of the flow meter begin there. No slave can tell another slave's reply to its own
address from a request, and no rule asks for it: such a reply is answered as a request.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from regs.dialects import folder_with
from rtl.sources import ROOT
from sim.harness.library import BuildError
from sim.view.replay import Fate, Replay
from tb.agents import rtu
from tb.lib.config import SLOW_HZ
from tb.lib.recorded_buses import FLOATING, METERS, MODULE, SLAVE, Bus
from tb.model.card import CardModel
from tb.model.whole_card import SYNC_CLOCKS, LineJudge
from tb.model.wire import UNSURE_BITS, LineFormat

CLK_HZ = SLOW_HZ["standard"]
BUDGET_CLOCKS = 10_000  # as the fuzzer allows (campaigns/fuzz/case.py)
FOREIGN = 9
WRONG_LENGTH = 65  # exception (EXC 2)
TOLERANT = ROOT / "build" / folder_with(BREAK_TOLERANT=1)
# A break's own character is not counted as silence, nor is the fall before it: FRAME-3, break_filter.
LATE_BITS = 12.5
MASTER_DRIVES_US = 400  # after the slave's driver goes off the master's goes on within this time
SERVED, TELEGRAMS = 38, 4  # by a card that takes a low for silence


def opened(
    bus: Bus,
    unit: int,
    replies: bool = True,
    edges: list[tuple[int, int]] | None = None,
    images: Path | None = None,
) -> Replay:
    line = LineFormat(bus.baud, bus.form, CLK_HZ)
    try:
        return Replay(edges or bus.edges(CLK_HZ), line, unit, replies=replies, images=images)
    except BuildError as error:
        pytest.fail(str(error), pytrace=False)


def buses(*found: Bus) -> list:
    """In `make test` the short recording alone."""
    return [
        pytest.param(bus, id=str(bus), marks=[] if bus in MODULE else pytest.mark.nightly) for bus in found
    ]


@dataclass
class Expected:
    """The good frames for a unit, and those whose outcome FRAME-1 leaves open."""

    sure: list[Fate] = field(default_factory=list)
    unsure: list[Fate] = field(default_factory=list)


def good_frames(replay: Replay, unit: int) -> Expected:
    """Good by its own characters, and 3.5 characters of silence on both sides."""
    found, line = Expected(), replay.line
    fates = [fate for fate in replay.fates if not fate.left_out]
    limit, margin = line.t35_bits * line.bit, UNSURE_BITS * line.bit
    for number, fate in enumerate(fates):
        before = fates[number - 1].piece.end if number else 0.0
        after = fates[number + 1].piece.start if number + 1 < len(fates) else float("inf")
        silences = (fate.piece.start - before, after - fate.piece.end)
        if fate.piece.fault or fate.piece.data[0] != unit or min(silences) < limit - margin:
            continue
        (found.unsure if min(silences) < limit + margin else found.sure).append(fate)
    return found


def near(times: list[int], end: float, bits: float, bit: float) -> bool:
    """Whether the only time is that of a silence of so many bits (FRAME-1)."""
    return len(times) == 1 and abs(times[0] - end - bits * bit) < UNSURE_BITS * bit


def check_strobes(replay: Replay, unit: int) -> None:
    """Exactly the good frames for the unit become candidates, after half a character, and are committed."""
    line, expected = replay.line, good_frames(replay, unit)
    for fate in (fate for fate in replay.fates if not fate.left_out):
        candidate, commit, revoke = (fate.strobes[name] for name in ("candidate", "commit", "revoke"))
        said = f"{fate} at {fate.piece.start - replay.origin:.0f}: {fate.piece.data.hex(' ')}"
        if fate in expected.sure:
            assert near(candidate, fate.piece.end, line.half_bits, line.bit), said
            assert near(commit, fate.piece.end, line.t35_bits, line.bit), said
            assert not revoke, said
        elif fate not in expected.unsure:
            assert not (candidate or commit or revoke), said


@pytest.mark.rule("FRAME-1", "FRAME-4", "FRAME-6", "FRAME-7", "FRAME-8")
@pytest.mark.parametrize("bus", buses(*MODULE, *SLAVE, *METERS))
def test_the_good_frames_of_our_unit_are_committed_and_served(bus: Bus):
    """The flow meter's own replies are left out: the card is in its place."""
    with opened(bus, bus.unit, replies=bus not in METERS) as replay:
        replay.play()
        assert sum(not fate.piece.fault for fate in replay.fates) == bus.good
        kept = [fate for fate in replay.fates if not fate.left_out]
        assert len(kept) == bus.good // (2 if bus in METERS else 1)
        assert good_frames(replay, bus.unit).sure == kept
        check_strobes(replay, bus.unit)
        judge = LineJudge(CardModel(name="card"), replay.line, bus.unit, BUDGET_CLOCKS)
        verdict = judge.evaluate(
            replay.network, replay.drive_sent, replay.replies, replay.telegrams, replay.pins.now
        )
        assert not verdict.differences and not verdict.unclear, (verdict.differences, verdict.unclear)
        assert verdict.counts["commit"] == len(kept)
        dropped = verdict.counts["reply dropped (FRAME-7)"]
        assert len(replay.replies) == len(kept) - dropped and replay.replies


@pytest.mark.rule("FRAME-5", "SAFE-1")
@pytest.mark.parametrize("bus", buses(*MODULE, *SLAVE, *METERS, FLOATING))
def test_nothing_ever_leaves_for_a_foreign_unit(bus: Bus):
    with opened(bus, FOREIGN) as replay:
        replay.play()
        assert not replay.replies and not replay.telegrams
        assert not any(replay.strobes(name) for name in ("candidate", "commit", "revoke"))
        expected = good_frames(replay, bus.unit)
        counted = sum(fate.counts["COUNT_FOREIGN"] for fate in replay.fates)
        assert len(expected.sure) <= counted <= len(expected.sure) + len(expected.unsure) <= bus.good
        assert all(fate.counts["COUNT_FOREIGN"] == 1 for fate in expected.sure)


@pytest.mark.rule("FRAME-5", "FRAME-6")
def test_a_slaves_reply_to_our_own_unit_is_answered_as_a_request():
    """Most have the wrong length of a request; the echo of a write is that write."""
    bus = MODULE[1]
    with opened(bus, bus.unit) as replay:
        replay.play()
        model = CardModel(name="card")
        answered = []
        for fate in replay.fates:
            step = model.request(fate.piece.data[1:-2])
            assert fate.strobes["commit"], f"{fate}: {fate.piece.data.hex(' ')}"
            if step.reply is not None:
                answered.append(rtu.build(bus.unit, step.reply))
        replies = [burst.data for burst in replay.replies]
        assert replies == answered
        assert sum(data[1:3] == bytes([0x83, WRONG_LENGTH]) for data in replies) == 2
        assert replies.count(rtu.build(1, bytes.fromhex("06 0001 0055"))) == 2
        # The echo of "write coil 3 = on", one telegram in each of both rounds.
        assert [burst.data[3:5] for burst in replay.telegrams] == [bytes.fromhex("0008")] * 2


@pytest.mark.nightly
@pytest.mark.rule("FRAME-1", "FRAME-7", "SAFE-2")
@pytest.mark.parametrize("bus", [pytest.param(bus, id=str(bus)) for bus in METERS])
def test_a_second_slave_with_our_address(bus: Bus):
    """Both answer each request. The card hears nothing while it sends, and never starts into a character."""
    with opened(bus, bus.unit) as replay:
        replay.play()
        bit = replay.line.bit
        requests = [fate for fate in replay.fates if not fate.is_reply]
        assert len(requests) == bus.good // 2
        assert all(len(fate.strobes["candidate"]) == 1 for fate in requests)
        limit = (replay.line.t35_bits + UNSURE_BITS) * bit
        for fate, after in zip(requests, [f for f in replay.fates if f.is_reply], strict=True):
            if after.piece.start - fate.piece.end > limit:
                assert fate.strobes["commit"] and not fate.strobes["revoke"]
            assert len(fate.strobes["commit"]) + len(fate.strobes["revoke"]) == 1
        model = CardModel(name="card")
        committed = [fate for fate in replay.fates if fate.strobes["commit"]]
        answers = [rtu.build(bus.unit, model.request(f.piece.data[1:-2]).reply) for f in committed]
        for burst in replay.replies:
            heard = max((h.end for h in replay.network if h.start < burst.rise - SYNC_CLOCKS), default=0.0)
            assert burst.rise - heard > replay.line.t35_bits * bit - UNSURE_BITS * bit
            newest = sum(fate.strobes["commit"][0] < burst.rise for fate in committed) - 1
            assert burst.data == answers[newest]
        assert not replay.telegrams


@pytest.mark.nightly
@pytest.mark.rule("FRAME-4")
def test_a_wire_that_falls_low_after_each_request_is_not_served():
    """The low is a character with a wrong stop bit (BA+)."""
    with opened(FLOATING, FLOATING.unit) as replay:
        replay.play()
        requests = [fate for fate in replay.fates if fate.piece.begins_good]
        assert len(requests) == SLAVE[0].good and all("stop bit" in fate.piece.fault for fate in requests)
        assert not replay.strobes("commit") and not replay.replies and not replay.telegrams


def without_the_slave() -> list[tuple[int, int]]:
    """The edges of BA+ without those of the recorded slave; low where nobody drives."""
    edges, driver = FLOATING.edges(CLK_HZ), replace(FLOATING, channel="DE").edges(CLK_HZ)
    late = MASTER_DRIVES_US * CLK_HZ // 1_000_000
    for (rise, level), (fall, _) in itertools.pairwise(driver):
        if level:
            own = [at for at, _ in edges if rise <= at < fall + late]
            edges = [edge for edge in edges if not rise <= edge[0] < own[-1]]
    return [edge for i, edge in enumerate(edges) if not i or edge[1] != edges[i - 1][1]]


@pytest.mark.nightly
@pytest.mark.rule("FRAME-3", "FRAME-7")
@pytest.mark.parametrize("images", [TOLERANT, None], ids=["tolerant", "default"])
def test_with_break_tolerant_the_requests_on_such_a_wire_are_served(images: Path | None):
    """A request less than 3.5 characters after the card's own reply is ignored (FRAME-1): the recorded master
    did not know when this card's reply ends."""
    with opened(FLOATING, FLOATING.unit, edges=without_the_slave(), images=images) as replay:
        replay.play()
        line = replay.line
        requests = [fate.piece for fate in replay.fates if fate.piece.begins_good]
        assert len(requests) == SLAVE[0].good
        if not images:
            assert not replay.strobes("commit") and not replay.replies and not replay.telegrams
            return
        starts = [piece.start for piece in requests] + [float("inf")]
        committed = 0
        for start, after in itertools.pairwise(starts):
            before = max((burst.fall for burst in replay.replies if burst.fall < start), default=0)
            heard = sum(start < at < after for at in replay.strobes("commit"))
            silence = (start - before) / line.bit - line.t35_bits
            if not -UNSURE_BITS < silence < LATE_BITS:
                assert heard == int(silence > 0)
            assert heard <= 1
            committed += heard
        assert committed == SERVED
        # The drive's reply to a telegram comes after this master's next request (FRAME-7).
        assert len(replay.telegrams) == TELEGRAMS and len(replay.replies) == SERVED - TELEGRAMS
        assert all(burst.data[0] == FLOATING.unit for burst in replay.replies)
