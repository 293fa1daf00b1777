# SPDX-License-Identifier: Apache-2.0
"""fc_tx on its line: sends the telegram from the frame memory, byte for byte and without a gap."""

from __future__ import annotations

from collections.abc import Callable

import cocotb
import pytest
from cocotb.triggers import First, ValueChange

from tb.agents.uart import Format, UartMonitor
from tb.lib.bench import Bench, Strobes
from tb.lib.memory_ports import ReadPort, at_once
from tb.lib.nightly import on_verilator
from tb.lib.runner import ROOT, run
from tb.lib.seeds import cases, seeded
from tb.model.fc_telegram import ADR, ADR_BROADCAST, build, build_process

LINE = Format.named(9600, "8E1")
TICKS_HZ = 16 * LINE.baud  # with tick16 held high a clock is a tick
CHARACTER = 16 * 11  # clocks
LENGTHS = (6, 14, 30)  # ADR, data and BCC: process, parameter, the longest
VALID = 0x0400  # bit 10 of the control word
RUN = 0x0040  # bit 6, the start
COMMAND = build_process(0x047C, 0x2000)[2:]


class Sender:
    """fc_tx and UART on a line that becomes ready `lead` clocks after its request."""

    def __init__(self, dut, delay: Callable[[], int] = at_once, lead: int = 4):
        self.dut = dut
        self.bench = Bench(dut, TICKS_HZ, tick16=1, start=0, length=0, control=1, stop=0, line_ready=0)
        self.memory = ReadPort(self.bench, delay=delay)
        self.monitor = UartMonitor(dut.tx, LINE)
        self.ended = Strobes(dut, "sent", "line_busy", "line_request")
        self.lead = lead

    async def start(self) -> Sender:
        await self.bench.start()
        cocotb.start_soon(self._line())
        return self

    async def _line(self) -> None:
        request, busy, ready = self.dut.line_request, self.dut.line_busy, self.dut.line_ready
        while True:
            await First(ValueChange(request), ValueChange(busy))
            await self.bench.clocks(0.75)
            if int(request.value) and not int(ready.value):
                await self.bench.clocks(self.lead)
            ready.value = int(request.value or busy.value)

    async def begin(self, contents: bytes, length: int | None = None) -> None:
        self.monitor.forget()
        self.memory.memory = contents
        self.dut.length.value = len(contents) if length is None else length
        await self.bench.strobe(self.dut.start)

    async def end(self) -> bytes:
        """The characters on the line since begin()."""
        before = len(self.ended)
        frame = await self.monitor.frame(1e12, gap_bits=3)
        assert frame.ok
        assert frame.largest_gap_ps < 0.01 * LINE.bit_ps, "a gap inside the telegram"
        assert len(self.ended) == before + 1, "sent is one clock wide"
        return frame.data

    async def telegram(self, contents: bytes) -> bytes:
        await self.begin(contents)
        return await self.end()


@cocotb.test()
async def telegrams_of_every_length_agree_with_the_model(dut):
    rng = seeded("contents")
    tx = await Sender(dut).start()
    for length in range(6, 31):
        telegram = build(rng.randbytes(length - 2))
        tx.memory.reads.clear()
        await tx.begin(telegram[2:] + rng.randbytes(32 - length), length)
        assert await tx.end() == telegram
        assert tx.memory.reads == list(range(length)), "each byte is read once"


async def check_bit_never_leaves(tx: Sender, bit: int) -> None:
    """Telegrams of every length: the bit of the control word leaves as 0, all else as it was queued."""
    rng = seeded("contents")
    mask = bit.to_bytes(2, "big")
    for length in range(6, 31, cases(4, 1)):
        data = bytearray(rng.randbytes(length - 2))
        word = int.from_bytes(data[-4:-2], "big")
        for value in (word & ~bit, word | bit):
            data[-4:-2] = value.to_bytes(2, "big")
            queued = build(bytes(data))
            expected = bytearray(queued)
            expected[-5] &= ~mask[0]
            expected[-4] &= ~mask[1]
            assert await tx.telegram(queued[2:]) == expected


@cocotb.test()
async def without_control_no_command_is_sent(dut):
    """Bit 10 of the control word is sent as 0; all other bits and the BCC stay unchanged (SAFE-1)."""
    tx = await Sender(dut).start()
    dut.control.value = 0
    await check_bit_never_leaves(tx, VALID)


