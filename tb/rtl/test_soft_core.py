# SPDX-License-Identifier: Apache-2.0
"""soft_core on the card: PicoRV32 traps where RV32I has no meaning, and a reset ends that.

All other tests of the card run its program, those of the small card on SERV, which has no trap.
"""

from __future__ import annotations

import pytest

from tb.lib.card import MS
from tb.lib.supervision import WatchedCard

FAULTS = {
    "illegal": 0xFFFF_FFFF,
    "misaligned": 0x0020_2183,  # lw x3, 2(x0)
    "multiply": 0x0242_01B3,  # mul x3, x4, x4: not in RV32I
    "breakpoint": 0x0010_0073,
}


@pytest.mark.rule("WDG-1")
@pytest.mark.parametrize("instruction", FAULTS.values(), ids=FAULTS)
def test_an_instruction_without_meaning_restarts_the_program_at_once(instruction: int):
    with WatchedCard("standard", baud=38_400).boot() as card:
        stopped = card.now_ps
        card.stop(instruction)
        bitten = card.bite()
        card.restore()
        assert bitten - stopped < MS
        card.check_restarted(bitten)
