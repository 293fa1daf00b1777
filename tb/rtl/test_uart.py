# SPDX-License-Identifier: Apache-2.0
"""uart: all formats in both directions, error flags per byte, sending without gaps."""

import cocotb
import pytest

from sim.harness.wave_rows import copies_with_rows
from tb.agents.uart import Flaws, Format, UartMonitor, UartSource
from tb.lib.bench import Bench, Strobes
from tb.lib.runner import ROOT, run
from tb.lib.seeds import cases, seeded

FORMATS = ("8N1", "8N2", "8E1", "8O1")
BAUD = 9600
TICKS_HZ = 16 * BAUD  # with tick16 held high a clock is a tick
TICK = 1 / 16
QUIET = {"send_valid": 0, "send_data": 0, "send_check": 0, "check_bit": 0, "line_ready": 1, "line": 1}


def levels_of(form: str) -> dict[str, int]:
    return {
        "parity_enable": form[1] != "N",
        "parity_odd": form[1] == "O",
        "two_stop": form[2] == "2",
    }


# ---------------------------------------------------------------- receiving


class Receiver:
    """The UART with a source on its line; `bytes` and `flags` are its outputs."""

    def __init__(self, dut, form: str, clocks_a_tick: int = 1):
        self.dut = dut
        self.clocks_a_tick = clocks_a_tick
        self.bench = Bench(dut, TICKS_HZ * clocks_a_tick, tick16=1, **QUIET, **levels_of(form))
        self.source = UartSource(dut.line, Format.named(BAUD, form))
        self.out = Strobes(dut, "byte_valid", "byte_data", "byte_parity_error", "byte_framing_error")
        self.starts = Strobes(dut, "start_seen")

    async def start(self) -> "Receiver":
        await self.bench.start()
        if self.clocks_a_tick > 1:
            cocotb.start_soon(self.tick())
        await self.source.idle(2)
        return self

    async def tick(self) -> None:
        while True:
            self.dut.tick16.value = 1
            await self.bench.clocks(1)
            self.dut.tick16.value = 0
            await self.bench.clocks(self.clocks_a_tick - 1)

    @property
    def bytes(self) -> bytes:
        return bytes(value[0] for value in self.out.values)

    @property
    def flags(self) -> list[tuple[int, int]]:
        """(parity error, framing error) of each byte."""
        return [(value[1], value[2]) for value in self.out.values]


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def back_to_back_bytes_are_received_in_every_format(dut, form):
    rng = seeded("bytes")
    rx = await Receiver(dut, form).start()
    data = b"\x00\xff\x55\xaa\x01\x80" + rng.randbytes(20)
    await rx.source.send(data)
    await rx.source.idle(2)
    assert rx.bytes == data
    assert set(rx.flags) == {(0, 0)}
    assert len(rx.starts) == len(data)


@cocotb.test()
async def error_rows_of_a_waveform_are_high_with_a_flawed_byte_alone(dut):
    rows = [Strobes(dut, "parity_flaw"), Strobes(dut, "framing_flaw")]
    rx = await Receiver(dut, "8E1").start()
    await rx.source.send(b"\x11\x22\x33\x44\x55", Flaws(bad_parity=(1,), bad_stop=(3,), gaps={4: 3.0}))
    await rx.source.idle(2)
    for row, flawed in zip(rows, (1, 3), strict=True):
        assert row.times_ps == [rx.out.times_ps[flawed]]