@cocotb.test()
async def the_stop_never_has_the_start_bit(dut):
    """Bit 6 of the control word is sent as 0; all other bits and the BCC stay unchanged (SAFE-7)."""
    tx = await Sender(dut).start()
    dut.stop.value = 1
    await check_bit_never_leaves(tx, RUN)


@cocotb.test()
async def adr_holds_the_address_that_was_sent(dut):
    tx = await Sender(dut).start()
    for adr in (ADR, ADR_BROADCAST, 0x21):
        await tx.telegram(build(bytes(4), adr)[2:])
        assert dut.adr.value.to_unsigned() == adr
        await tx.bench.clocks(100)
        assert dut.adr.value.to_unsigned() == adr


@cocotb.test()
async def a_slow_memory_makes_no_gap(dut):
    rng = seeded("delays")
    # A stop bit has 16 clocks here; the memory answers within two.
    tx = await Sender(dut, delay=lambda: rng.randint(0, 9)).start()
    for length in LENGTHS:
        telegram = build(rng.randbytes(length - 2))
        assert await tx.telegram(telegram[2:]) == telegram


@cocotb.test()
async def nothing_is_sent_before_the_line_is_ready(dut):
    tx = await Sender(dut, lead=200).start()
    await tx.begin(COMMAND)
    for _ in range(195):
        assert int(dut.line_request.value) and int(dut.sending.value)
        assert int(dut.tx.value) and not int(dut.line_busy.value)
        await tx.bench.clocks()
    assert await tx.end() == build_process(0x047C, 0x2000)


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def sending_lasts_until_the_last_stop_bit_and_sent_marks_its_end(dut):
    tx = await Sender(dut).start()
    assert not int(dut.sending.value) and not int(dut.line_request.value)
    await tx.begin(COMMAND)
    while len(tx.monitor.characters) < 6:
        assert int(dut.line_request.value)
        await tx.bench.clocks()
    await tx.bench.clocks(CHARACTER)
    # From here on only `line_busy` holds the line.
    assert not int(dut.line_request.value)
    while int(dut.line_busy.value):
        assert int(dut.sending.value) and not len(tx.ended)
        await tx.bench.clocks()
    late = (tx.bench.last_edge_ps() - tx.monitor.characters[-1].end_ps) / LINE.bit_ps
    assert len(tx.monitor.characters) == 8 and abs(late) < 0.1
    await tx.bench.clocks(2)
    assert not int(dut.sending.value)
    assert tx.ended.values == [(0, 0)]


@cocotb.test()
async def a_start_during_a_telegram_does_not_disturb_it(dut):
    tx = await Sender(dut).start()
    telegram = build(bytes(range(1, 13)))
    await tx.begin(telegram[2:])
    for _ in range(20):
        await tx.bench.clocks(83)
        await tx.bench.strobe(dut.start)
    assert await tx.end() == telegram


@cocotb.test()
async def a_damaged_byte_is_sent_with_its_original_bcc(dut):
    """The drive therefore rejects the telegram (SAFE-4)."""
    tx = await Sender(dut).start()
    whole = build_process(0x047C, 0x2000)
    for at in range(2, len(whole)):
        damaged = bytearray(whole)
        damaged[at] ^= 0x10
        assert await tx.telegram(bytes(damaged[2:])) == damaged


@cocotb.test()
async def reset_releases_the_line_and_the_next_telegram_is_whole(dut):
    tx = await Sender(dut).start()
    for at in range(0, 8 * CHARACTER, 97):
        await tx.begin(COMMAND)
        await tx.bench.clocks(at + 1)
        await tx.bench.strobe(dut.rst)
        assert not int(dut.sending.value) and not int(dut.line_request.value)
        assert not int(dut.line_busy.value) and int(dut.tx.value)
        await tx.bench.clocks(2 * CHARACTER)
        assert await tx.telegram(COMMAND) == build_process(0x047C, 0x2000), f"after a reset in clock {at}"


@on_verilator
@pytest.mark.rule("FC-1", "FC-2", "FC-8", "SAFE-1", "SAFE-2", "SAFE-4")
def test_fc_tx(sim):
    run("fc_tx_line", "tb.rtl.test_fc_tx", sim=sim, extra_sources=[ROOT / "tb/rtl/fc_tx_line.v"])
