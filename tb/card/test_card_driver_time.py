# SPDX-License-Identifier: Apache-2.0
"""Each line has its own time limit for its driver, and no good frame reaches it (SAFE-2), at the pins."""

from __future__ import annotations

import pytest

from tb.agents import rtu
from tb.lib.card import MS
from tb.lib.fast_card import FastCard
from tb.model.fc_telegram import bcc

LOCAL = rtu.build(1, rtu.read_registers(0, 3))
READ_128_COILS = rtu.build(1, rtu.read_coils(0, 128))
BROADCAST = rtu.build(0, rtu.write_coils(0, [bool(0x043C >> i & 1) for i in range(16)]))
TELEGRAM = bytes.fromhex("02 06 80 043C 0000")
# The drive's limit: 14 beats of 32 bits at 9600 bit/s.
DRIVE_LIMIT_MS = 14 * 32 / 9.6


@pytest.mark.rule("SAFE-2", "FC-8")
def test_a_long_reply_takes_no_time_from_a_telegram(config: str):
    """The telegram ends later after the reply's first bit than the drive's driver may be on.

    It waits that long for the drive line, on which somebody else sends.
    """
    with FastCard(baud=2400, config=config) as card:
        card.run(card.boot_ms)
        end = card.modbus.send(BROADCAST)
        begin = card.modbus.send(READ_128_COILS, 1.02 * rtu.t35_ps(2400)) + rtu.t35_ps(2400)
        card.run_until(end)
        busy = int((begin + DRIVE_LIMIT_MS * MS - end) / card.drive.fmt.character_ps)
        card.drive.send(bytes(busy))
        card.run_until(begin + 200 * MS)
        (reply,), (telegram,) = card.modbus.frames(), card.drive.frames()
        assert reply.ok and len(reply.data) == 3 + 16 + 2
        assert telegram.ok and telegram.data == TELEGRAM + bytes([bcc(TELEGRAM)])
        assert reply.start_ps + DRIVE_LIMIT_MS * MS < telegram.end_ps < reply.end_ps


@pytest.mark.rule("SAFE-2", "LINE-2")
def test_the_limit_of_the_network_line_is_by_its_own_rate(config: str):
    """At 300 bit/s a reply lasts eight times as long as the drive's driver may be on."""
    with FastCard(baud=300, config=config) as card:
        card.run(card.boot_ms)
        reply = card.request(LOCAL, timeout_ms=2000)
        assert reply.ok and reply.data == rtu.build(1, bytes.fromhex("03 06 0000 03E8 000F"))
        assert reply.end_ps - reply.start_ps > 8 * DRIVE_LIMIT_MS * MS