@cocotb.test()
async def frame_row_of_a_waveform_shows_the_bytes_of_one_frame(dut):
    """Received and sent frames alike. A pause of 1.5 characters ends a frame, a shorter one does not."""

    def shown() -> str:
        return dut.frame_text.value.to_unsigned().to_bytes(96, "big").decode().rstrip()

    rx = await Receiver(dut, "8E1").start()
    await rx.source.idle(1.7 * 11)  # the scenario before ended in a frame
    await rx.source.send(bytes.fromhex("01 05 a6"))
    await rx.source.idle(1.3 * 11)
    await rx.source.send(b"\x0f")
    await rx.source.idle(2)
    assert shown() == "01 05 A6 0F"
    await rx.source.idle(1.7 * 11)
    assert shown() == "01 05 A6 0F", "it stays until the next frame"
    await rx.bench.send_stream(b"\x02\x06", "send")
    await rx.bench.clocks(16 * 14)
    assert shown() == "02 06"
    await rx.bench.clocks(16 * 20)
    await rx.bench.send_stream(bytes(range(40)), "send")
    await rx.bench.clocks(16 * 14)
    assert shown() == " ".join(f"{byte:02X}" for byte in range(32)), "the first 32 bytes"


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def an_error_is_reported_with_its_own_byte(dut, form):
    rx = await Receiver(dut, form).start()
    parity = int(form[1] != "N")
    gaps = {4: 3.0}  # the line must be high again before the next character
    await rx.source.send(b"\x11\x22\x33\x44\x55", Flaws(bad_parity=(1,) * parity, bad_stop=(3,), gaps=gaps))
    await rx.source.idle(2)
    assert rx.bytes == b"\x11\x22\x33\x44\x55"
    assert rx.flags == [(0, 0), (parity, 0), (0, 0), (0, 1), (0, 0)]


@cocotb.test()
async def one_stop_bit_is_enough_where_two_are_usual(dut):
    rx = await Receiver(dut, "8N2").start()
    await rx.source.send(b"\xa5\x00\xff\x5a", fmt=Format.named(BAUD, "8N1"))
    await rx.source.idle(2)
    assert rx.bytes == b"\xa5\x00\xff\x5a"
    assert set(rx.flags) == {(0, 0)}


@cocotb.test()
async def break_is_one_zero_with_framing_error_and_receiving_until_it_ends(dut):
    rx = await Receiver(dut, "8E1").start()
    await rx.source.send_break(40, idle_after=0)
    assert rx.bytes == b"\x00" and rx.flags[0][1] == 1
    assert dut.receiving.value == 1
    await rx.source.idle(1)
    assert dut.receiving.value == 0
    await rx.source.send(b"\x42")
    await rx.source.idle(2)
    assert rx.bytes == b"\x00\x42" and rx.flags[1] == (0, 0)


@cocotb.test()
async def low_pulse_below_half_a_bit_is_no_start_bit(dut):
    rx = await Receiver(dut, "8E1").start()
    for ticks in range(1, 8):
        await rx.source.low_pulse(ticks * TICK * rx.source.fmt.bit_ps)
        await rx.source.idle(1)
        assert dut.receiving.value == 0
    await rx.source.idle(12)
    assert len(rx.starts) == 0 and len(rx.out) == 0
    await rx.source.send(b"\x99")
    await rx.source.idle(2)
    assert rx.bytes == b"\x99"


@cocotb.test()
async def the_three_samples_of_a_bit_are_a_tick_apart(dut):
    """A pulse shorter than a tick can affect only one of them, wherever it lies, and is outvoted."""
    rx = await Receiver(dut, "8E1", clocks_a_tick=8).start()
    data = b"\x35"
    places = [6 + step / 8 for step in range(0, 32, cases(3, 1))]
    for place in places:
        await rx.source.send(data, Flaws(glitches=[(bit + place * TICK, 0.9 * TICK) for bit in range(11)]))
        await rx.source.idle(3)
    assert rx.bytes == data * len(places)
    assert set(rx.flags) == {(0, 0)}


@cocotb.test()
async def reset_in_the_middle_of_a_byte_drops_it(dut):
    rx = await Receiver(dut, "8E1").start()
    sending = cocotb.start_soon(rx.source.send(b"\xfe"))
    await rx.source.idle(4)
    await rx.bench.strobe(dut.rst)
    await sending
    await rx.source.idle(12)
    assert len(rx.out) == 0


# ---------------------------------------------------------------- sending


