# SPDX-License-Identifier: Apache-2.0
"""The fast part of `make line-quality`: limits agree with LINE-5 and theory.

The other tests check the measurement: it must detect a worse receiver.
"""

from __future__ import annotations

import os
import random
from dataclasses import replace

import pytest

from campaigns.fuzz.case import clk_hz
from campaigns.line_quality.limits import ALL_FORMS, QUANTITIES
from campaigns.line_quality.measure import Prober, holds
from campaigns.line_quality.waveform import Badness, edges
from campaigns.line_quality.work import FAST, FORM, Piece
from tb.model.wire import LineFormat

SEED = int(os.environ.get("COCOTB_RANDOM_SEED", "1"))
LINE = LineFormat(115200, FORM, clk_hz(115200))


DAILY = replace(FAST[1], quantities=("glitch",))  # 115200 bit/s; rate errors are tested below


@pytest.mark.rule("LINE-5")
@pytest.mark.parametrize(
    "piece",
    [DAILY, *(pytest.param(piece, marks=pytest.mark.nightly) for piece in FAST)],
    ids=lambda piece: piece.name,
)
def test_limits_keep_the_promise(piece: Piece):
    print(f"repeat with COCOTB_RANDOM_SEED={SEED}")
    limits = piece.run(SEED)
    assert {one.quantity for one in limits} == set(piece.quantities)
    assert not [fault for one in limits for fault in one.faults]


@pytest.mark.rule("LINE-5")
@pytest.mark.parametrize("error", [-0.04, 0.04])
def test_all_formats_tolerate_a_rate_error_of_4_percent(error: float):
    print(f"repeat with COCOTB_RANDOM_SEED={SEED}")
    for form in ALL_FORMS:
        with Prober(LineFormat(115200, form, clk_hz(115200))) as prober:
            assert holds(prober, Badness(error=error), 200, f"{SEED}/{form}"), form


# ---------------------------------------------------------------- the measurement


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_no_fault_passes_and_a_great_fault_fails(quantity: str):
    with Prober(LINE) as prober:
        assert holds(prober, Badness.of(quantity, 0.0), 60, "clean")
        assert not holds(prober, Badness.of(quantity, 1.3 * QUANTITIES[quantity].theory(FORM)[1]), 400, "bad")


def test_waveform_has_the_chosen_faults():
    start, bit = 1000.0, LINE.bit
    clean, end = edges(LINE, b"\x55\x01", start, Badness(), random.Random(1))
    # A start bit, eight alternating bits, parity 0, stop; then 0, 1, seven 0, parity 1.
    bits = [0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 12, 13, 20]
    assert [at for at, _ in clean] == [start + i * bit for i in bits]
    assert [level for _, level in clean] == [i % 2 for i in range(len(bits))]
    assert end == start + 22 * bit
    late, _ = edges(LINE, b"\x55", start, Badness(late_rise=0.25), random.Random(1))
    assert [at - was for (at, _), (was, _) in zip(late, clean[:10], strict=True)] == [0, bit / 4] * 5
    glitched, _ = edges(LINE, b"\x55\x01", start, Badness(glitch=0.2), random.Random(1))
    assert len(glitched) == len(clean) + 2
    shaken, _ = edges(LINE, b"\x55", start, Badness(jitter=0.1), random.Random(1))
    off = {round((at - was) / bit, 6) for (at, _), (was, _) in zip(shaken, clean[:10], strict=True)}
    assert off == {-0.1, 0.1}
