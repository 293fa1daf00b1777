# SPDX-License-Identifier: Apache-2.0
"""The card starts, whatever its registers hold at power-up, and after a reset at any clock."""

import pytest

from regs.dialects import folder_with
from tb.lib.card import MS
from tb.lib.config import own_hz
from tb.lib.fast_card import RESET_CLOCKS, FastCard
from tb.lib.nightly import first
from tb.lib.seeds import seeded
from tb.lib.starts import ANSWER, KINDS, READ, start

# In `make test`, and at night.
STARTS = {"standard": (8, 50), "tiny": (1, 20)}


@pytest.mark.parametrize("config", STARTS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("night", first([0, 1]), ids=["some", "many"])
@pytest.mark.rule("SAFE-5", "BOOT-1")
def test_every_start_is_alive_and_leaves_the_firmware_image_as_it_was(config, kind, night: int):
    begin = seeded(f"starts by {kind}").randrange(1 << 31)
    failed = {}
    for seed in range(begin, begin + STARTS[config][night]):
        if trouble := start(kind, config, seed):
            failed[seed] = trouble
    assert not failed, f"{len(failed)} starts: {failed}"


@pytest.mark.rule("FRAME-3", "BOOT-1")
def test_the_first_frame_meets_the_firmware_s_options():
    """It has a gap and ends before the firmware has checked its image."""
    images = folder_with(STRICT_T15=0)
    with FastCard(baud=115_200, form="8N1", clk_hz=own_hz("standard"), dialect=images) as card:
        card.modbus.send(READ[:4], RESET_CLOCKS * card.period_ps + 4 * MS)
        card.modbus.send(READ[4:], MS)
        card.run_until(2 * card.boot_ms * MS)
        assert [frame.data for frame in card.modbus.frames()] == [ANSWER]
