# SPDX-License-Identifier: Apache-2.0
"""The card starts, whatever its registers hold at power-up, and after a reset at any clock."""

import pytest

from tb.lib.nightly import first
from tb.lib.seeds import seeded
from tb.lib.starts import KINDS, start

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
