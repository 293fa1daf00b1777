# SPDX-License-Identifier: Apache-2.0
"""uart: all formats in both directions, error flags per byte, bad senders at the pin (LINE-5), sending
without gaps. Bit time on the pin at every rate (LINE-4)."""

import math
import os
from pathlib import Path

import cocotb
import pytest

from regs.generated.card_tables import RATES, Rate
from tb.agents.uart import Flaws, Format, Frame, UartMonitor, UartSource
from tb.lib.bench import Bench, Strobes
from tb.lib.runner import run
from tb.lib.seeds import seeded

HERE = Path(__file__).parent
FORMATS = ("8N1", "8N2", "8E1", "8O1")
BAUD = 9600
TICKS_HZ = 16 * BAUD  # with tick16 held high a clock is a tick
LINE_4 = 0.001
TICK = 1 / 16
# The shortest data with every bit level and both parities, plus one byte to measure against.
MEASURED = b"\x55\x01\xfe"
# Edges lie on clocks: over this many clocks, one clock is a quarter of the error that LINE-4 allows.
CLOCKS_MEASURED = 4000
QUIET = {"send_valid": 0, "send_data": 0, "send_check": 0, "check_bit": 0, "line_ready": 1, "line": 1}


def levels_of(form: str) -> dict[str, int]:
    return {
        "parity_enable": form[1] != "N",
        "parity_odd": form[1] == "O",
        "two_stop": form[2] == "2",
    }


def set_rate(dut, rate: Rate) -> None:
    dut.undivided.value, dut.mask.value = rate.ratio == 1, rate.mask


def set_format(dut, form: str) -> None:
    for name, level in levels_of(form).items():
        getattr(dut, name).value = level


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
@cocotb.parametrize(form=("8E1", "8O1"))
async def parity_error_is_reported_with_its_own_byte(dut, form):
    rx = await Receiver(dut, form).start()
    await rx.source.send(b"\x11\x22\x33\x44", Flaws(bad_parity=(1, 3)))
    await rx.source.idle(2)
    assert rx.bytes == b"\x11\x22\x33\x44"
    assert rx.flags == [(0, 0), (1, 0), (0, 0), (1, 0)]


@cocotb.test()
async def error_rows_of_a_waveform_are_high_with_a_flawed_byte_alone(dut):
    rows = [Strobes(dut, "parity_flaw"), Strobes(dut, "framing_flaw")]
    rx = await Receiver(dut, "8E1").start()
    await rx.source.send(b"\x11\x22\x33\x44\x55", Flaws(bad_parity=(1,), bad_stop=(3,), gaps={4: 3.0}))
    await rx.source.idle(2)
    for row, flawed in zip(rows, (1, 3), strict=True):
        assert row.times_ps == [rx.out.times_ps[flawed]]


@cocotb.test()
async def wrong_parity_of_the_sender_is_an_error_in_every_byte(dut):
    rx = await Receiver(dut, "8E1").start()
    await rx.source.send(bytes(range(8)), fmt=Format.named(BAUD, "8O1"))
    await rx.source.idle(2)
    assert rx.flags == [(1, 0)] * 8


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def missing_stop_bit_is_reported_with_its_own_byte(dut, form):
    rx = await Receiver(dut, form).start()
    gaps = {2: 3.0}  # the line must be high again before the next character
    await rx.source.send(b"\x11\x22\x33", Flaws(bad_stop=(1,), gaps=gaps))
    await rx.source.idle(2)
    assert rx.bytes == b"\x11\x22\x33"
    assert rx.flags == [(0, 0), (0, 1), (0, 0)]


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
async def single_bad_sample_in_the_middle_of_each_bit_is_outvoted(dut):
    rx = await Receiver(dut, "8E1").start()
    data = b"\x35\xca"
    for middle in (6.5, 7.5, 8.5):
        places = [(bit + middle * TICK, TICK) for bit in range(22)]
        await rx.source.send(data, Flaws(glitches=places))
        await rx.source.idle(3)
    assert rx.bytes == data * 3
    assert set(rx.flags) == {(0, 0)}


@cocotb.test()
async def the_three_samples_of_a_bit_are_a_tick_apart(dut):
    """A pulse shorter than a tick can affect only one of them, wherever it lies."""
    rx = await Receiver(dut, "8E1", clocks_a_tick=8).start()
    data = b"\x35"
    places = [6 + step / 8 for step in range(32)]
    for place in places:
        await rx.source.send(data, Flaws(glitches=[(bit + place * TICK, 0.9 * TICK) for bit in range(11)]))
        await rx.source.idle(3)
    assert rx.bytes == data * len(places)
    assert set(rx.flags) == {(0, 0)}


