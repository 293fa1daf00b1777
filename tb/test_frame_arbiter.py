# SPDX-License-Identifier: Apache-2.0
"""frame_arbiter: one winner a clock, the lines first, everybody's own address and data."""

import cocotb
import pytest
from cocotb.triggers import Timer

from tb.lib.runner import run
from tb.lib.seeds import seeded

RANK = ("modbus", "drive", "count", "cpu")


def address(side: str, kind: str) -> str:
    return f"{side}_{kind}_addr" if side in ("modbus", "drive") else f"{side}_addr"


async def check(dut, rng, asking: dict[str, set[str]]) -> None:
    """Who asks, by kind of access; checks who is served and with what."""
    given = {}
    for kind in ("write", "read"):
        for side in RANK:
            getattr(dut, f"{side}_{kind}_valid").value = int(side in asking[kind])
            given[address(side, kind)] = rng.getrandbits(8)
            given[f"{side}_write_data"] = rng.getrandbits(8)
    for name, value in given.items():
        getattr(dut, name).value = value
    await Timer(10, unit="ns")
    for kind in ("write", "read"):
        winner = next((side for side in RANK if side in asking[kind]), None)
        ready = {side for side in RANK if int(getattr(dut, f"{side}_{kind}_ready").value)}
        assert ready == ({winner} if winner else set()), kind
        if winner:
            assert int(getattr(dut, f"{kind}_addr").value) == given[address(winner, kind)]
        if winner and kind == "write":
            assert int(dut.write_data.value) == given[f"{winner}_write_data"]
    assert int(dut.write_enable.value) == bool(asking["write"])


@cocotb.test()
async def every_set_of_askers_has_one_winner(dut):
    rng = seeded("askers")
    sets = [{side for n, side in enumerate(RANK) if bits >> n & 1} for bits in range(16)]
    for writers in sets:
        for readers in sets:
            await check(dut, rng, {"write": writers, "read": readers})


@pytest.mark.rule("FRAME-5")
def test_frame_arbiter(sim):
    run("frame_arbiter", "tb.test_frame_arbiter", sim=sim)
