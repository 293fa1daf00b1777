# SPDX-License-Identifier: Apache-2.0
"""The fast part of the measuring bench as a guard: a case over its limit fails.

The card at its own clock, measured on the pins (sim/bench). Simulated time: a busy machine changes nothing.
"""

from __future__ import annotations

import os

import pytest

from sim.bench.card import Line
from sim.bench.cases import Sample, turnaround
from sim.bench.conformance import boundary
from sim.bench.work import Piece, fast

SEED = int(os.environ.get("COCOTB_RANDOM_SEED", "1"))
PIECES = list(fast(SEED))


def pieces(*kinds: str) -> pytest.MarkDecorator:
    chosen = [piece for piece in PIECES if piece.kind in kinds]
    return pytest.mark.parametrize("piece", chosen, ids=[piece.name for piece in chosen])


def run(piece: Piece) -> None:
    print(f"repeat with COCOTB_RANDOM_SEED={SEED}")
    outcome = piece.run()
    assert not outcome.faults, "\n".join(outcome.faults)
    assert outcome.checks, "nothing was checked"


@pytest.mark.rule("PERF-1", "PERF-2", "PERF-3", "FRAME-8")
@pieces("early")
def test_turnaround_is_the_wires(piece: Piece) -> None:
    run(piece)


@pytest.mark.rule("FRAME-6", "FRAME-3")
@pieces("gate")
def test_character_between_t15_and_t35_takes_all_back(piece: Piece) -> None:
    run(piece)


@pytest.mark.rule("FRAME-7")
@pieces("overtaken")
def test_newer_frame_while_the_drive_answers(piece: Piece) -> None:
    run(piece)


@pytest.mark.rule("PERF-1", "PERF-2", "PERF-3", "EXC", "FRAME-4")
@pieces("random")
def test_random_requests_have_no_outlier(piece: Piece) -> None:
    run(piece)


@pytest.mark.rule("FRAME-1", "LINE-5", "LINE-6")
@pieces("conformance")
def test_conformance_rows(piece: Piece) -> None:
    run(piece)


def test_limits_can_be_missed() -> None:
    """The judge itself: each figure beyond its limit is a fault, each at it is none."""
    floor = {"request": 1.0}
    at_limit = Sample("x", 9600, "8E1", local=1.0, telegram=1.0, answer=1.0, total=1.01, floor_parts=floor)
    assert at_limit.faults() == []
    for beyond in (
        {"local": 1.01},
        {"after_t35": -0.01},
        {"telegram": 1.01},
        {"telegram_before_pause": 0.1},
        {"answer": 1.01},
        {"answer": -1.01},
        {"total": 1.011},
    ):
        assert len(Sample("x", 9600, "8E1", floor_parts=floor, **beyond).faults()) == 1


def test_a_card_that_does_not_prepare_early_misses_them() -> None:
    """The whole way from the pins to the judge: the late build is a real card beyond the limits."""
    outcome = turnaround(19200, "8E1", False, 1, ("read 16 coils", "start motor"), SEED)
    missed = " ".join(fault for sample in outcome.samples for fault in sample.faults())
    assert "PERF-1" in missed and "PERF-2" in missed


def test_boundary_is_found_from_both_sides() -> None:
    assert boundary(lambda x: x <= 3, 0, 10, 0.01) == pytest.approx(3, abs=0.01)
    assert boundary(lambda x: x >= 3, 10, 0, 0.01) == pytest.approx(3, abs=0.01)
    assert boundary(lambda x: True, 0, 10, 0.01) != boundary(lambda x: True, 0, 10, 0.01)  # nan: no boundary


def test_characters_of_every_format() -> None:
    assert Line.of(9600, "8N1").character(0x01) == [0, 1, 0, 0, 0, 0, 0, 0, 0, 1]
    assert Line.of(9600, "8N2").character(0x00) == [0] * 9 + [1, 1]
    assert Line.of(9600, "8E1").character(0x01)[9:] == [1, 1]
    assert Line.of(9600, "8O1").character(0x01)[9:] == [0, 1]
    assert Line.of(9600, "8E1").character(0x01, bad_parity=True)[9:] == [0, 1]
    assert Line.of(9600, "8E1").character(0x01, bad_stop=True)[9:] == [1, 0]
    assert (Line.of(19200, "8N1").t35_bits, Line.of(38400, "8E1").t35_bits) == (38.5, 67.2)
