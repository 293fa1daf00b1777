# SPDX-License-Identifier: Apache-2.0
"""Committed writes that wait for a running exchange or a busy line, at the pins (FRAME-7, FC-9).

The poll loop is tested alone in each order of requests (tb/firmware/test_firmware_gateway.py).
"""

from __future__ import annotations

import pytest

from sw.tools.stack import symbols
from tb.agents import rtu
from tb.lib.card import MS
from tb.lib.config import own_hz
from tb.lib.fast_card import FastCard
from tb.lib.nightly import first
from tb.model.fc_telegram import bcc

READ = rtu.build(1, rtu.read_registers(5139, 2))
ASKED, BROADCAST = 0x81, 0x80
GIVE_UP_MS = 150
# The ticks of the firmware's clock, its rounds, and the t3.5 of the network line.
MARGIN_MS = 4.0


def coils(control: int, unit: int) -> bytes:
    return rtu.build(unit, rtu.write_coils(0, [bool(control >> i & 1) for i in range(16)]))


def sent(card: FastCard) -> list[bytes]:
    return [frame.data for frame in card.drive.frames()]


def process(control: int, adr: int) -> bytes:
    """The beginning of the telegram of a write of coils, up to the control word."""
    return bytes([0x02, 0x06, adr]) + control.to_bytes(2, "big")


def clock(config: str) -> int | None:
    """The small card's firmware needs its own clock at this rate; the standard card's does not."""
    return own_hz(config) if config == "tiny" else None


def finish(card: FastCard, requests: list[bytes]) -> int:
    """Sends the requests one after the other without waiting; returns the end of the last."""
    gap = 1.2 * rtu.t35_ps(card.modbus.fmt.baud)
    return [card.modbus.send(request, gap) for request in requests][-1]


def parameter(value: int, unit: int) -> bytes:
    return rtu.build(unit, rtu.write_register(2049, value))


def parameter_writes(telegrams: list[bytes]) -> list[tuple[int, int]]:
    """Address and value of each, without repeats."""
    writes = [data for data in telegrams if data[1] == 14 and data[3] >> 4 == 2]
    return list(dict.fromkeys((data[2], int.from_bytes(data[9:11], "big")) for data in writes))


WRITE, BROADCAST_WRITE, STOP = parameter(7, 1), parameter(7, 0), coils(0x043C, 1)
# What an impatient master has given up, and what it asks then.
HELD_UP = [(WRITE, READ), (BROADCAST_WRITE, WRITE), (READ, STOP), (STOP, READ)]


@pytest.mark.rule("FC-9", "FRAME-7", "EXC")
@pytest.mark.parametrize("config", first(["standard", "tiny"]))
def test_a_jammed_drive_line_leaves_no_request_without_its_answer(config: str):
    """Something on the drive line sends without end; when it stops, the committed writes leave (FRAME-7)."""
    with FastCard(baud=19_200, config=config, clk_hz=clock(config)) as card:
        card.run(card.boot_ms)
        free = card.drive.send(bytes([0x55]) * (len(HELD_UP) * (2 * GIVE_UP_MS + 100)))
        card.run(5)
        for given_up, asked in HELD_UP:
            finish(card, [given_up])
            card.run(40)
            answer = card.request(asked, 2 * GIVE_UP_MS + MARGIN_MS)
            assert answer and answer.data[1:3] == bytes([0x80 | asked[1], 255]), (given_up.hex(), asked.hex())
        assert not sent(card) and card.now_ps < free
        card.run_until(free + 500 * MS)
        assert parameter_writes(sent(card)) == [(BROADCAST, 7), (ASKED, 7)]
        assert sent(card)[0][:5] == process(0x043C, ASKED)


# ---------------------------------------------------------------- a bite in the middle of a telegram


@pytest.mark.nightly
@pytest.mark.rule("WDG-1", "FRAME-7")
@pytest.mark.parametrize("bitten_ms", [1, 5, 12])
def test_a_write_after_a_bite_follows_the_telegram_on_the_line(bitten_ms: float):
    """A text write takes 39 ms on the drive line. Damaged variables restart the firmware meanwhile, and the
    master sends a new command at once."""
    text = rtu.build(1, rtu.write_registers(5329, [0x4142] * 10))
    with FastCard(baud=115_200, clk_hz=own_hz("standard"), extra="flips") as card:
        card.run(card.boot_ms)
        assert card.request(rtu.build(1, bytes.fromhex("06 0000 0500")))
        card.modbus.send(text, 5 * MS)
        assert card.run_until(card.now_ps + 30 * MS, "drive_de")
        card.run(bitten_ms)
        variables = symbols()["_bss_start"] // 4
        for word in range(variables, variables + 60):
            card.flip("ram_i.g_bank[0].g_part.bank_i.words", word, 0)
        card.run(card.boot_ms)
        assert card.drive.driven, "the old telegram is still on the line"
        card.modbus.send(coils(0x047C, 1), 5 * MS)
        card.run(100)
        old, new = sent(card)[:2]
        assert old[:3] == bytes.fromhex("02 1E 81") and len(old) == 32 and bcc(old) == 0, "it was not touched"
        assert new[:5] == process(0x047C, ASKED) and bcc(new) == 0, "and the new one follows"
