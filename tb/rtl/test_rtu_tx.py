# SPDX-License-Identifier: Apache-2.0
"""rtu_tx on its line: address and PDU from the frame memory, then the CRC, DE around all of it."""

from pathlib import Path

import cocotb
import pytest
from cocotb.triggers import RisingEdge

from tb.agents.crc16 import crc_good, with_crc
from tb.agents.rs485 import DirectionMonitor, check_direction
from tb.agents.uart import Format, UartMonitor, now_ps
from tb.lib.bench import Bench
from tb.lib.memory_ports import ReadPort
from tb.lib.runner import run
from tb.lib.seeds import seeded

HERE = Path(__file__).parent
BAUD = 9600
TICKS_HZ = 16 * BAUD  # with tick16 held high a clock is a tick
LONGEST = 31


class Sender:
    """rtu_tx with CRC unit, direction control and UART; `monitor` decodes the line."""

    def __init__(self, dut, form: str = "8E1"):
        self.dut = dut
        self.fmt = Format.named(BAUD, form)
        self.bench = Bench(
            dut,
            TICKS_HZ,
            tick16=1,
            start=0,
            length=0,
            read_damaged=0,
            parity_enable=form[1] != "N",
            parity_odd=form[1] == "O",
            two_stop=form[2] == "2",
        )
        self.memory = ReadPort(self.bench)
        self.monitor = UartMonitor(dut.tx, self.fmt)
        self.direction = DirectionMonitor(dut.de)

    async def start(self) -> "Sender":
        await self.bench.start()
        return self

    async def reply(self, contents: bytes, length: int | None = None) -> bytes:
        """Starts a reply and returns the bytes sent until DE fell."""
        self.memory.memory = contents
        self.dut.length.value = len(contents) if length is None else length
        await self.bench.strobe(self.dut.start)
        self.monitor.forget()
        frame = await self.monitor.frame(1e10, gap_bits=3)
        assert frame.ok
        assert frame.largest_gap_ps < 0.02 * self.fmt.bit_ps, "a gap inside the frame"
        return frame.data

    def check(self) -> None:
        check_direction(self.direction.pulses, self.monitor)


@cocotb.test()
@cocotb.parametrize(form=("8N1", "8N2", "8E1", "8O1"))
async def reply_carries_its_crc_low_byte_first_in_every_format(dut, form):
    tx = await Sender(dut, form).start()
    reply = bytes.fromhex("01 0F 00 00 00 20")
    assert await tx.reply(reply) == reply + b"\x54\x13"
    tx.check()


@cocotb.test()
async def replies_of_every_length_leave_without_a_gap(dut):
    rng = seeded("replies")
    tx = await Sender(dut).start()
    for length in (2, 3, 5, 8, 24, LONGEST):
        contents = rng.randbytes(32)
        tx.memory.reads.clear()
        assert await tx.reply(contents, length) == with_crc(contents[:length])
        assert tx.memory.reads == list(range(length)), "each byte is read once"
    tx.check()


@cocotb.test()
async def slow_frame_memory_makes_no_gap(dut):
    rng = seeded("waits")
    tx = await Sender(dut).start()
    # The arbiter delays an access by at most three clocks; a character has 176 here.
    tx.memory.delay = lambda: rng.randint(0, 9)
    contents = rng.randbytes(20)
    assert await tx.reply(contents) == with_crc(contents)
    tx.check()


@cocotb.test()
async def damage_at_any_time_in_a_reply_spoils_its_crc_and_no_other(dut):
    """The bytes leave as they were read, whenever the memory finds one damaged (SAFE-4)."""
    rng = seeded("damage")
    tx = await Sender(dut).start()
    contents = rng.randbytes(4)
    good = with_crc(contents)
    character = round(tx.fmt.character_ps / tx.bench.period_ps)
    await tx.bench.strobe(dut.read_damaged)  # of an earlier access
    assert await tx.reply(contents) == good
    # The first byte, each later one, and the first bits of the CRC.
    for clocks in (2, *(n * character + rng.randrange(character) for n in range(4)), 4 * character + 20):
        sending = cocotb.start_soon(tx.reply(contents))
        await RisingEdge(dut.sending)
        await tx.bench.clocks(clocks)
        await tx.bench.strobe(dut.read_damaged)
        sent = await sending
        assert sent[:4] == contents and len(sent) == len(good)
        assert not crc_good(sent), f"damage {clocks} clocks after the start: {sent.hex(' ')}"
        assert await tx.reply(contents) == good
    tx.check()


@cocotb.test()
async def sending_lasts_to_the_end_of_the_last_stop_bit(dut):
    tx = await Sender(dut, "8N2").start()
    assert dut.sending.value == 0
    cocotb.start_soon(tx.reply(b"\x01\x83\x40"))
    await tx.bench.clocks(2)
    assert dut.sending.value == 1
    while dut.sending.value == 1:
        await tx.bench.clocks()
    late = (now_ps() - tx.monitor.characters[-1].end_ps) / tx.fmt.bit_ps
    assert len(tx.monitor.characters) == 5 and 0 <= late < 0.2


@cocotb.test()
async def start_while_sending_is_ignored(dut):
    tx = await Sender(dut).start()
    contents = b"\x01\x03\x02\x12\x34"
    sending = cocotb.start_soon(tx.reply(contents))
    await tx.bench.clocks(500)
    await tx.bench.strobe(dut.start)
    assert await sending == with_crc(contents)
    assert len(tx.direction.pulses) == 1


@cocotb.test()
async def reply_whose_length_shrinks_ends_after_the_whole_memory(dut):
    """The count has already passed the new length: 32 bytes and their CRC are sent, and no more (SAFE-2)."""
    rng = seeded("shrinks")
    tx = await Sender(dut).start()
    contents = rng.randbytes(32)
    sending = cocotb.start_soon(tx.reply(contents, 20))
    while len(tx.memory.reads) < 12:
        await tx.bench.clocks()
    dut.length.value = 5
    assert await sending == with_crc(contents)
    tx.check()


@cocotb.test()
async def reset_while_sending_releases_the_line(dut):
    tx = await Sender(dut).start()
    cocotb.start_soon(tx.reply(bytes(10)))
    await tx.bench.clocks(600)
    assert dut.de.value == 1
    await tx.bench.strobe(dut.rst)
    await tx.bench.clocks()
    assert dut.de.value == 0 and dut.tx.value == 1 and dut.sending.value == 0


@pytest.mark.rule("FRAME-4", "LINE-1", "LINE-6", "SAFE-2", "SAFE-4")
def test_rtu_tx(sim):
    run("rtu_tx_line", "tb.rtl.test_rtu_tx", sim=sim, extra_sources=[HERE / "rtu_tx_line.v"])