@cocotb.test()
async def receiving_ends_with_the_byte_in_the_middle_of_the_stop_bit(dut):
    rx = await Receiver(dut, "8E1").start()
    sent = await rx.source.send(b"\x77")
    await rx.source.idle(2)
    stop_bit_left = (sent.end_ps - rx.out.times_ps[0]) / rx.source.fmt.bit_ps
    assert 0.3 < stop_bit_left < 0.6


@cocotb.test()
async def reset_in_the_middle_of_a_byte_drops_it(dut):
    rx = await Receiver(dut, "8E1").start()
    sending = cocotb.start_soon(rx.source.send(b"\xfe"))
    await rx.source.idle(4)
    await rx.bench.strobe(dut.rst)
    await sending
    await rx.source.idle(12)
    assert len(rx.out) == 0


class Chain:
    """Synchroniser, filter and receiver, on a real clock."""

    def __init__(self, dut):
        self.dut = dut
        idle = {"undivided": 1, "mask": 0, "tx_valid": 0, "tx_data": 0}
        self.bench = Bench(dut, int(os.environ["CLK_HZ"]), **idle, **levels_of("8E1"))
        self.source = UartSource(dut.rx, Format())
        self.out = Strobes(dut, "rx_valid", "rx_data", "rx_parity_error", "rx_framing_error")
        self.starts = Strobes(dut, "start_seen")

    async def use(self, baud: int, form: str) -> None:
        set_rate(self.dut, next(rate for rate in RATES.values() if rate.baud == baud))
        set_format(self.dut, form)
        self.source.fmt = Format.named(baud, form)
        # The divider may still be early in a long tick.
        await self.bench.clocks(500)
        await self.source.idle(2)

    async def expect(self, data: bytes, flaws: Flaws, what: str) -> None:
        before = len(self.out)
        await self.source.send(data, flaws)
        await self.source.idle(1.5)
        got = self.out.values[before:]
        assert bytes(v[0] for v in got) == data, f"{what}: {bytes(v[0] for v in got).hex(' ')}"
        assert not any(v[1] or v[2] for v in got), f"{what}: errors {got}"


@cocotb.test()
async def sender_with_a_rate_error_of_four_percent_is_received(dut):
    chain = Chain(dut)
    await chain.bench.start()
    slowest, fastest = (int(os.environ[name]) for name in ("SLOWEST", "FASTEST"))
    for rate in RATES.values():
        if not slowest <= rate.baud <= fastest:
            continue
        # Back to back, so that an error of the start edge carries over into the next character.
        data = b"\x00\x55" if rate.baud < 2400 else b"\x00\x55\xff\x7e\x01\x80"
        for form in FORMATS:
            await chain.use(rate.baud, form)
            for ppm in (-40_000, 40_000):
                await chain.expect(data, Flaws(ppm=ppm), f"{rate.baud} {form} {ppm} ppm")


@cocotb.test()
async def jitter_and_unequal_slopes_are_tolerated(dut):
    rng = seeded("jitter")
    chain = Chain(dut)
    await chain.bench.start()
    for form in FORMATS:
        await chain.use(9600, form)
        for stretch in (-0.15, 0.15):
            flaws = Flaws(jitter=0.1, jitter_seed=rng.randrange(1 << 31), low_stretch=stretch)
            await chain.expect(rng.randbytes(8), flaws, f"{form}, {flaws}")


@cocotb.test()
async def glitch_of_less_than_a_quarter_bit_anywhere_in_a_character_is_ignored(dut):
    rng = seeded("bytes")
    chain = Chain(dut)
    await chain.bench.start()
    await chain.use(19200, "8E1")
    for eighth in range(1, 11 * 8):
        place = eighth / 8 + rng.uniform(-0.06, 0.06)
        await chain.expect(rng.randbytes(1), Flaws(glitches=[(place, 0.24)]), f"glitch at {place:.3f} bits")


@cocotb.test()
async def glitches_on_the_idle_line_are_ignored(dut):
    rng = seeded("glitches")
    chain = Chain(dut)
    await chain.bench.start()
    await chain.use(19200, "8E1")
    for _ in range(60):
        await chain.source.low_pulse(rng.uniform(0.01, 0.245) * chain.source.fmt.bit_ps)
        await chain.source.idle(rng.uniform(0.3, 2))
    await chain.source.idle(12)
    assert len(chain.starts) == 0 and len(chain.out) == 0


