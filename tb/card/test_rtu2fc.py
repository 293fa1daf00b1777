# SPDX-License-Identifier: Apache-2.0
"""The whole card with its firmware: a Modbus master on one line, a drive on the other.

The examples are checked on both lines, byte for byte. The clock is slow, because
only times on the lines count there and every clock costs simulation time. `test_own_clock` runs the tests of
the firmware's speed at the card's own clock.
"""

import os

import cocotb
import pytest

from tb.agents import rtu
from tb.agents.fc_slave import Script
from tb.agents.modbus_master import Transaction
from tb.agents.uart import sleep_until
from tb.lib.card import MS, CardBench
from tb.lib.config import BROADCAST_MS, CLK_HZ, SLOW_HZ, own_hz
from tb.lib.runner import run
from tb.lib.supervision import control_pdu, process
from tb.model import fc_telegram
from tb.model.examples import EXAMPLES
from tb.model.lines import image_of
from tb.model.told import not_told

LOWEST_HZ = 2_000_000  # TOP-1
# 38400 bit/s save simulation time; a finished image without EXTENDED_SWITCHES gets a rate that it has.
BAUD = int(os.environ.get("CARD_BAUD", "38400"))
CHARACTER = 11  # bits
REPLY_WAIT = 2  # register 40003 in 10 ms, for tests with a silent drive
DEFAULT_WAIT = 15


class Scenario:
    """A booted card, the telegrams it is expected to send, and the steps of a test."""

    def __init__(self, dut, clk_hz: int = CLK_HZ, baud: int = BAUD, **settings):
        self.script = Script()
        self.card = CardBench(dut, clk_hz, self.script, baud=baud, **settings)
        self.master = self.card.master

    async def start(self) -> "Scenario":
        await self.card.boot()
        return self

    async def request(self, adu: bytes, exchanges=(), timeout_ms: float = 400) -> Transaction:
        """Sends a request and checks the exchanges (telegram, reply) that follow."""
        for telegram, reply in exchanges:
            self.script.expect(telegram, reply)
        done = await self.card.master.request(adu, timeout_ms * MS)
        self.script.check()
        return done

    async def ask(self, pdu: bytes, expected: bytes, exchanges=()) -> Transaction:
        """Sends a PDU to address 1 and checks the answer."""
        done = await self.request(rtu.build(1, pdu), exchanges)
        assert done.data == rtu.build(1, expected), f"{pdu.hex(' ')}: {done.reply}"
        return done

    async def set_register(self, register: int, value: int) -> None:
        pdu = rtu.write_register(register, value)
        await self.ask(pdu, pdu)

    async def write_control(self, control: int, reference: int, exchanges=None) -> Transaction:
        """Writes coils 1 to 32 in one request; the drive answers."""
        pdu = control_pdu(control, reference)
        return await self.ask(pdu, pdu[:5], exchanges or [process(control, reference)])

    async def read_control(self) -> bytes:
        done = await self.request(rtu.build(1, rtu.read_coils(0, 32)))
        assert not_told(self.card.told(), image_of(done.data)) == ""
        return rtu.parse(done.data).pdu[2:]

    def finish(self) -> None:
        self.script.check()
        self.card.check_lines()


def exchanges_of(example: dict) -> list[tuple[bytes, bytes | None]]:
    return [
        (bytes.fromhex(x["telegram"]), bytes.fromhex(x["reply"]) if x["reply"] else None)
        for x in example["drive"]
    ]


async def play(scene: Scenario, example: dict) -> None:
    """Plays one transaction of the examples, byte for byte on both lines."""
    wants_reply = example["reply"] is not None
    request = bytes.fromhex(example["request"])
    done = await scene.request(request, exchanges_of(example), 400 if wants_reply else BROADCAST_MS)
    expected = bytes.fromhex(example["reply"]) if wants_reply else None
    assert done.data == expected, f"{example['id']}: {done.reply}"


async def all_zero(scene: Scenario) -> None:
    """Sets the control image to 0 and the status word to 0607."""
    await scene.write_control(0, 0)


# State that an example assumes, in addition to its own "setup" and "after".
BEFORE = {
    "appA-fc01": all_zero,
    "appA-fc01-status": all_zero,
    "appA-fc05": all_zero,
    "appA-fc0f": all_zero,
    "ex4-write-104": lambda scene: scene.set_register(0, 0),
    "ex5-read-514": lambda scene: scene.set_register(0, 0),
    "appA-fc03": lambda scene: scene.set_register(0, 0),
    "refused-17": lambda scene: scene.ask(rtu.write_coil(64, False), rtu.write_coil(64, False)),
    "timeout-255": lambda scene: scene.set_register(2, REPLY_WAIT),
    "text-read-621": lambda scene: scene.set_register(2, DEFAULT_WAIT),
}


