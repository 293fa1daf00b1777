# SPDX-License-Identifier: Apache-2.0
"""docs/example/modbus_slave.v and slave_top.v at their pins: every request against a model of its registers.

Times on the line are in bits, silences in the characters of FRAME-1.
"""

from __future__ import annotations

import random
import subprocess

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, ValueChange

from rtl.sources import needed_files
from tb.agents import edges, rtu
from tb.agents.modbus_master import ModbusMaster
from tb.agents.uart import Flaws, Format, now_ps
from tb.lib.bench import Bench, clock_period_ps
from tb.lib.line_tap import RecordedLine
from tb.lib.nightly import on_verilator
from tb.lib.runner import ROOT, run
from tb.lib.seeds import seeded
from tb.rtl.test_parameters import TOOLS, elaboration

SLAVE = ROOT / "docs/example/modbus_slave.v"
# Slow, to save simulation time.
CLK_HZ = {19_200: 500_000, 38_400: 2_500_000, 115_200: 4_000_000}
SLOWEST_HZ = 16 * 19_200  # one clock a tick
FORMS = ("8N2", "8O1", "8E1", "8N1")  # by PARITY
UNIT = 1
COUNT = 8
MOST = 12  # registers of a request
DELAY_MS = 5
REQUESTS = 10


class Slave:
    """The registers, and the reply to each request."""

    def __init__(self, count: int) -> None:
        self.registers = [0] * count

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
        if first + (1 if code == rtu.WRITE_REGISTER else number) > len(self.registers):
            return rtu.exception(code, 2)
        if code != rtu.WRITE_REGISTER and number > MOST:
            return rtu.exception(code, 3)
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
    """The slave with its line, a master, and the registers of its design."""

    def __init__(self, dut):
        self.dut = dut
        self.baud = int(dut.BAUD.value)
        self.bench = Bench(dut, int(dut.CLK_HZ.value), regs_rdata=0)
        form = Format.named(self.baud, FORMS[int(dut.PARITY.value)])
        self.line = RecordedLine(dut.rx, dut.tx, dut.de, form)
        self.master = ModbusMaster(self.line)
        self.registers = [0] * int(dut.REGISTERS.value)
        self.model = Slave(len(self.registers))
        self.longest_ps = 2 * rtu.t35_ps(self.baud) + int(dut.REPLY_DELAY.value) * 1e9
        self.changed_ps: list[int] = []
        self.synchronous = False  # the registers lie in a memory that answers in the next clock

    async def start(self) -> Example:
        await self.bench.start()
        await self.silence()
        cocotb.start_soon(self._read())
        cocotb.start_soon(self._write())
        return self

    async def _read(self) -> None:
        while True:
            await ValueChange(self.dut.regs_addr)
            if self.synchronous:
                await RisingEdge(self.dut.clk)
            address = self.dut.regs_addr.value
            known = address.is_resolvable and int(address) < len(self.registers)
            self.dut.regs_rdata.value = self.registers[int(address)] if known else 0xDEAD

    async def _write(self) -> None:
        while True:
            await RisingEdge(self.dut.regs_write)
            await FallingEdge(self.dut.clk)
            while self.dut.regs_write.value == 1:
                self.registers[int(self.dut.regs_addr.value)] = int(self.dut.regs_wdata.value)
                self.changed_ps.append(now_ps())
                await FallingEdge(self.dut.clk)

    async def silence(self) -> None:
        await self.line.source.idle(1.1 * self.t35_bits)

    @property
    def t35_bits(self) -> float:
        return rtu.t35_ps(self.baud, self.line.fmt.bits) / self.line.fmt.bit_ps

    async def asks(self, pdu: bytes) -> None:
        """Compares the reply and the registers with the model."""
        found = await self.master.ask(UNIT, pdu, self.longest_ps)
        wanted = self.model.reply(pdu)
        assert found == wanted, f"{pdu.hex(' ')}: {found and found.hex(' ')} instead of {wanted.hex(' ')}"
        assert self.registers == self.model.registers, pdu.hex(" ")

    async def ignores(self, adu: bytes, flaws: Flaws | None = None) -> None:
        """A frame without a reply that leaves the registers as the model has them."""
        assert (await self.master.request(adu, self.longest_ps, flaws)).reply is None
        assert self.registers == self.model.registers, adu.hex(" ")


