# SPDX-License-Identifier: Apache-2.0
"""The whole card in a dialect without IND: a text of two registers takes two exchanges.

Every frame is written in full, with its CRC or BCC. sim/card/test_documents.py has the documents' examples.
"""

from __future__ import annotations

from dataclasses import dataclass

import cocotb
import pytest

from tb.card.test_rtu2fc import WAIT_MS, Scenario
from tb.lib.config import SLOW_HZ
from tb.lib.runner import run
from tb.model.firmware import build

H = bytes.fromhex
NO_NUMBER = "02 0E 81 72 6D 00 00 00 00 00 05 06 07 00 00 96"
ASK_NUMBER = "02 0E 81 12 6D 00 00 00 00 00 00 00 00 00 00 F2"
ASK_TEXT = "02 0E 81 F2 6D 04 00 00 00 00 00 00 00 00 00 16"


@dataclass(frozen=True)
class Example:
    what: str
    request: str
    reply: str | None
    exchanges: tuple[tuple[str, str | None], ...] = ()


TEXT_OF_2 = Example(
    "a text of 2 registers: as a number, then as a text",
    "01 03 18 41 00 02 92 BF",
    "01 03 04 56 4C 54 20 15 74",
    ((ASK_NUMBER, NO_NUMBER), (ASK_TEXT, "02 0D 81 F2 6D 04 00 56 4C 54 06 07 00 00 5A")),
)
START = Example(
    "start, 40 % speed",
    "01 0F 00 00 00 20 04 7C 04 99 19 37 43",
    "01 0F 00 00 00 20 54 13",
    (("02 06 81 04 7C 19 99 7D", "02 06 81 06 07 20 00 A4"),),
)


async def play(scene: Scenario, example: Example) -> None:
    exchanges = [(H(telegram), reply and H(reply)) for telegram, reply in example.exchanges]
    done = await scene.request(H(example.request), exchanges)
    assert done.data == H(example.reply), f"{example.what}: {done.reply}"


@cocotb.test()
async def one_request_causes_two_exchanges(dut):
    scene = await Scenario(dut).start()
    await play(scene, TEXT_OF_2)
    scene.finish()


@cocotb.test()
async def card_stays_silent_when_the_drive_is_silent(dut):
    scene = await Scenario(dut).start()
    await scene.set_register(2, WAIT_MS // 10)
    for exchanges in (
        [(H(ASK_NUMBER), None)] * 2,
        [(H(ASK_NUMBER), H(NO_NUMBER)), (H(ASK_TEXT), None), (H(ASK_TEXT), None)],
    ):
        done = await scene.request(H("01 03 18 41 00 02 92 BF"), exchanges, 200)
        assert done.data is None
    await play(scene, START)
    scene.finish()


@cocotb.test()
async def newer_request_replaces_the_second_exchange(dut):
    scene = await Scenario(dut).start()
    scene.script.expect(H(ASK_NUMBER), H(NO_NUMBER))
    # The master sends its next request while the drive still answers: 16 + 16 characters take 37 ms.
    done = await scene.master.request(H("01 03 18 41 00 02 92 BF"), 25_000_000_000)
    assert done.data is None
    await play(scene, START)
    scene.finish()


@pytest.mark.nightly
@pytest.mark.rule("DIALECT-BUILTIN", "FC-8", "FC-9", "FRAME-7")
# The images of these dialects do not fit the small card (docs/guide/dialects.md).
@pytest.mark.parametrize("config", ["standard"])
def test_second_exchange(sim: str, config: str):
    """In one dialect only: the code for the second exchange is common to both."""
    run(
        "rtu2fc",
        "tb.card.test_rtu2fc_dialects",
        sim=sim,
        config=config,
        parameters={
            "CLK_HZ": SLOW_HZ[config],
            "FIRMWARE_HEX": str(build("build/builtin/firmware.hex")),
        },
    )
