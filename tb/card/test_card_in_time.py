# SPDX-License-Identifier: Apache-2.0
"""The slowest requests of each kind: reply or telegram starts in time, at the card's clock (PERF-1, PERF-2).

The small card has a slow soft core: a write of a text needs nearly all of t3.5. The rates above 19200 bit/s
have the least time: t3.5 is fixed there, and preparation begins after half a character. The firmware meets
each request at another place of its poll loop.
"""

from __future__ import annotations

import pytest

from tb.agents import rtu
from tb.lib.card import MS
from tb.lib.config import own_hz
from tb.lib.fast_card import FastCard
from tb.model.vlt_drive import VltDrive

DRIVE_BIT_PS = 1e12 / 9600
# DE may lead t3.5 by this: the receiver sees the end of the frame in the middle of its stop bit.
EARLY_BITS = 0.5
TEXT = "10 14D1 000A 14 4142434445464748494A4B4C4D4E4F5051525354"
LOCAL = {
    "128 coils": "01 0000 0080",
    "three registers": "10 0000 0003 06 0000 03E8 000F",
    "no function": "07",
}
# The longest reply, after t3.5.
LOCAL_BITS, EXCHANGE_MS = 35 * 11, 100
TELEGRAMS = {
    "32 coils": "0F 0000 0020 04 7C04 9919",
    "a parameter": "06 0801 1234",
    "two registers": "10 0801 0002 04 0000 1234",
    "two registers read": "03 1413 0002",
    "a text": TEXT,
}
RATES = [(115_200, "8N1"), (38_400, "8E1"), (19_200, "8O1"), (9_600, "8N2"), (4_800, "8E1")]


# The small card is simulated slowly. CI tries its fastest and its slowest rate.
CASES = [
    pytest.param(*rate, card, marks=[pytest.mark.nightly] * (card == "tiny" and rate in RATES[1:-1]))
    for card in ("tiny", "standard")
    for rate in RATES
]


def lateness(card: FastCard, baud: int, pdu: str, line: str, wait_ms: int, phases: int) -> list[float]:
    """Time in ps from t3.5 after the request to the first start bit, for requests at different moments."""
    found, output = [], f"{line}_tx"
    for phase in range(phases):
        card.run(3 + 0.37 * phase)
        before = len(card.recorded[output])
        end = card.modbus.send(rtu.build(1, bytes.fromhex(pdu)), rtu.t35_ps(baud) + 5 * MS)
        card.run_until(end + wait_ms * MS)
        falls = [at for at, level in card.recorded[output][before:] if not level]
        assert falls, f"{pdu}: nothing left"
        found.append(falls[0] - end - rtu.t35_ps(baud))
    return found


def check(
    config: str, baud: int, form: str, local: dict[str, str], telegrams: dict[str, str], phases: int
) -> None:
    drive = VltDrive(example=True)
    with FastCard(baud=baud, form=form, config=config, clk_hz=own_hz(config), drive=drive.telegram) as card:
        card.run(card.boot_ms)
        bit = 1e12 / baud
        for name, pdu in local.items():
            late = lateness(card, baud, pdu, "modbus", (LOCAL_BITS * bit + rtu.t35_ps(baud)) / MS, phases)
            assert max(late) <= bit and min(late) >= -EARLY_BITS * bit, f"{name}: {late} ps"
        assert card.request(rtu.build(1, rtu.write_register(0, 0x0500))), "the index of texts"
        for name, pdu in telegrams.items():
            late = lateness(card, baud, pdu, "drive", EXCHANGE_MS, phases)
            assert max(late) <= DRIVE_BIT_PS and min(late) >= -EARLY_BITS * bit, f"{name}: {late} ps"


@pytest.mark.rule("PERF-1", "PERF-2", "FRAME-8")
def test_the_small_card_is_in_time_with_its_two_slowest_requests():
    slowest = "128 coils", "a text"
    check(
        "tiny",
        115_200,
        "8N1",
        *({name: kind[name]} for name, kind in zip(slowest, (LOCAL, TELEGRAMS), strict=True)),
        8,
    )


@pytest.mark.nightly
@pytest.mark.rule("PERF-1", "PERF-2", "FRAME-8")
@pytest.mark.parametrize(("baud", "form", "card_config"), CASES)
def test_requests_of_all_kinds_are_in_time(baud, form, card_config):
    check(card_config, baud, form, LOCAL, TELEGRAMS, 4)
