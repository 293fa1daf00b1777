# SPDX-License-Identifier: Apache-2.0
"""The whole card with BREAK_TOLERANT: a low after a request is silence, a character is not (FRAME-3).

A low lasts from some time after the request to the reply, or is too short, or is a character. Recorded bus:
wizmodbus.sr, wire BA+, without what its slave drove: the wire stays low until the master drives it again.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from regs.dialects import folder_with
from rtl.sources import ROOT, configuration
from sim.harness.library import BuildError, Target
from sim.harness.pins import NETWORK, Pins
from sim.harness.simulated_card import NUMBER
from sim.view.replay import STROBES, Replay
from sw.rtu2fc.capture import open_capture
from tb.agents import rtu
from tb.lib.config import SLOW_HZ
from tb.model.wire import UNSURE_BITS, Burst, LineFormat

CLK_HZ = SLOW_HZ["standard"]
TOLERANT = ROOT / "build" / folder_with(BREAK_TOLERANT=1)
UNIT = 1
REQUEST = rtu.build(UNIT, bytes.fromhex("03 03E8 0002"))
ANSWER = rtu.build(UNIT, bytes.fromhex("83 40"))
CHARACTER_BITS = 11
# A break's own character is not counted as silence, nor is the fall before it: FRAME-3, break_filter.
LATE_BITS = CHARACTER_BITS + 1.5
CAPTURE = ROOT / "tb/captures/wizmodbus.sr"
RATE = 9600
MASTER_DRIVES_US = 400  # after the slave's driver goes off the master's goes on within this time
REQUESTS, SERVED, TELEGRAMS = 44, 38, 4


@dataclass
class Outcome:
    candidates: int
    commits: int
    revokes: int
    replies: list[Burst]
    end: float  # of the request's last stop bit

    def fate(self) -> tuple[int, int, int, list[bytes]]:
        return self.candidates, self.commits, self.revokes, [burst.data for burst in self.replies]


class Card:
    """A card at the end of a line that anybody may pull low."""

    def __init__(self, form: str, images: Path | None = TOLERANT) -> None:
        self.line = LineFormat(RATE, form, CLK_HZ)
        target = Target(images=images)
        try:
            library = target.library(CLK_HZ)
            self.pins = Pins(library, target.image_folder("card"), self.line, UNIT, more=STROBES)
        except BuildError as error:
            pytest.fail(str(error), pytrace=False)
        self.pins.play(NETWORK, [(0, 1)])
        self.run(configuration("standard")["boot_ms"] * CLK_HZ / 1000 + 8 * CHARACTER_BITS * self.line.bit)

    def run(self, clocks: float) -> None:
        until = self.pins.now + clocks
        while self.pins.now < round(until):
            self.pins.run(until)

    def request(self, after_bits: float, levels: list[tuple[float, int]]) -> Outcome:
        """A request, and from `after_bits` bits after it on levels, each with its length in bits."""
        at, edges, bit = float(self.pins.now + 10), [], self.line.bit
        for byte in REQUEST:
            for level in self.line.levels(byte):
                edges.append((at, level))
                at += bit
        end = at
        at += after_bits * bit
        for length, level in levels:
            edges.append((at, level))
            at += length * bit
        edges.append((at, 1))
        counts = [len(self._strobes(name)) for name in STROBES]
        sent = len(self.pins.sent(NETWORK))
        self.pins.play(NETWORK, edges)
        self.run(at - self.pins.now + 30 * CHARACTER_BITS * bit)
        found = [len(self._strobes(name)) - count for name, count in zip(STROBES, counts, strict=True)]
        return Outcome(*found, self.pins.sent(NETWORK)[sent:], end)

    def _strobes(self, name: str) -> list[int]:
        return [at for at, level in self.pins.edges[NUMBER[name]] if level]


@pytest.fixture(params=["8N1", "8E1", "8O1", "8N2"])
def card(request: pytest.FixtureRequest) -> Iterator[Card]:
    found = Card(request.param)
    yield found
    found.pins.close()


def check_answered(card: Card, outcome: Outcome, late_bits: float, what: str) -> None:
    """Once, after t3.5, and after the low's first character at the latest."""
    assert (outcome.candidates, outcome.commits, outcome.revokes) == (1, 1, 0), what
    assert [burst.data for burst in outcome.replies] == [ANSWER], what
    after = (outcome.replies[0].start - outcome.end) / card.line.bit - card.line.t35_bits
    assert -UNSURE_BITS < after < late_bits, f"{what}: {after:.2f} bits after t3.5"


