# SPDX-License-Identifier: Apache-2.0
"""Rate and format by switches 1 to 5, at the pins of the whole card, for both kinds of card.

With EXTENDED_SWITCHES = 0 an owner may copy every position of the old card. With 1 three positions have other
meanings, and a character of 8N1 is 10 bits.
"""

from __future__ import annotations

import pytest

from tb.agents import rtu
from tb.lib.card import MS
from tb.lib.fast_card import FastCard

OLD, EXTENDED = (("EXTENDED_SWITCHES", 0),), (("EXTENDED_SWITCHES", 1),)
REQUEST = rtu.build(1, rtu.read_registers(2, 1))
REPLY = rtu.build(1, bytes.fromhex("03 02 00 0F"))
# FRAME-1: a quarter of a bit either way.
SURE_BITS = 0.3

# Switches 1 to 5, first switch first, with rate and format: manual MG.10.P2.22 p7.
RATES = {"000": 300, "001": 1200, "010": 2400, "011": 4800, "111": 9600, "101": 19_200}
RATES |= {"100": 9600, "110": 9600}
FORMATS = {"11": "8N2", "10": "8N2", "01": "8O1", "00": "8E1"}
EXTENDED_RATES = RATES | {"100": 38_400, "110": 115_200}
EXTENDED_FORMATS = FORMATS | {"10": "8N1"}
# Each rate and each format of the table.
AT_OLD = [(rate + "11", RATES[rate], "8N2") for rate in RATES]
AT_OLD += [("111" + form, 9600, FORMATS[form]) for form in FORMATS]
AT_OLD += [("10010", 9600, "8N2"), ("11010", 9600, "8N2")]
AT_EXTENDED = [(rate + "11", EXTENDED_RATES[rate], "8N2") for rate in ("100", "110", "111", "101")]
AT_EXTENDED += [("111" + form, 9600, EXTENDED_FORMATS[form]) for form in EXTENDED_FORMATS]
AT_EXTENDED += [("10010", 38_400, "8N1"), ("11010", 115_200, "8N1")]


def check_answer(card: FastCard) -> None:
    """The reply comes after t3.5, at the rate and with the stop bits of the master."""
    fmt = card.modbus.fmt
    t35_ps = rtu.t35_ps(fmt.baud, fmt.bits)
    card.run_until(card.boot_ms * MS + 1.1 * t35_ps)
    end = card.modbus.send(REQUEST)
    frame = card.next_frame(card.modbus, end + 2 * t35_ps + 100 * fmt.bit_ps)
    assert frame is not None and frame.ok and frame.data == REPLY, f"{fmt}: {frame}"
    starts = [c.start_ps for c in frame.characters]
    character = (starts[-1] - starts[0]) / (len(starts) - 1) / fmt.bit_ps
    assert character == pytest.approx(fmt.bits, abs=0.05), f"{character:.2f} bits a character"
    late_bits = (starts[0] - end - t35_ps) / fmt.bit_ps
    assert -SURE_BITS <= late_bits <= 1 + SURE_BITS, f"a reply {late_bits:.2f} bits after t3.5"


@pytest.mark.rule("LINE-2", "LINE-3")
@pytest.mark.parametrize(("switches", "baud", "form"), AT_OLD)
def test_every_position_of_the_old_card_is_answered(switches, baud, form):
    with FastCard(switches + "0000", baud, form, parameters=OLD) as card:
        check_answer(card)


@pytest.mark.rule("LINE-2", "LINE-3", "FRAME-1", "FRAME-8")
@pytest.mark.parametrize(("switches", "baud", "form"), AT_EXTENDED)
def test_every_position_with_extended_switches_is_answered(switches, baud, form):
    clk_hz = 64 * 115_200 if baud == 115_200 else None
    with FastCard(switches + "0000", baud, form, clk_hz=clk_hz, parameters=EXTENDED) as card:
        check_answer(card)
