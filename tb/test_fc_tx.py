# SPDX-License-Identifier: Apache-2.0
"""fc_tx: the telegram it makes of the frame memory, byte for byte and without a pause."""

from __future__ import annotations

from collections.abc import Callable

import cocotb
import pytest

from tb.lib.bench import Bench, Strobes
from tb.lib.memory_ports import ReadPort, at_once
from tb.lib.runner import run
from tb.lib.seeds import seeded
from tb.model.fc_telegram import ADR, ADR_BROADCAST, build, build_process

CHARACTER = 24  # clocks
LENGTHS = (5, 13, 29)  # ADR and data: process, parameter, the longest


class Uart:
    """The sender behind fc_tx: asks for a byte when it is idle and in the last clock of each character.

    `sent` is what it was given, `pauses` counts the characters that did not follow at once.
    """

    def __init__(self, bench: Bench):
        self.dut, self.bench = bench.dut, bench
        self.sent = bytearray()
        self.pauses = 0
        cocotb.start_soon(self._run())

    async def _run(self) -> None:
        dut, bench = self.dut, self.bench
        dut.byte_ready.value = dut.line_busy.value = 0
        await bench.clocks(2)
        waited = False
        while True:
            dut.byte_ready.value = 1
            await bench.clocks(0.25)  # before the edge that takes the byte
            taken = int(dut.byte_valid.value)
            if taken:
                self.sent.append(dut.byte_data.value.to_unsigned())
                self.pauses += waited and len(self.sent) > 1
            await bench.clocks(1)
            dut.byte_ready.value, dut.line_busy.value = 0, taken
            waited = not taken
            await bench.clocks(CHARACTER - 1 if taken else 3)


class Sender:
    """fc_tx between a memory, a UART and a line that becomes ready `lead` clocks after it is asked for."""

    def __init__(self, dut, delay: Callable[[], int] = at_once, lead: int = 4):
        self.dut = dut
        self.bench = Bench(dut, start=0, length=0, line_ready=0, byte_ready=0, line_busy=0)
        self.memory = ReadPort(self.bench, delay=delay)
        self.ended = Strobes(dut, "sent", "line_busy", "line_request")
        self.lead = lead

    async def start(self) -> Sender:
        await self.bench.start()
        self.uart = Uart(self.bench)
        cocotb.start_soon(self._line())
        return self

    async def _line(self) -> None:
        while True:
            wanted = int(self.dut.line_request.value)
            if wanted:
                await self.bench.clocks(self.lead)
            self.dut.line_ready.value = int(self.dut.line_request.value)
            await self.bench.clocks()

    async def begin(self, contents: bytes, length: int | None = None) -> None:
        self.memory.memory = contents
        self.dut.length.value = len(contents) if length is None else length
        await self.bench.strobe(self.dut.start)

    async def end(self) -> bytes:
        """Waits for the telegram's end; returns what the UART was given since the last one."""
        before = len(self.ended)
        for _ in range(40 * CHARACTER + self.lead):
            await self.bench.clocks()
            if len(self.ended) > before:
                break
        else:
            raise AssertionError("it never ended")
        await self.bench.clocks(3 * CHARACTER)
        assert len(self.ended) == before + 1, "sent is one clock wide"
        sent = bytes(self.uart.sent)
        self.uart.sent.clear()
        return sent

    async def telegram(self, contents: bytes) -> bytes:
        await self.begin(contents)
        return await self.end()


@cocotb.test()
async def telegrams_of_every_length_are_framed_as_the_model_says(dut):
    rng = seeded("contents")
    tx = await Sender(dut).start()
    for length in range(5, 30):
        contents = bytes([ADR]) + rng.randbytes(length - 1)
        tx.memory.reads.clear()
        await tx.begin(contents + rng.randbytes(32 - length), length)
        assert await tx.end() == build(contents[1:])
        assert tx.memory.reads == list(range(length))
    assert tx.uart.pauses == 0


@cocotb.test()
async def the_adr_that_was_sent_is_kept(dut):
    tx = await Sender(dut).start()
    for adr in (ADR, ADR_BROADCAST, 0x21):
        await tx.telegram(bytes([adr]) + bytes(4))
        assert dut.adr.value.to_unsigned() == adr
        await tx.bench.clocks(100)
        assert dut.adr.value.to_unsigned() == adr


@cocotb.test()
async def a_memory_that_answers_late_costs_no_pause(dut):
    rng = seeded("delays")
    tx = await Sender(dut, delay=lambda: rng.randint(0, CHARACTER - 8)).start()
    for length in LENGTHS:
        contents = bytes([ADR]) + rng.randbytes(length - 1)
        assert await tx.telegram(contents) == build(contents[1:])
    assert tx.uart.pauses == 0


@cocotb.test()
async def nothing_is_given_to_the_uart_before_the_line_is_ready(dut):
    tx = await Sender(dut, lead=200).start()
    await tx.begin(bytes([ADR, 0x04, 0x7C, 0x20, 0x00]))
    for _ in range(195):
        assert int(dut.line_request.value) and int(dut.sending.value) and not int(dut.byte_valid.value)
        await tx.bench.clocks()
    assert not tx.uart.sent
    assert await tx.end() == build_process(0x047C, 0x2000)


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def sending_lasts_until_the_last_stop_bit_and_sent_marks_its_end(dut):
    tx = await Sender(dut).start()
    assert not int(dut.sending.value) and not int(dut.line_request.value)
    await tx.begin(bytes([ADR, 0x04, 0x7C, 0x20, 0x00]))
    while len(tx.uart.sent) < 8:
        assert int(dut.line_request.value)
        await tx.bench.clocks()
    await tx.bench.clocks(2)
    # The line is kept by its being busy alone from here on.
    assert not int(dut.line_request.value)
    while int(dut.line_busy.value):
        assert int(dut.sending.value) and not len(tx.ended)
        await tx.bench.clocks()
    await tx.bench.clocks(2)
    assert not int(dut.sending.value)
    assert tx.ended.values == [(0, 0)]


@cocotb.test()
async def a_start_during_a_telegram_does_not_disturb_it(dut):
    tx = await Sender(dut).start()
    contents = bytes([ADR]) + bytes(range(1, 13))
    await tx.begin(contents)
    for _ in range(20):
        await tx.bench.clocks(11)
        await tx.bench.strobe(dut.start)
    assert await tx.end() == build(contents[1:])


@cocotb.test()
async def reset_gives_the_line_back_and_the_next_telegram_is_whole(dut):
    tx = await Sender(dut).start()
    contents = bytes([ADR, 0x04, 0x7C, 0x20, 0x00])
    for at in range(0, 8 * CHARACTER, 17):
        await tx.begin(contents)
        await tx.bench.clocks(at + 1)
        await tx.bench.strobe(dut.rst)
        assert not int(dut.sending.value) and not int(dut.line_request.value)
        await tx.bench.clocks(2 * CHARACTER)
        tx.uart.sent.clear()
        assert await tx.telegram(contents) == build(contents[1:]), f"after a reset in clock {at}"


@pytest.mark.rule("FC-1", "FC-2", "FC-8", "SAFE-2")
def test_fc_tx(sim):
    run("fc_tx", "tb.test_fc_tx", sim=sim)