@pytest.mark.nightly
@pytest.mark.rule("FRAME-3", "FRAME-6", "FRAME-8")
def test_a_low_up_to_the_reply_is_silence(card: Card):
    """It begins at the next clock after the request, or at any time before the commit."""
    clock = 1 / card.line.bit
    last = card.line.t35_bits - 0.5
    for after in (clock, 0.2, 3, 0.5 * CHARACTER_BITS, 10, 1.5 * CHARACTER_BITS, 30, last):
        what = f"low from {after:.2f} bits on"
        check_answered(card, card.request(after, [(300, 0)]), LATE_BITS, what)


@pytest.mark.nightly
@pytest.mark.rule("FRAME-3")
def test_a_break_that_ends_before_the_commit_is_silence(card: Card):
    for lows in (1, 2):
        outcome = card.request(0.2, [(12, 0), (3, 1)] * lows)
        check_answered(card, outcome, lows * LATE_BITS, f"{lows} lows")


@pytest.mark.nightly
@pytest.mark.rule("FRAME-3", "FRAME-6", "FRAME-7")
def test_a_character_after_a_request_does_what_it_did(card: Card):
    """As on the card without the option. 00 with a good stop bit resembles a break most."""
    strict = Card(card.line.form, ())
    levels = {
        "00": [(1.0, level) for level in card.line.levels(0)],
        "80 without a stop bit": [(1.0, level) for level in card.line.levels(0x80, flaw="stop")],
        "a low of eight bits": [(8.0, 0), (3.0, 1)],
    }
    for what, after in itertools.product(levels, (0.2, 3, 0.6 * CHARACTER_BITS, 20, card.line.t35_bits - 3)):
        found, expected = (each.request(after, levels[what]) for each in (card, strict))
        assert found.fate() == expected.fate(), f"{what} from {after} bits on"
        assert after < 1.5 * CHARACTER_BITS or not (found.commits or found.replies), what
        check_answered(card, card.request(0.2, [(300, 0)]), LATE_BITS, f"the request after {what}")
        strict.request(0, [])
    strict.pins.close()


@pytest.mark.rule("FRAME-3")
def test_without_the_option_each_of_these_lows_revokes():
    card = Card("8N1", ())
    for after in (0.2, 20, card.line.t35_bits - 3):
        outcome = card.request(after, [(300, 0)])
        assert not outcome.commits and not outcome.replies, f"low from {after} bits on"
    assert card.request(0, []).commits == 1
    card.pins.close()


def without_the_slave() -> list[tuple[int, int]]:
    """The edges of BA+ without those of the recorded slave; low where nobody drives."""
    capture = open_capture(CAPTURE)
    edges, driver = capture.edges("BA+", CLK_HZ), capture.edges("DE", CLK_HZ)
    late = MASTER_DRIVES_US * CLK_HZ // 1_000_000
    for (rise, level), (fall, _) in itertools.pairwise(driver):
        if level:
            own = [at for at, _ in edges if rise <= at < fall + late]
            edges = [edge for edge in edges if not rise <= edge[0] < own[-1]]
    return [edge for i, edge in enumerate(edges) if not i or edge[1] != edges[i - 1][1]]


@pytest.mark.nightly
@pytest.mark.rule("FRAME-3", "FRAME-7")
@pytest.mark.parametrize(("images", "served"), [(TOLERANT, True), (None, False)], ids=["tolerant", "default"])
def test_the_requests_of_the_recorded_bus(images, served: bool):
    """A request less than 3.5 characters after the card's own reply is ignored (FRAME-1): the recorded master
    did not know when this card's reply ends."""
    line = LineFormat(RATE, "8N1", CLK_HZ)
    with Replay(without_the_slave(), line, UNIT, images=images) as replay:
        replay.play()
        requests = [fate.piece for fate in replay.fates if fate.piece.begins_good]
        assert len(requests) == REQUESTS
        commits = replay.strobes("commit")
        if not served:
            assert not commits and not replay.replies and not replay.telegrams
            return
        starts = [piece.start for piece in requests] + [float("inf")]
        committed = 0
        for start, after in itertools.pairwise(starts):
            before = max((burst.fall for burst in replay.replies if burst.fall < start), default=0)
            heard = sum(start < at < after for at in commits)
            silence = (start - before) / line.bit - line.t35_bits
            if not -UNSURE_BITS < silence < LATE_BITS:
                assert heard == int(silence > 0)
            assert heard <= 1
            committed += heard
        assert committed == SERVED
        # The drive's reply to a telegram comes after this master's next request (FRAME-7).
        assert len(replay.telegrams) == TELEGRAMS and len(replay.replies) == SERVED - TELEGRAMS
        assert all(burst.data[0] == UNIT for burst in replay.replies)
