# SPDX-License-Identifier: Apache-2.0
"""uart_tx: the formats, gap-free sending, and the bit time measured on the pin at every rate (LINE-4)."""

import math
import os
from pathlib import Path

import cocotb
import pytest

from tb.generated.card_tables import RATES
from tb.lib.bench import Bench
from tb.lib.runner import run
from tb.lib.seeds import seeded
from tb.lib.uart_agent import Format, Frame, UartMonitor

HERE = Path(__file__).parent
FORMATS = ("8N1", "8N2", "8E1", "8O1")
BAUD = 9600
TICKS_HZ = 16 * BAUD  # with tick16 held high a clock is a tick
LINE_4 = 0.001
TICK = 1 / 16
# The fewest bytes that show every bit level and both parities, with one more to measure against.
MEASURED = b"\x55\x01\xfe"
# Edges stand on clocks: over this many one clock is a quarter of what LINE-4 allows.
CLOCKS_MEASURED = 4000


def levels_of(form: str) -> dict[str, int]:
    return {
        "parity_enable": form[1] != "N",
        "parity_odd": form[1] == "O",
        "two_stop": form[2] == "2",
    }


def set_format(dut, form: str) -> None:
    for name, level in levels_of(form).items():
        getattr(dut, name).value = level


async def ready_bench(dut, form: str) -> tuple[Bench, UartMonitor]:
    bench = Bench(dut, TICKS_HZ, tick16=1, byte_valid=0, byte_data=0, **levels_of(form))
    monitor = UartMonitor(dut.txd, Format.named(BAUD, form))
    return await bench.start(), monitor


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def bytes_arrive_in_the_format_without_gaps(dut, form):
    rng = seeded("bytes")
    data = b"\x00\xff\x55\xaa" + rng.randbytes(12)
    bench, monitor = await ready_bench(dut, form)
    await bench.clocks(40)
    assert dut.txd.value == 1, "idle"
    await bench.give(data)
    frame = await monitor.frame(1e12)
    assert frame.ok and frame.data == data
    assert frame.largest_gap_ps < 0.01 * monitor.fmt.bit_ps
    assert monitor.measure(frame).worst_edge_ps < 0.01 * monitor.fmt.bit_ps


@cocotb.test()
@cocotb.parametrize(form=FORMATS)
async def busy_from_the_byte_taken_to_the_end_of_the_last_stop_bit(dut, form):
    bench, monitor = await ready_bench(dut, form)
    await bench.clocks(20)
    assert dut.busy.value == 0
    await bench.give(b"\xff")
    await bench.clocks(16 * monitor.fmt.bits - 1)
    assert dut.busy.value == 1, "a tick before the end"
    await bench.clocks()
    assert dut.busy.value == 0, "at the end"


@cocotb.test()
async def second_byte_late_by_a_tick_waits_for_no_border_but_starts_at_once(dut):
    bench, monitor = await ready_bench(dut, "8E1")
    await bench.clocks(5)
    await bench.give(b"\x12")
    await bench.clocks(16 * 11 + 7)
    await bench.give(b"\x34")
    frame = await monitor.frame(1e12)
    assert frame.data == b"\x12\x34"
    gap_ticks = frame.largest_gap_ps / (monitor.fmt.bit_ps * TICK)
    assert 0 < gap_ticks < 12


@cocotb.test()
async def idle_level_through_reset_even_while_sending(dut):
    bench, _ = await ready_bench(dut, "8N1")
    await bench.give(b"\x00")
    await bench.clocks(30)
    assert dut.txd.value == 0
    dut.rst.value = 1
    await bench.clocks(2)
    assert dut.txd.value == 1 and dut.busy.value == 0


def judge(monitor: UartMonitor, frame: Frame, what: str) -> None:
    fmt = monitor.fmt
    assert frame.ok, f"{what}: {frame}"
    timing = monitor.measure(frame)
    edge = timing.worst_edge_ps / fmt.bit_ps
    print(f"{what}: average {timing.error(fmt):+.4%}, worst edge {edge:.4f} bit")
    assert abs(timing.error(fmt)) <= LINE_4, what
    assert edge <= TICK, what


@cocotb.test()
async def bit_time_on_the_pin(dut):
    """Every rate from SLOWEST on, in every format of FORMS."""
    bench = Bench(dut, int(os.environ["CLK_HZ"]), rx=1, ratio=1, tx_valid=0, tx_data=0, **levels_of("8N1"))
    monitor = UartMonitor(dut.tx, Format())
    await bench.start()
    for rate in RATES.values():
        if rate.baud < int(os.environ["SLOWEST"]):
            continue
        for form in os.environ["FORMS"].split():
            dut.ratio.value = rate.ratio
            set_format(dut, form)
            monitor.fmt = Format.named(rate.baud, form)
            monitor.forget()
            await bench.clocks(3 * rate.ratio)
            clocks = (len(MEASURED) - 1) * monitor.fmt.character_ps / bench.period_ps
            data = MEASURED * math.ceil(CLOCKS_MEASURED / clocks)
            await bench.give(data, "tx")
            frame = await monitor.frame(1e12, gap_bits=2)
            assert frame.data == data
            judge(monitor, frame, f"{dut.CLK_HZ.value.to_unsigned()} Hz, {monitor.fmt}")


UNIT_TESTS = [
    "bytes_arrive_in_the_format_without_gaps",
    "busy_from_the_byte_taken_to_the_end_of_the_last_stop_bit",
    "second_byte_late_by_a_tick_waits_for_no_border_but_starts_at_once",
    "idle_level_through_reset_even_while_sending",
]


@pytest.mark.rule("LINE-1", "LINE-3", "FC-1", "FC-8")
def test_uart_tx(sim):
    run("uart_tx", "tb.test_uart_tx", sim=sim, testcase=UNIT_TESTS)


@pytest.mark.rule("LINE-2", "LINE-4")
@pytest.mark.parametrize(
    ("clk_hz", "slowest", "forms"),
    [
        (2_000_000, 300, FORMATS),
        (12_000_000, 300, ("8N2",)),
        (100_000_000, 9600, ("8E1",)),
    ],
)
def test_bit_time(sim, clk_hz, slowest, forms):
    run(
        "uart_chain",
        "tb.test_uart_tx",
        sim=sim,
        extra_sources=[HERE / "hdl/uart_chain.v"],
        parameters={"CLK_HZ": clk_hz},
        extra_env={"CLK_HZ": str(clk_hz), "SLOWEST": str(slowest), "FORMS": " ".join(forms)},
        testcase="bit_time_on_the_pin",
    )
