# SPDX-License-Identifier: Apache-2.0
"""soft_core on the card: PicoRV32 traps where RV32I has no meaning, and a reset ends that.

All other tests of the card run its program, those of the small card on SERV, which has no trap. Both cores
begin at address 0.
"""

from __future__ import annotations

import cocotb
import pytest
from cocotb.triggers import RisingEdge, with_timeout

from rtl.sources import configurations
from tb.lib.bench import Bench
from tb.lib.card import MS
from tb.lib.runner import run
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


@cocotb.test()
async def the_first_access_is_a_fetch_from_address_0(dut):
    """From any other place it would run what a frame has left there."""
    await Bench(dut, 1_000_000, bus_ready=0, bus_rdata=0).start()
    if not dut.bus_valid.value:
        await with_timeout(RisingEdge(dut.bus_valid), 1, "ms")
    assert dut.bus_addr.value == 0 and dut.bus_wstrb.value == 0


@pytest.mark.rule("SAFE-5")
@pytest.mark.parametrize("name", configurations())
def test_the_program_begins_at_address_0(name: str):
    core = configurations()[name]["soft_core_id"]
    run("soft_core", "tb.rtl.test_soft_core", sim="icarus", config=name, parameters={"SOFT_CORE": core})