def some_request(rng: random.Random, count: int) -> bytes:
    first = rng.choice((rng.randrange(count), count, 0xFFFF))
    number = rng.randint(1, min(count, MOST + 1))
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
    for request in range(REQUESTS):
        example.synchronous = request % 2 == 1
        await example.asks(some_request(rng, len(example.registers)))
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
        b"\x7f",
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
async def a_write_takes_a_clock_a_register_after_t35(dut):
    example = await Example(dut).start()
    adu = rtu.build(UNIT, rtu.write_registers(0, [0xFFFF] * COUNT))
    done = await example.master.request(adu, example.longest_ps)
    first_ps, last_ps = example.changed_ps[0], example.changed_ps[-1]
    assert len(example.changed_ps) == COUNT and example.registers == [0xFFFF] * COUNT
    assert last_ps - first_ps == (COUNT - 1) * example.bench.period_ps
    late = (first_ps - done.sent.end_ps) / example.line.fmt.bit_ps - example.t35_bits
    assert -0.25 <= late <= 0.25, f"{late:.2f} bits after t3.5"


@cocotb.test()
async def both_bytes_of_a_value_are_read_at_once(dut):
    """The value is another one in each clock, and the two bytes of each are alike."""
    example = await Example(dut).start()

    async def change() -> None:
        while True:
            for value in (0x0000, 0xFFFF, 0x5555):
                await FallingEdge(dut.clk)
                dut.regs_rdata.value = value

    cocotb.start_soon(change())
    for _ in range(4):
        reply = await example.master.ask(UNIT, rtu.read_registers(0, COUNT), example.longest_ps)
        assert reply is not None and len(reply) == 2 + 2 * COUNT
        assert reply[2::2] == reply[3::2], reply.hex(" ")


@cocotb.test()
async def a_request_has_twelve_registers_at_most(dut):
    """The others are exception 3, but 2 where they are not there."""
    example = await Example(dut).start()
    count = len(example.registers)
    for pdu in (
        rtu.write_registers(count - MOST, list(range(0x1111, 0xDDDD, 0x1111))),
        rtu.write_registers(0, [7] * (MOST + 1)),
        rtu.read_registers(count - MOST, MOST),
        rtu.read_registers(0, MOST + 1),
        rtu.read_registers(0, count),
        rtu.read_registers(1, count),
        rtu.read_registers(count, 1),
        rtu.write_register(count - 1, 0x0102),
        rtu.read_registers(count - 1, 1),
    ):
        await example.asks(pdu)
    assert example.registers[-2:] == [0xBBBB, 0x0102] and example.registers[0] == 0


@cocotb.test()
async def a_reply_waits_for_its_delay_and_for_nobody_else(dut):
    """A character in the delay takes the reply back, and the write stays (FRAME-7)."""
    example = await Example(dut).start()
    bit_ps = example.line.fmt.bit_ps
    delay_bits = DELAY_MS * 1e9 / bit_ps
    adu = rtu.build(UNIT, rtu.write_register(1, 7))
    done = await example.master.request(adu, example.longest_ps)
    late = done.gap_bits - example.t35_bits - delay_bits
    assert 0 <= late <= 1, f"{late:.2f} bits after the delay"
    example.registers[1] = 0
    gap = example.t35_bits + delay_bits / 2
    flaws = Flaws(gaps={len(adu): gap})
    assert (await example.master.request(adu + b"\x55", example.longest_ps, flaws)).reply is None
    assert example.registers[1] == 7


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
    for pdu in (b"\x83\x01", b"\x86\x00\x02\x00\x01", b"\xff"):
        await example.ignores(rtu.build(UNIT, pdu))  # an exception of another slave
    assert len(example.changed_ps) == 1
    await example.asks(rtu.read_registers(0, 8))


@cocotb.test()
async def a_gap_of_two_characters_is_forgiven(dut):
    """With STRICT_T15 = 0, behind each of the bytes."""
    example = await Example(dut).start()
    adu = rtu.build(UNIT, rtu.write_register(1, 7))
    gap = 2 * example.line.fmt.bits
    for place in range(1, len(adu)):
        done = await example.master.request(adu, example.longest_ps, Flaws(gaps={place: gap}))
        assert done.reply is not None and done.reply.data == adu, f"a gap before byte {place}"


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