async def ready_bench(dut, form: str) -> tuple[Bench, UartMonitor]:
    bench = Bench(dut, TICKS_HZ, tick16=1, **QUIET, **levels_of(form))
    monitor = UartMonitor(dut.txd, Format.named(BAUD, form))
    return await bench.start(), monitor


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def bytes_are_sent_in_every_format_without_gaps(dut, form):
    rng = seeded("bytes")
    data = b"\x00\xff\x55\xaa" + rng.randbytes(12)
    bench, monitor = await ready_bench(dut, form)
    await bench.clocks(40)
    assert dut.txd.value == 1, "idle"
    await bench.send_stream(data, "send")
    frame = await monitor.frame(1e12)
    assert frame.ok and frame.data == data
    assert frame.largest_gap_ps < 0.01 * monitor.fmt.bit_ps
    assert monitor.measure(frame).worst_edge_ps < 0.01 * monitor.fmt.bit_ps


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def next_byte_is_taken_from_the_parity_or_first_stop_bit_on(dut, form):
    """The shift register is free then, and the sender has one bit time to supply the next byte."""
    bench, _ = await ready_bench(dut, form)
    ready = Strobes(dut, "send_ready")
    await bench.send_stream(b"\x00", "send")
    ready.clear()
    begun = bench.last_edge_ps()
    await bench.clocks(16 * 12)
    first = (ready.times_ps[0] - begun) / bench.period_ps
    assert abs(first - 16 * 9) <= 2


@cocotb.test()
@cocotb.parametrize(form=("8N1", "8E1", "8O1"))
async def check_bits_are_sent_in_place_of_the_data_with_their_own_parity(dut, form):
    """The check unit advances with each bit strobe."""
    value = 0xB4
    bench, monitor = await ready_bench(dut, form)
    dut.send_check.value = 1
    bits_shown = Strobes(dut, "bit_valid", "bit_data")

    async def check_unit() -> None:
        for n in range(8):
            dut.check_bit.value = value >> n & 1
            while len(bits_shown) <= n:
                await bench.clocks()
            await bench.clocks()

    cocotb.start_soon(check_unit())
    await bench.send_stream(b"\x00", "send")
    frame = await monitor.frame(1e12)
    assert frame.ok and frame.data == bytes([value])
    assert [bit for (bit,) in bits_shown.values] == [value >> n & 1 for n in range(8)]


@cocotb.test()
async def every_data_bit_reaches_the_check_unit_in_both_directions(dut):
    rng = seeded("bytes")
    data = rng.randbytes(6)
    bits = [byte >> n & 1 for byte in data for n in range(8)]
    rx = await Receiver(dut, "8E1").start()
    bits_shown = Strobes(dut, "bit_valid", "bit_data")
    await rx.source.send(data)
    await rx.source.idle(2)
    assert [bit for (bit,) in bits_shown.values] == bits
    bits_shown.clear()
    await rx.bench.send_stream(data, "send")
    await rx.bench.clocks(16 * 12)
    assert [bit for (bit,) in bits_shown.values] == bits
    assert rx.bytes == data and len(rx.starts) == len(data), "its own characters are not received"


@cocotb.test()
async def reset_while_sending_returns_the_line_to_idle(dut):
    bench, _ = await ready_bench(dut, "8N1")
    await bench.send_stream(b"\x00", "send")
    await bench.clocks(30)
    assert dut.txd.value == 0
    dut.rst.value = 1
    await bench.clocks(2)
    assert dut.txd.value == 1 and dut.sending.value == 0


# All but those of the rows of uart_text.vh.
UNIT_TESTS = r"(?!\w+_of_a_waveform_)\w+"


@pytest.mark.rule("LINE-1", "LINE-3", "LINE-5", "FC-1", "FC-8")
def test_uart(sim):
    run("uart", "tb.rtl.test_uart", sim=sim, testcase=UNIT_TESTS)


def test_rows_of_a_waveform(sim, tmp_path):
    sources = copies_with_rows([ROOT / "rtl/uart.v"], tmp_path)
    run("uart", "tb.rtl.test_uart", sim=sim, sources=sources, testcase=r"\w+_of_a_waveform_\w+")
