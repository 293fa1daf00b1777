# SPDX-License-Identifier: Apache-2.0
"""The network port on the clock of a card: bad senders (LINE-5), and the bit time of every rate (LINE-4)."""

from __future__ import annotations

import os

import cocotb
import pytest

from regs.generated.card_tables import EXTENDED_RATES
from tb.agents import rtu
from tb.agents.uart import Flaws
from tb.lib.nightly import first
from tb.lib.runner import run
from tb.lib.seeds import cases, seeded
from tb.rtl.test_network_port import FORMATS, GOOD, OWN, SHORT, WRAPPER, Port, use
from tb.rtl.test_uart import TICK

LINE_4 = 0.001


def rates() -> list[int]:
    slowest, fastest = int(os.environ["SLOWEST"]), int(os.environ["FASTEST"])
    return [rate.baud for rate in EXTENDED_RATES.values() if slowest <= rate.baud <= fastest]


async def receives(port: Port, frame: bytes, flaws: Flaws) -> None:
    port.clear()
    await port.frame(frame, flaws)
    assert port.outcome() == (1, 1, 0), f"{port.line.fmt}, {flaws}: {port.counted()}"


@cocotb.test()
async def sender_with_a_rate_error_of_four_percent_is_received(dut):
    port = await Port(dut).start()
    for baud in rates():
        for form in FORMATS:
            await use(port, baud, form)
            for ppm in (-40_000, 40_000):
                # Back to back, so that an error of the start edge carries over into the next character.
                await receives(port, SHORT if baud < 2400 else GOOD, Flaws(ppm=ppm))


@cocotb.test()
async def jitter_and_unequal_slopes_are_tolerated(dut):
    rng = seeded("jitter")
    port = await Port(dut).start()
    for form in FORMATS:
        await use(port, 9600, form)
        for stretch in (-0.15, 0.15):
            flaws = Flaws(jitter=0.1, jitter_seed=rng.randrange(1 << 31), low_stretch=stretch)
            await receives(port, rtu.build(OWN, rng.randbytes(cases(2, 8))), flaws)


@cocotb.test()
async def glitch_of_less_than_a_quarter_bit_anywhere_in_a_character_is_ignored(dut):
    rng = seeded("places")
    port = await Port(dut).start()
    frame, apart = rtu.build(OWN, rng.randbytes(3)), port.line.fmt.bits + 1
    gaps = dict.fromkeys(range(1, len(frame)), 1.0)
    for eighth in range(1, 11 * 8, cases(5, 1)):
        place = eighth / 8 + rng.uniform(-0.06, 0.06)
        glitches = tuple((place + apart * n, 0.24) for n in range(len(frame)))
        await receives(port, frame, Flaws(glitches=glitches, gaps=gaps))


@cocotb.test()
async def bit_time_on_the_pin_is_right_at_every_rate(dut):
    """Edges lie on clocks: over 4000 clocks, one clock is a quarter of the error that LINE-4 allows."""
    port = await Port(dut).start()
    monitor = port.line.monitor
    for baud in rates():
        for form in os.environ["FORMS"].split():
            await use(port, baud, form)
            # The shortest data with every bit level and both parities, and more of it at the fast rates.
            port.memory.memory = b"\x55\x01\xfe" * (10 if baud > 19_200 else 1)
            dut.reply_length.value = len(port.memory.memory)
            await port.bench.strobe(dut.reply_start)
            frame = await monitor.frame(1e12, gap_bits=3)
            assert frame.ok and frame.data == rtu.with_crc(port.memory.memory), f"{monitor.fmt}: {frame}"
            timing = monitor.measure(frame)
            edge = timing.worst_edge_ps / monitor.fmt.bit_ps
            print(f"{monitor.fmt}: average {timing.error(monitor.fmt):+.4%}, worst edge {edge:.4f} bit")
            assert abs(timing.error(monitor.fmt)) <= LINE_4 and edge <= TICK, monitor.fmt


def run_line(clk_hz: int, *testcase: str, slowest: int = 9600, fastest: int = 115_200, forms=FORMATS) -> None:
    run(
        "network_line",
        "tb.rtl.test_uart_chain",
        sim="verilator",
        extra_sources=[WRAPPER],
        parameters={"CLK_HZ": clk_hz},
        extra_env={"SLOWEST": str(slowest), "FASTEST": str(fastest), "FORMS": " ".join(forms)},
        testcase=testcase,
    )


# In the last case the clock is 64 times the fastest rate, the least that the rule allows.
RATES = [(2_000_000, 19_200, 19_200), (2_000_000, 300, 9600), (7_372_800, 38_400, 115_200)]


@pytest.mark.rule("LINE-5")
@pytest.mark.parametrize("rates", first(RATES), ids=str)
def test_baud_error(rates):
    run_line(rates[0], "sender_with_.*", slowest=rates[1], fastest=rates[2])


@pytest.mark.rule("LINE-5")
def test_bad_lines():
    run_line(2_000_000, "jitter_.*", "glitch_.*")


CASES = [(2_000_000, 9600, ("8E1",)), (2_000_000, 300, FORMATS), (12_000_000, 300, ("8N2",))]
CASES += [(100_000_000, 9600, ("8E1",))]


@pytest.mark.rule("LINE-2", "LINE-4")
@pytest.mark.parametrize("case", first(CASES), ids=lambda case: f"{case[0]}-{case[1]}")
def test_bit_time(case):
    run_line(case[0], "bit_time_.*", slowest=case[1], forms=case[2])
