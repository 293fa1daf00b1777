# SPDX-License-Identifier: Apache-2.0
"""The agents against each other on one wire: formats, faults, times, DE, collisions, verdicts of edges.

test_agents.py starts it. It imports the installed package alone.
"""

from __future__ import annotations

import cocotb
from cocotb.triggers import Timer
from cocotbext.rtu import edges, rtu
from cocotbext.rtu.modbus_master import ModbusMaster
from cocotbext.rtu.rs485 import Rs485Line
from cocotbext.rtu.uart import Flaws, Format, UartMonitor, UartSource, with_gaps

FORMATS = ("8N1", "8N2", "8E1", "8O1")
BAUD = 19200
DATA = b"\x00\xff\x55\xaa\x01\x80\x7e"


class Wire:
    """A source and a monitor, each with its own format."""

    def __init__(self, dut, sends: str, hears: str | None = None):
        self.dut = dut
        dut.de.value = 0
        self.source = UartSource(dut.line, Format.named(BAUD, sends))
        self.monitor = UartMonitor(dut.heard, Format.named(BAUD, hears or sends))

    async def hears(self, data: bytes, flaws: Flaws | None = None):
        await self.source.idle(20)
        sent = await self.source.send(data, flaws)
        await self.source.idle(40)
        return sent, self.monitor.frames()[-1]


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def a_monitor_hears_the_bytes_and_times_of_a_source(dut, form):
    wire = Wire(dut, form)
    sent, frame = await wire.hears(DATA)
    assert frame.data == DATA and frame.ok
    assert abs(frame.start_ps - sent.start_ps) <= 1 and abs(frame.end_ps - sent.end_ps) <= 10
    assert frame.largest_gap_ps <= 2


@cocotb.test()
async def faults_of_characters_are_seen_where_they_are(dut):
    wire = Wire(dut, "8E1")
    flaws = Flaws(bad_parity=(1,), bad_stop=(3,), gaps={4: 3.0, 5: 7.0})
    _, frame = await wire.hears(DATA, flaws)
    assert [c.parity_ok for c in frame.characters] == [True, False, *[True] * 5]
    assert [c.stop_ok for c in frame.characters] == [*[True] * 3, False, *[True] * 3]
    assert abs(frame.largest_gap_ps / wire.source.fmt.bit_ps - 7.0) < 0.01


@cocotb.test()
async def wrong_parity_is_heard_in_another_format(dut):
    _, frame = await Wire(dut, "8O1", "8E1").hears(DATA)
    assert frame.data == DATA and not any(c.parity_ok for c in frame.characters)


@cocotb.test()
async def a_break_is_one_character_with_a_bad_stop_bit(dut):
    wire = Wire(dut, "8E1")
    await wire.source.idle(20)
    await wire.source.send_break(30, idle_after=20)
    assert [(c.byte, c.stop_ok) for c in wire.monitor.characters] == [(0, False)]


@cocotb.test()
async def a_glitch_inverts_the_line_for_its_width(dut):
    wire = Wire(dut, "8E1")
    sent, _ = await wire.hears(b"\xff", Flaws(glitches=[(5.0, 0.25)]))
    bit = wire.source.fmt.bit_ps
    places = [(at - sent.start_ps) / bit for at, _ in wire.monitor.edges]
    # Of FFh in 8E1 the start bit and the parity bit are low.
    for place, due in zip(places, (0, 1, 5, 5.25, 9, 10), strict=True):
        assert abs(place - due) < 0.001, places


@cocotb.test()
async def the_judge_measures_rate_edges_and_gaps(dut):
    wire = Wire(dut, "8E1")
    for flaws, due in (
        (Flaws(), []),
        (Flaws(ppm=5000), []),
        (Flaws(ppm=-20000), ["rate off by +2.0"]),
        (Flaws(ppm=20000), ["rate off by -1.9"]),
        (Flaws(low_stretch=0.4), ["an edge 0.40 bits off"]),
        (with_gaps(len(DATA), 10), []),
        (Flaws(gaps={3: 17}), ["a gap of 17.0 bits"]),
        (Flaws(bad_parity=(0, 2)), ["2 characters with"]),
    ):
        _, frame = await wire.hears(DATA, flaws)
        limits = edges.Limits() if not flaws.low_stretch else edges.Limits(rate=None)
        # By default frames() ends a frame at a gap of 1.5 characters.
        if flaws.gaps.get(3) == 17:
            frame = wire.monitor.frames(gap_bits=30)[-1]
        found = edges.judge(wire.monitor, frame, limits=limits)
        assert len(found) == len(due), (flaws, found)
        assert all(text.startswith(start) for text, start in zip(found, due, strict=True)), found


@cocotb.test()
async def the_judge_knows_t35_and_de(dut):
    fmt = Format.named(BAUD, "8E1")
    line = Rs485Line(dut.line, dut.heard, dut.de, fmt)
    dut.de.value = 0
    t35_bits = rtu.t35_ps(BAUD) / fmt.bit_ps

    async def judged(after_bits: float, lead: float, lag: float) -> list[str]:
        await line.source.idle(60)
        request_end = line.source.sent[-1].end_ps if line.source.sent else 0
        start = cocotb.start_soon(line.source.send(DATA)) if lead == 0 else None
        dut.de.value = 1
        if start is None:
            await line.source.idle(lead)
            await line.source.send(DATA)
        else:
            await start
        frame_start = line.source.sent[-1].start_ps
        request_end = frame_start - after_bits * fmt.bit_ps
        if lag > 0:
            await line.source.idle(lag)
        dut.de.value = 0
        await line.source.idle(30)
        return edges.judge(
            line.monitor,
            line.monitor.frames()[-1],
            request_end_ps=request_end,
            pulses=line.direction.pulses,
            limits=edges.Limits(de_lead_bits=1.0),
        )

    assert await judged(t35_bits, 0.5, 0.5) == []
    assert "t3.5 is 38.5" in (await judged(t35_bits - 1, 0.5, 0.5))[0]
    assert (await judged(t35_bits, 2.0, 0.5))[0].startswith("DE rises 2.00 bits before")
    assert (await judged(t35_bits, 0.5, 3.0))[0].startswith("DE falls 3.00 bits after")
    # The far end sends here while DE is high: on a real line each is a collision.
    assert len(line.collisions()) == 4


@cocotb.test()
async def a_master_takes_a_reply_and_notices_silence(dut):
    """A second sender plays the slave on the wire to the master."""
    fmt = Format.named(BAUD, "8E1")
    line = Rs485Line(dut.de, dut.heard, dut.enabled, fmt)
    slave = UartSource(dut.line, fmt)
    master = ModbusMaster(line)
    reply = rtu.build(9, bytes([3, 2, 0, 1]))
    await line.source.idle(50)

    async def answers() -> None:
        await Timer(8, unit="ms")
        await slave.send(reply)

    cocotb.start_soon(answers())
    done = await master.request(rtu.build(9, rtu.read_registers(0, 1)), 20e9)
    assert done.data == reply and done.gap_bits > 0
    assert await master.ask(9, rtu.read_registers(0, 1), 5e9) is None