@cocotb.test()
async def line_low_from_power_up_is_a_break_and_no_character(dut):
    chain = Chain(dut)
    chain.source.hold(0)
    await chain.bench.start(reset_clocks=200, release=False)
    assert len(chain.starts) == 0
    dut.rst.value = 0
    await chain.use(19200, "8E1")
    await chain.source.idle(40)
    # A line that stays low is a break: one byte with a framing error.
    assert [v[2] for v in chain.out.values] == [1]
    chain.source.hold(1)
    await chain.source.idle(2)
    await chain.expect(b"\x3c", Flaws(), "after the line came back")


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
async def sending_is_set_from_the_start_bit_to_the_end_of_the_last_stop_bit(dut, form):
    bench, monitor = await ready_bench(dut, form)
    await bench.clocks(20)
    assert dut.sending.value == 0
    await bench.send_stream(b"\xff", "send")
    await bench.clocks()
    assert dut.sending.value == 0 and dut.txd.value == 1, "it begins at a tick"
    await bench.clocks()
    assert dut.sending.value == 1 and dut.txd.value == 0, "with the pin"
    await bench.clocks(16 * monitor.fmt.bits - 1)
    assert dut.sending.value == 1, "a tick before the end"
    await bench.clocks()
    assert dut.sending.value == 0, "at the end"


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def byte_given_in_the_last_tick_of_the_last_stop_bit_follows_without_a_gap(dut, form):
    bench, monitor = await ready_bench(dut, form)
    await bench.clocks(5)
    await bench.send_stream(b"\x12", "send")
    await bench.clocks(16 * monitor.fmt.bits - 1)
    assert dut.send_ready.value == 1
    await bench.send_stream(b"\x34", "send")
    frame = await monitor.frame(1e12)
    assert frame.ok and frame.data == b"\x12\x34"
    assert frame.largest_gap_ps < 0.01 * monitor.fmt.bit_ps


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
async def nothing_is_sent_before_the_line_is_ready(dut):
    bench, monitor = await ready_bench(dut, "8E1")
    dut.line_ready.value = 0
    await bench.send_stream(b"\x5a", "send")
    await bench.clocks(100)
    assert dut.sending.value == 0 and dut.txd.value == 1 and not monitor.characters
    dut.line_ready.value = 1
    frame = await monitor.frame(1e12)
    assert frame.ok and frame.data == b"\x5a"


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
async def late_second_byte_starts_at_once_without_waiting_for_a_bit_boundary(dut):
    bench, monitor = await ready_bench(dut, "8E1")
    await bench.clocks(5)
    await bench.send_stream(b"\x12", "send")
    await bench.clocks(16 * 11 + 7)
    await bench.send_stream(b"\x34", "send")
    frame = await monitor.frame(1e12)
    assert frame.data == b"\x12\x34"
    gap_ticks = frame.largest_gap_ps / (monitor.fmt.bit_ps * TICK)
    assert 0 < gap_ticks < 12


@cocotb.test()
async def reset_while_sending_returns_the_line_to_idle(dut):
    bench, _ = await ready_bench(dut, "8N1")
    await bench.send_stream(b"\x00", "send")
    await bench.clocks(30)
    assert dut.txd.value == 0
    dut.rst.value = 1
    await bench.clocks(2)
    assert dut.txd.value == 1 and dut.sending.value == 0


def check_bit_time(monitor: UartMonitor, frame: Frame, what: str) -> None:
    fmt = monitor.fmt
    assert frame.ok, f"{what}: {frame}"
    timing = monitor.measure(frame)
    edge = timing.worst_edge_ps / fmt.bit_ps
    print(f"{what}: average {timing.error(fmt):+.4%}, worst edge {edge:.4f} bit")
    assert abs(timing.error(fmt)) <= LINE_4, what
    assert edge <= TICK, what


@cocotb.test()
async def bit_time_on_the_pin_is_right_at_every_rate(dut):
    """Measures every rate from SLOWEST on, in every format of FORMS."""
    bench = Bench(
        dut, int(os.environ["CLK_HZ"]), rx=1, undivided=1, mask=0, tx_valid=0, tx_data=0, **levels_of("8N1")
    )
    monitor = UartMonitor(dut.tx, Format())
    await bench.start()
    for rate in RATES.values():
        if rate.baud < int(os.environ["SLOWEST"]):
            continue
        for form in os.environ["FORMS"].split():
            set_rate(dut, rate)
            set_format(dut, form)
            monitor.fmt = Format.named(rate.baud, form)
            monitor.forget()
            await bench.clocks(3 * rate.ratio)
            clocks = (len(MEASURED) - 1) * monitor.fmt.character_ps / bench.period_ps
            data = MEASURED * math.ceil(CLOCKS_MEASURED / clocks)
            await bench.send_stream(data, "tx")
            frame = await monitor.frame(1e12, gap_bits=2)
            assert frame.data == data
            check_bit_time(monitor, frame, f"{dut.CLK_HZ.value.to_unsigned()} Hz, {monitor.fmt}")