@cocotb.test()
async def the_led_follows_a_write(dut):
    """Of slave_top, whose reset no pin gives."""
    Clock(dut.clk, clock_period_ps(int(dut.CLK_HZ.value)), unit="ps").start()
    baud = int(dut.BAUD.value)
    line = RecordedLine(dut.rx, dut.tx, dut.de, Format.named(baud, "8E1"))
    master, dark = ModbusMaster(line), 1
    await line.source.idle(50)
    for pdu in (rtu.read_registers(0, 1), *(rtu.write_register(0, value) for value in (1, 0xFFFE))):
        assert dut.led_n.value == dark
        wanted = Slave(1).reply(pdu)
        assert await master.ask(UNIT, pdu, 2 * rtu.t35_ps(baud)) == wanted, pdu.hex(" ")
        dark = 1 - pdu[4] % 2 if pdu[0] == rtu.WRITE_REGISTER else dark
    assert dut.led_n.value == dark == 1


WRONG = [
    ("BAUD", 299, "BAUD_is_not_between_300_and_115200"),
    ("BAUD", 115_201, "BAUD_is_not_between_300_and_115200"),
    ("CLK_HZ", 16 * 19_200 - 1, "CLK_HZ_is_not_between_16_BAUD_and_100_MHz"),
    ("CLK_HZ", 100_000_001, "CLK_HZ_is_not_between_16_BAUD_and_100_MHz"),
    ("PARITY", 4, "PARITY_is_not_between_0_and_3"),
    ("ADDRESS", 0, "ADDRESS_is_not_between_1_and_247"),
    ("ADDRESS", 248, "ADDRESS_is_not_between_1_and_247"),
    ("REPLY_DELAY", 251, "REPLY_DELAY_is_not_between_0_and_250"),
    ("STRICT_T15", 2, "STRICT_T15_is_not_0_or_1"),
    ("REGISTERS", 0, "REGISTERS_is_not_between_1_and_65536"),
    ("REGISTERS", 65_537, "REGISTERS_is_not_between_1_and_65536"),
]


@pytest.mark.parametrize(("name", "value", "said"), WRONG)
@pytest.mark.parametrize(
    "tool", ["iverilog", *(pytest.param(tool, marks=pytest.mark.nightly) for tool in TOOLS[1:])]
)
def test_an_illegal_parameter_is_named(tool: str, name: str, value: int, said: str):
    top, files = "modbus_slave", [*needed_files("network_port"), SLAVE]
    done = subprocess.run(
        elaboration(tool, top, files, {name: value}), cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0 and said in done.stdout + done.stderr


def simulate(sim: str, baud: int = 19_200, testcase: list[str] | None = None, **others: int) -> None:
    run(
        "modbus_slave",
        "tb.rtl.test_modbus_slave",
        sim=sim,
        extra_sources=[SLAVE],
        parameters={"CLK_HZ": CLK_HZ[baud], "BAUD": baud, "ADDRESS": UNIT, **others},
        testcase=testcase,
    )


EIGHT = ("random_", "limits_", "first_", "a_write_", "both_", "broadcasts_", "frames_", "a_character_")


@on_verilator
def test_modbus_slave(sim):
    simulate(sim, testcase=[f"{name}.*" for name in EIGHT])


def test_modbus_slave_at_one_clock_a_tick():
    simulate("verilator", testcase=["random_.*", "frames_.*"], CLK_HZ=SLOWEST_HZ)


@pytest.mark.parametrize(("parity", "baud"), [(0, 38_400), (1, 19_200), (3, 19_200)])
def test_modbus_slave_with_another_parity(parity: int, baud: int):
    """Above 19200 bit/s the silences are fixed."""
    simulate("verilator", baud, ["random_.*", "first_.*"], PARITY=parity)


def test_modbus_slave_with_more_registers():
    simulate("verilator", testcase=["random_.*", "a_request_has.*"], REGISTERS=40)


def test_modbus_slave_with_a_delay():
    simulate("verilator", testcase=["random_.*", "a_reply_waits.*"], REPLY_DELAY=DELAY_MS)


def test_modbus_slave_for_masters_with_a_usb_adapter():
    simulate("verilator", testcase=["random_.*", "a_gap.*"], STRICT_T15=0)


def test_slave_top_on_its_pins():
    parameters = {"CLK_HZ": SLOWEST_HZ}
    case, sources = "the_led_follows_a_write", sorted(SLAVE.parent.glob("*.v"))
    run(
        "slave_top",
        "tb.rtl.test_modbus_slave",
        sim="icarus",
        extra_sources=sources,
        parameters=parameters,
        testcase=case,
    )


@pytest.mark.nightly
def test_modbus_slave_at_the_highest_rate():
    simulate("verilator", 115_200, [f"{name}.*" for name in (*EIGHT, "longest_")])
