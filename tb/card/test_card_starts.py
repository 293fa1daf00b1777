# SPDX-License-Identifier: Apache-2.0
"""The card starts, whatever its registers hold at power-up, and after a reset at any clock."""

import pytest

from tb.lib.seeds import seeded
from tb.lib.shares import Share, shares
from tb.lib.starts import KINDS, start

STARTS = {"standard": 50, "tiny": 20}


@pytest.mark.all_cards
@pytest.mark.parametrize("kind", KINDS)
@shares(5)
@pytest.mark.rule("SAFE-5", "BOOT-1")
def test_every_start_is_alive_and_leaves_the_firmware_image_as_it_was(config, kind, share: Share):
    first = seeded(f"starts by {kind}").randrange(1 << 31)
    failed = {}
    for seed in share.of(range(first, first + STARTS[config])):
        if trouble := start(kind, config, seed):
            failed[seed] = trouble
    assert not failed, f"{len(failed)} starts: {failed}"