UNIT_TESTS = [
    "back_to_back_bytes_are_received_in_every_format",
    "parity_error_is_reported_with_its_own_byte",
    "wrong_parity_of_the_sender_is_an_error_in_every_byte",
    "missing_stop_bit_is_reported_with_its_own_byte",
    "one_stop_bit_is_enough_where_two_are_usual",
    "break_is_one_zero_with_framing_error_and_receiving_until_it_ends",
    "low_pulse_below_half_a_bit_is_no_start_bit",
    "single_bad_sample_in_the_middle_of_each_bit_is_outvoted",
    "the_three_samples_of_a_bit_are_a_tick_apart",
    "receiving_ends_with_the_byte_in_the_middle_of_the_stop_bit",
    "reset_in_the_middle_of_a_byte_drops_it",
    "bytes_are_sent_in_every_format_without_gaps",
    "sending_is_set_from_the_start_bit_to_the_end_of_the_last_stop_bit",
    "byte_given_in_the_last_tick_of_the_last_stop_bit_follows_without_a_gap",
    "next_byte_is_taken_from_the_parity_or_first_stop_bit_on",
    "nothing_is_sent_before_the_line_is_ready",
    "check_bits_are_sent_in_place_of_the_data_with_their_own_parity",
    "every_data_bit_reaches_the_check_unit_in_both_directions",
    "late_second_byte_starts_at_once_without_waiting_for_a_bit_boundary",
    "reset_while_sending_returns_the_line_to_idle",
]
PIN_TESTS = [
    "jitter_and_unequal_slopes_are_tolerated",
    "glitch_of_less_than_a_quarter_bit_anywhere_in_a_character_is_ignored",
    "glitches_on_the_idle_line_are_ignored",
    "line_low_from_power_up_is_a_break_and_no_character",
]


def run_chain(sim: str, clk_hz: int, testcase: str | list[str], **env: str) -> None:
    run(
        "uart_chain",
        "tb.rtl.test_uart",
        sim=sim,
        extra_sources=[HERE / "uart_chain.v"],
        parameters={"CLK_HZ": clk_hz},
        extra_env={"CLK_HZ": str(clk_hz), **env},
        testcase=testcase,
    )


@pytest.mark.rule("LINE-1", "LINE-3", "LINE-5", "FC-1", "FC-8")
def test_uart(sim):
    # A netlist has no rows for waveforms.
    rows = "error_rows_of_a_waveform_are_high_with_a_flawed_byte_alone"
    run("uart", "tb.rtl.test_uart", sim=sim, testcase=[*UNIT_TESTS, rows])


@pytest.mark.slow("icarus")
@pytest.mark.rule("LINE-5")
@pytest.mark.parametrize(
    ("clk_hz", "slowest", "fastest"),
    [(2_000_000, 300, 19_200), (7_372_800, 38_400, 115_200)],
)
def test_baud_error(sim, clk_hz, slowest, fastest):
    """In the second case the clock is 64 times the fastest rate, the least that the rule allows."""
    run_chain(
        sim,
        clk_hz,
        "sender_with_a_rate_error_of_four_percent_is_received",
        SLOWEST=str(slowest),
        FASTEST=str(fastest),
    )


@pytest.mark.rule("LINE-5")
def test_bad_lines(sim):
    run_chain(sim, 2_000_000, PIN_TESTS)


@pytest.mark.slow("icarus")
@pytest.mark.rule("LINE-2", "LINE-4")
@pytest.mark.parametrize(
    ("clk_hz", "slowest", "forms"),
    [
        (2_000_000, 300, FORMATS),
        pytest.param(12_000_000, 300, ("8N2",), marks=pytest.mark.slow),
        (100_000_000, 9600, ("8E1",)),
    ],
)
def test_bit_time(sim, clk_hz, slowest, forms):
    run(
        "uart_chain",
        "tb.rtl.test_uart",
        sim=sim,
        extra_sources=[HERE / "uart_chain.v"],
        parameters={"CLK_HZ": clk_hz},
        extra_env={"CLK_HZ": str(clk_hz), "SLOWEST": str(slowest), "FORMS": " ".join(forms)},
        testcase="bit_time_on_the_pin_is_right_at_every_rate",
    )
