# SPDX-License-Identifier: Apache-2.0
"""The whole card with the firmware of each further dialect: the documents' examples on both lines.

Every frame is written in full, with its CRC or BCC. `S2` and `S3` as in test_firmware_dialects.py.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import cocotb
import pytest

from regs.dialects import STANDARD
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
IN_BOTH = [
    Example(
        "start, 40 % speed",
        "01 0F 00 00 00 20 04 7C 04 99 19 37 43",
        "01 0F 00 00 00 20 54 13",
        (("02 06 81 04 7C 19 99 7D", "02 06 81 06 07 20 00 A4"),),
    ),
    Example(
        "S3: read coils 33-48, the status word, which the drive is asked for",
        "01 01 00 20 00 10 3C 0C",
        "01 01 02 07 06 3B CE",
        (("02 06 81 00 00 00 00 85", "02 06 81 06 07 00 00 84"),),
    ),
    Example(
        "S2: write 105 by 10",
        "01 10 04 19 00 02 04 00 00 02 E2 81 20",
        "01 10 04 19 00 02 91 3F",
        (
            (
                "02 0E 81 30 69 00 00 00 00 02 E2 00 00 00 00 34",
                "02 0E 81 20 69 00 00 00 00 02 E2 06 07 00 00 25",
            ),
        ),
    ),
    Example("S3: force coil 65", "01 05 00 40 FF 00 8D EE", "01 05 00 40 FF 00 8D EE"),
    Example(
        "then 104 goes to the EEPROM",
        "01 06 04 0F 00 3C B8 E8",
        "01 06 04 0F 00 3C B8 E8",
        (
            (
                "02 0E 81 E0 68 00 00 00 00 00 3C 00 00 00 00 39",
                "02 0E 81 10 68 00 00 00 00 00 3C 06 07 00 00 C8",
            ),
        ),
    ),
    TEXT_OF_2,
    Example(
        "S3: a text of 10 registers",
        "01 03 18 41 00 0A 93 79",
        "01 03 14 56 4C 54 20 48 56 41 43 20 42 61 73 69 63 20 44 72 69 76 65 41 E8",
        (
            (
                ASK_TEXT,
                "02 1E 81 F2 6D 04 00 56 4C 54 20 48 56 41 43 20"
                " 42 61 73 69 63 20 44 72 69 76 65 06 07 00 00 63",
            ),
        ),
    ),
    Example("S2: index 8 to register 9", "01 06 00 08 00 08 09 CE", "01 06 00 08 00 08 09 CE"),
    Example(
        "S2: then 609",
        "01 03 17 C9 00 01 51 80",
        "01 03 02 00 19 79 8E",
        (
            (
                "02 0E 81 12 61 00 08 00 00 00 00 00 00 00 00 F6",
                "02 0E 81 12 61 00 08 00 00 00 19 06 07 00 00 EE",
            ),
        ),
    ),
]
REFUSED_6 = (
    (
        "02 0E 81 12 61 00 08 00 00 00 00 00 00 00 00 F6",
        "02 0E 81 72 61 00 08 00 00 00 06 06 07 00 00 91",
    ),
)
IN_ONE = {
    "builtin": [
        Example(
            "a fault that the card's manual does not know",
            "01 03 17 C9 00 01 51 80",
            "01 83 06 C1 32",
            REFUSED_6,
        ),
        Example("no parameter starts there", "01 03 18 42 00 01 22 BE", "01 83 40 40 C0"),
        Example("a coil neither on nor off", "01 05 00 00 12 34 C0 BD", "01 85 42 C2 A1"),
        Example("parameter 4095", "01 03 9F F5 00 01 BA 2C", "01 83 40 40 C0"),
    ],
    STANDARD: [
        Example("an access that the drive refuses", "01 03 17 C9 00 01 51 80", "01 83 04 40 F3", REFUSED_6),
        Example("no parameter starts there", "01 03 18 42 00 01 22 BE", "01 83 02 C0 F1"),
        Example("a coil neither on nor off", "01 05 00 00 12 34 C0 BD", "01 85 03 02 91"),
        Example(
            "parameter 4095",
            "01 03 9F F5 00 01 BA 2C",
            "01 03 02 00 2A 39 9B",
            # The index remains until it is written again.
            (
                (
                    "02 0E 81 1F FF 00 08 00 00 00 00 00 00 00 00 65",
                    "02 0E 81 1F FF 00 08 00 00 00 2A 06 07 00 00 4E",
                ),
            ),
        ),
    ],
}


async def play(scene: Scenario, example: Example) -> None:
    exchanges = [(H(telegram), reply and H(reply)) for telegram, reply in example.exchanges]
    done = await scene.request(H(example.request), exchanges)
    assert done.data == H(example.reply), f"{example.what}: {done.reply}"


@cocotb.test()
async def examples_of_the_documents_are_right_on_both_lines(dut):
    scene = await Scenario(dut).start()
    # The text example runs before the index is set, so its telegram carries index 0.
    for example in [*IN_BOTH, *IN_ONE[os.environ["DIALECT"]]]:
        await play(scene, example)
    scene.finish()


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
    await play(scene, IN_BOTH[0])
    scene.finish()


@cocotb.test()
async def newer_request_replaces_the_second_exchange(dut):
    scene = await Scenario(dut).start()
    scene.script.expect(H(ASK_NUMBER), H(NO_NUMBER))
    # The master sends its next request while the drive still answers: 16 + 16 characters take 37 ms.
    done = await scene.master.request(H("01 03 18 41 00 02 92 BF"), 25_000_000_000)
    assert done.data is None
    await play(scene, IN_BOTH[0])
    scene.finish()


def run_card(sim: str, config: str, dialect: str, testcase: list[str]) -> None:
    run(
        "rtu2fc",
        "tb.card.test_rtu2fc_dialects",
        sim=sim,
        config=config,
        parameters={
            "CLK_HZ": SLOW_HZ[config],
            "FIRMWARE_HEX": str(build(f"build/{dialect}/firmware.hex")),
        },
        testcase=testcase,
        extra_env={"DIALECT": dialect},
    )


# The images of these dialects do not fit the small card (docs/guide/dialects.md).
pytestmark = pytest.mark.parametrize("config", ["standard"])
spoken_in_each = pytest.mark.parametrize(
    "dialect",
    [
        pytest.param("builtin", marks=pytest.mark.rule("DIALECT-BUILTIN")),
        pytest.param(STANDARD, marks=pytest.mark.rule("DIALECT-HVAC-BASIC")),
    ],
)


@pytest.mark.nightly
@pytest.mark.rule("FC-8", "FRAME-7")
@pytest.mark.rule("DIALECT-BUILTIN")
def test_second_exchange(sim: str, config: str):
    """In one dialect only: the code for the second exchange is common to both."""
    testcase = ["one_request_causes_two_exchanges", "newer_request_replaces_the_second_exchange"]
    run_card(sim, config, "builtin", testcase)


@pytest.mark.nightly
@pytest.mark.rule("FC-9")
@spoken_in_each
def test_documents(config: str, dialect: str):
    """On Verilator only: more than a second on the lines takes minutes on Icarus.

    `make test` has these documents on the virtual card (sim/card/test_documents.py).
    """
    run_card(
        "verilator",
        config,
        dialect,
        ["examples_of_the_documents_are_right_on_both_lines", "card_stays_silent_when_the_drive_is_silent"],
    )