async def play_with_setup(scene: Scenario, name: str) -> None:
    example = EXAMPLES[name]
    if name in BEFORE:
        await BEFORE[name](scene)
    if "after" in example:
        await play(scene, EXAMPLES[example["after"]])
    for step in example.get("setup", []):
        await play(scene, {"id": f"{name}, setup", **step})
    await play(scene, example)


# ---------------------------------------------------------------- the examples


@cocotb.test()
async def every_example_is_right_byte_for_byte_on_both_lines(dut):
    scene = await Scenario(dut).start()
    assert len(EXAMPLES) >= 23
    for name in EXAMPLES:
        await play_with_setup(scene, name)
    scene.finish()
    dut._log.info("%d examples right", len(EXAMPLES))


# ---------------------------------------------------------------- the firmware's speed


@cocotb.test()
async def telegrams_wait_for_two_characters_of_silence_and_have_no_gaps(dut):
    """A foreign character on the drive line ends just when the telegram could have started."""
    scene = await Scenario(dut, baud=115_200).start()
    bit = scene.card.drive.fmt.bit_ps
    pdu = control_pdu(0x047C, 0x1999)
    for late_bits in (-6, 0, 6):
        scene.script.expect(*process(0x047C, 0x1999))
        request = await scene.master.send(rtu.build(1, pdu))
        await sleep_until(request.end_ps + rtu.t35_ps(115_200) + (late_bits - CHARACTER) * bit)
        noise = await scene.card.drive.source.send(b"\x55")
        await scene.card.drive.monitor.pin_idle(15 * MS)
        telegram = scene.card.slave.heard[-1].frame
        pause = (telegram.start_ps - noise.end_ps) / bit
        assert 2 * CHARACTER - 0.25 <= pause <= 2 * CHARACTER + 1, f"{pause:.2f} bits"
        assert telegram.largest_gap_ps < 0.02 * bit
    scene.finish()


@cocotb.test()
async def back_to_back_broadcast_writes_all_take_effect(dut):
    """Broadcasts get no reply, so the master leaves the firmware no more time than its own pause."""
    scene = await Scenario(dut, baud=115_200, form="8N1").start()
    telegram = fc_telegram.build_process(0x047C, 0x1999, fc_telegram.ADR_BROADCAST)
    scene.script.expect(telegram, None)
    for pdu in (
        rtu.write_registers(0, [1, 1234, 20]),
        rtu.write_coil(64, True),
        rtu.write_register(2, 30),
        control_pdu(0x047C, 0x1999),
    ):
        await scene.master.send(rtu.build(0, pdu))
    # The shortest possible frame, and it gets a reply; the telegram is still being sent.
    done = await scene.master.request(rtu.build(1, b"\x2b"), 30 * MS)
    assert done.data == rtu.build(1, rtu.exception(0x2B, 67)), done.reply
    await scene.card.drive.monitor.pin_idle(15 * MS)
    scene.script.check()
    await scene.ask(rtu.read_registers(0, 3), bytes.fromhex("03 06 00 01 04 D2 00 1E"))
    await scene.ask(rtu.read_coils(64, 1), bytes.fromhex("01 01 01"))
    assert await scene.read_control() == bytes.fromhex("7C 04 99 19")
    scene.finish()


# Tests of the firmware's speed, at 115200 bit/s.
QUICK = [
    "telegrams_wait_for_two_characters_of_silence_and_have_no_gaps",
    "back_to_back_broadcast_writes_all_take_effect",
]


def run_card(
    sim: str, config: str, testcase: list[str], clk_hz: int | None = None, **parameters: object
) -> None:
    run(
        "rtu2fc",
        "tb.card.test_rtu2fc",
        sim=sim,
        config=config,
        parameters={"CLK_HZ": clk_hz or SLOW_HZ[config], **parameters},
        testcase=testcase,
    )


@pytest.mark.nightly
@pytest.mark.rule(
    *("FC-1", "FC-2", "FC-3", "FC-4", "FC-5", "FC-6", "FC-7", "FC-9", "MAP-3", "MAP-9", "EXC", "TOP-2")
)
def test_examples(sim, config):
    """At the slowest clock: no example depends on time."""
    run_card(sim, config, ["every_example_is_right_byte_for_byte_on_both_lines"], LOWEST_HZ)


@pytest.mark.rule("FC-8", "FRAME-6", "MAP-9")
def test_telegrams_leave_in_time():
    """The standard card; the tiny card runs this at its own clock in `test_own_clock`."""
    run_card("verilator", "standard", QUICK, 2 * SLOW_HZ["standard"])


@pytest.mark.nightly
@pytest.mark.rule("FC-8", "FRAME-6", "MAP-9", "TOP-2")
def test_own_clock(config):
    """On Verilator only: so many clocks take minutes on Icarus, and both agree at a slow clock."""
    run_card("verilator", config, QUICK, own_hz(config))
