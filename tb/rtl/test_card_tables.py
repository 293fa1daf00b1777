# SPDX-License-Identifier: Apache-2.0
"""card_tables: every pattern of switches 1 to 5 against the tables of the source, for both kinds of card."""

from __future__ import annotations

import os

import cocotb
import pytest
from cocotb.triggers import Timer

from regs.generated.card_tables import (
    EXTENDED_FORMATS,
    EXTENDED_RATES,
    FORMATS,
    RATES,
    SILENCE_START,
    SILENCES,
)
from tb.lib.runner import run


@cocotb.test
async def every_switch_pattern_selects_its_table_entry(dut):
    extended = os.environ["EXTENDED"] == "1"
    rates, formats = (EXTENDED_RATES, EXTENDED_FORMATS) if extended else (RATES, FORMATS)
    for bits in range(32):
        switches = f"{bits:05b}"[::-1]
        dut.sw_baud.value = bits
        await Timer(1, unit="ns")
        rate, entry = rates[switches[:3]], formats[switches[3:]]
        silences = SILENCES[rate.baud, entry.character_bits]
        shown = [
            dut.baud_undivided,
            dut.baud_mask,
            dut.half_end,
            dut.half_uneven,
            dut.parity_enable,
            dut.parity_odd,
            dut.two_stop,
        ]
        wanted = [rate.ratio == 1, rate.mask, SILENCE_START + silences.half_ticks - 1, silences.half_uneven]
        wanted += [entry.parity != "none", entry.parity == "odd", entry.stop_bits == 2]
        assert [int(signal.value) for signal in shown] == wanted, f"switches {switches}"


@pytest.mark.rule("LINE-1", "LINE-2", "LINE-3", "FRAME-1")
@pytest.mark.parametrize("extended", [0, 1])
def test_card_tables(sim, extended):
    run(
        "card_tables",
        __name__,
        sim=sim,
        parameters={"EXTENDED_SWITCHES": extended},
        extra_env={"EXTENDED": str(extended)},
    )
