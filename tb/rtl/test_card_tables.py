# SPDX-License-Identifier: Apache-2.0
"""card_tables: every pattern of switches 1 to 5 against the tables of the source."""

from __future__ import annotations

import cocotb
import pytest
from cocotb.triggers import Timer

from regs.generated.card_tables import FORMATS, RATES, SILENCE_START
from tb.lib.fields import Fields
from tb.lib.runner import run


@cocotb.test
async def every_switch_pattern_selects_its_table_entry(dut):
    for bits in range(32):
        switches = f"{bits:05b}"[::-1]
        dut.sw_baud.value = bits
        await Timer(1, unit="ns")
        rate, entry = RATES[switches[:3]], FORMATS[switches[3:]]
        pins = Fields(dut, line="line")
        shown = [
            pins.baud_undivided,
            pins.baud_mask,
            pins.line_half_end,
            pins.line_half_uneven,
            pins.line_parity_enable,
            pins.line_parity_odd,
            pins.line_two_stop,
        ]
        wanted = [rate.ratio == 1, rate.mask, SILENCE_START + rate.half_ticks - 1, rate.half_uneven]
        wanted += [entry.parity != "none", entry.parity == "odd", entry.stop_bits == 2]
        assert [int(signal.value) for signal in shown] == wanted, f"switches {switches}"


@pytest.mark.rule("LINE-1", "LINE-2", "LINE-3", "FRAME-1")
def test_card_tables(sim):
    run("card_tables", __name__, sim=sim)
