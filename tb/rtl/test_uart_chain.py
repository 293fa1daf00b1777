# SPDX-License-Identifier: Apache-2.0
"""A character from pin to byte: bad senders and glitches (LINE-5), the bit time of every rate (LINE-4)."""

from __future__ import annotations

import math
import os
from pathlib import Path

import cocotb
import pytest

from regs.generated.card_tables import EXTENDED_RATES, Rate
from tb.agents.uart import Flaws, Format, Frame, UartMonitor, UartSource
from tb.lib.bench import Bench, Strobes
from tb.lib.nightly import first
from tb.lib.runner import run
from tb.lib.seeds import cases, seeded
from tb.rtl.test_uart import FORMATS, TICK, levels_of, set_format

HERE = Path(__file__).parent
LINE_4 = 0.001
# The shortest data with every bit level and both parities, plus one byte to measure against.
MEASURED = b"\x55\x01\xfe"
# Edges lie on clocks: over this many clocks, one clock is a quarter of the error that LINE-4 allows.
CLOCKS_MEASURED = 4000


def set_rate(dut, rate: Rate) -> None:
    dut.undivided.value, dut.mask.value = rate.ratio == 1, rate.mask


class Line:
    """A source at the pin, on the clock of a card."""

    def __init__(self, dut):
        self.dut = dut
        idle = {"undivided": 1, "mask": 0, "tx_valid": 0, "tx_data": 0}
        self.bench = Bench(dut, int(os.environ["CLK_HZ"]), **idle, **levels_of("8E1"))
        self.source = UartSource(dut.rx, Format())
        self.out = Strobes(dut, "rx_valid", "rx_data", "rx_parity_error", "rx_framing_error")
        self.starts = Strobes(dut, "start_seen")

    async def use(self, baud: int, form: str) -> None:
        set_rate(self.dut, next(rate for rate in EXTENDED_RATES.values() if rate.baud == baud))
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
    line = Line(dut)
    await line.bench.start()
    slowest, fastest = (int(os.environ[name]) for name in ("SLOWEST", "FASTEST"))
    for rate in EXTENDED_RATES.values():
        if not slowest <= rate.baud <= fastest:
            continue
        # Back to back, so that an error of the start edge carries over into the next character.
        data = b"\x00\x55" if rate.baud < 2400 else b"\x00\x55\xff\x7e\x01\x80"
        for form in FORMATS:
            await line.use(rate.baud, form)
            for ppm in (-40_000, 40_000):
                await line.expect(data, Flaws(ppm=ppm), f"{rate.baud} {form} {ppm} ppm")


@cocotb.test()
async def jitter_and_unequal_slopes_are_tolerated(dut):
    rng = seeded("jitter")
    line = Line(dut)
    await line.bench.start()
    for form in FORMATS:
        await line.use(9600, form)
        for stretch in (-0.15, 0.15):
            flaws = Flaws(jitter=0.1, jitter_seed=rng.randrange(1 << 31), low_stretch=stretch)
            await line.expect(rng.randbytes(cases(2, 8)), flaws, f"{form}, {flaws}")


@cocotb.test()
async def glitch_of_less_than_a_quarter_bit_anywhere_in_a_character_is_ignored(dut):
    rng = seeded("bytes")
    line = Line(dut)
    await line.bench.start()
    await line.use(19200, "8E1")
    for eighth in range(1, 11 * 8, cases(5, 1)):
        place = eighth / 8 + rng.uniform(-0.06, 0.06)
        await line.expect(rng.randbytes(1), Flaws(glitches=[(place, 0.24)]), f"glitch at {place:.3f} bits")


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
    for rate in EXTENDED_RATES.values():
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


MORE_RATES = [(2_000_000, 300, 9600), (7_372_800, 38_400, 115_200)]
PIN_TESTS = [
    "jitter_and_unequal_slopes_are_tolerated",
    "glitch_of_less_than_a_quarter_bit_anywhere_in_a_character_is_ignored",
]


def run_line(clk_hz: int, testcase: str | list[str], **env: str) -> None:
    run(
        "uart_chain",
        "tb.rtl.test_uart_chain",
        sim="verilator",
        extra_sources=[HERE / "uart_chain.v"],
        parameters={"CLK_HZ": clk_hz},
        extra_env={"CLK_HZ": str(clk_hz), **env},
        testcase=testcase,
    )


@pytest.mark.rule("LINE-5")
@pytest.mark.parametrize("rates", first([(2_000_000, 19_200, 19_200), *MORE_RATES]), ids=str)
def test_baud_error(rates):
    """In the last case the clock is 64 times the fastest rate, the least that the rule allows."""
    clk_hz, slowest, fastest = rates
    run_line(
        clk_hz,
        "sender_with_a_rate_error_of_four_percent_is_received",
        SLOWEST=str(slowest),
        FASTEST=str(fastest),
    )


@pytest.mark.rule("LINE-5")
def test_bad_lines():
    run_line(2_000_000, PIN_TESTS)


@pytest.mark.rule("LINE-2", "LINE-4")
@pytest.mark.parametrize(
    "case",
    first(
        [
            (2_000_000, 9600, ("8E1",)),
            (2_000_000, 300, FORMATS),
            (12_000_000, 300, ("8N2",)),
            (100_000_000, 9600, ("8E1",)),
        ]
    ),
    ids=lambda case: f"{case[0]}-{case[1]}",
)
def test_bit_time(case):
    clk_hz, slowest, forms = case
    run_line(
        clk_hz,
        "bit_time_on_the_pin_is_right_at_every_rate",
        SLOWEST=str(slowest),
        FORMS=" ".join(forms),
    )
