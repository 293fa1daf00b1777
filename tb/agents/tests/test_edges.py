# SPDX-License-Identifier: Apache-2.0
"""The judge of edges on drawn edges: each limit from its rule, just inside and just outside.

Rules: 1 % of the rate ("MODBUS over Serial Line" V1.02, page 20); 1.5 and 3.5 characters of 11 bits, above
19200 bit/s 750 and 1750 us (page 13). A character of 8N1 has 10 bits. The other limits are those of `Limits`.
"""

from __future__ import annotations

import pytest
from cocotbext.rtu.edges import Limits, Trace, judge, measure
from cocotbext.rtu.rs485 import Pulse
from cocotbext.rtu.uart import Format

DATA = b"\x55\x0f\x33"
START_PS = 5_000_000_000
LINES = [
    (9600, "8E1", 16.5, 38.5),
    (19200, "8O1", 16.5, 38.5),
    (19200, "8N1", 15, 35),
    (1200, "8N2", 16.5, 38.5),
    (38400, "8E1", 28.8, 67.2),
    (115200, "8N2", 86.4, 201.6),
    (115200, "8N1", 86.4, 201.6),
]


def drawn(
    fmt: Format,
    data: bytes = DATA,
    *,
    gaps: dict[int, float] | None = None,
    slow: dict[int, float] | None = None,
    moved: dict[int, float] | None = None,
) -> Trace:
    """A recorded pin with these bytes.

    By the number of a character: gaps, idle bits before it; slow, part by which its bits are longer; moved,
    bits by which the edge after its bit 4 comes late.
    """
    edges, level, at = [], 1, 0.0
    for number, byte in enumerate(data):
        at += (gaps or {}).get(number, 0.0)
        length = 1 + (slow or {}).get(number, 0.0)
        ones = bin(byte).count("1")
        parity = {"N": [], "E": [ones % 2], "O": [1 - ones % 2]}[fmt.parity]
        bits = [0, *(byte >> n & 1 for n in range(8)), *parity, *[1] * fmt.stop_bits]
        for place, bit in enumerate(bits):
            if bit != level:
                late = (moved or {}).get(number, 0.0) if place == 5 else 0.0
                edges.append((round(START_PS + (at + place * length + late) * fmt.bit_ps), bit))
                level = bit
        at += len(bits)
    return Trace(fmt, edges)


def faults(trace: Trace, **how: object) -> list[str]:
    return judge(trace, trace.frame(), **how)


def pulse(trace: Trace, lead: float, lag: float | None) -> list[Pulse]:
    """DE around all characters, in bits from their first start and their last end."""
    first, last, bit = trace.characters[0].start_ps, trace.characters[-1].end_ps, trace.fmt.bit_ps
    return [Pulse(round(first - lead * bit), None if lag is None else round(last + lag * bit))]


@pytest.mark.parametrize(("baud", "form", "t15", "t35"), LINES)
def test_a_good_frame_has_no_fault(baud, form, t15, t35):
    trace = drawn(Format.named(baud, form))
    assert bytes(c.byte for c in trace.characters) == DATA
    request_end = START_PS - t35 * trace.fmt.bit_ps
    assert faults(trace, request_end_ps=request_end, pulses=pulse(trace, 0.5, 0.5)) == []


@pytest.mark.parametrize(("part", "found"), [(0.009, 0), (0.011, 1), (-0.009, 0), (-0.011, 1)])
def test_the_rate_may_be_off_by_one_percent(part, found):
    trace = drawn(Format(), slow=dict.fromkeys(range(3), part))
    assert measure(trace, trace.frame()).rate == pytest.approx(part, abs=0.0002)
    assert len(faults(trace)) == found and all("rate off by" in text for text in faults(trace))


@pytest.mark.parametrize("place", range(3))
def test_the_rate_is_that_of_all_characters(place):
    """One character in three is off: by 2 %, which all three together are not, and by 5 %."""
    within, beyond = (drawn(Format(), slow={place: part}) for part in (0.02, 0.05))
    assert measure(within, within.frame()).rate == pytest.approx(0.02 / 3, abs=0.002)
    assert faults(within, limits=Limits(edge_bits=None)) == []
    assert len(faults(beyond, limits=Limits(edge_bits=None))) == 1


@pytest.mark.parametrize("place", range(3))
def test_an_edge_is_judged_in_every_character(place):
    within, beyond = (drawn(Format(), b"\x55" * 3, moved={place: bits}) for bits in (0.22, 0.28))
    limits = Limits(rate=None)
    assert measure(within, within.frame()).worst_edge_bits == pytest.approx(0.22, abs=0.001)
    assert faults(within, limits=limits) == []
    assert faults(beyond, limits=limits) == ["an edge 0.28 bits off its place, limit 0.25"]


@pytest.mark.parametrize(("baud", "form", "t15", "t35"), LINES)
@pytest.mark.parametrize("place", [1, 2])
def test_a_gap_may_last_one_and_a_half_characters(baud, form, t15, t35, place):
    fmt = Format.named(baud, form)
    assert faults(drawn(fmt, gaps={place: t15 - 0.2})) == []
    found = faults(drawn(fmt, gaps={place: t15 + 0.2}))
    assert found == [f"a gap of {t15 + 0.2:.1f} bits inside the frame, limit {t15:.1f}"]


@pytest.mark.parametrize(("baud", "form", "t15", "t35"), LINES)
def test_a_reply_starts_three_and_a_half_characters_after_its_request(baud, form, t15, t35):
    trace = drawn(Format.named(baud, form))

    def found(after: float, **limits: float) -> list[str]:
        end = START_PS - after * trace.fmt.bit_ps
        return faults(trace, request_end_ps=end, limits=Limits(**limits))

    assert found(t35 - 0.2) == found(t35 + 500) == []
    assert found(t35 - 0.3) == [f"starts {t35 - 0.3:.1f} bits after the request, t3.5 is {t35:.1f}"]
    assert found(t35 - 4.9, early_bits=5.0) == [] and len(found(t35 - 5.1, early_bits=5.0)) == 1


@pytest.mark.parametrize(
    ("lag", "found"),
    [
        (0.95, []),
        (1.05, ["DE falls 1.05 bits after the last stop bit, limit 1"]),
        (4.0, ["DE falls 4.00 bits after the last stop bit, limit 1"]),
        (0.0, []),
        (-0.08, []),
        (-0.12, ["DE falls 0.12 bits before the end of the last stop bit"]),
        (-0.5, ["DE falls 0.50 bits before the end of the last stop bit"]),
        (None, ["DE is still high"]),
    ],
)
@pytest.mark.parametrize("form", ["8E1", "8N2"])
def test_de_falls_with_the_last_stop_bit(lag, found, form):
    trace = drawn(Format.named(9600, form))
    assert faults(trace, pulses=pulse(trace, 0.5, lag)) == found


@pytest.mark.parametrize("limit", [0.5, 2.0])
def test_the_limits_of_de_are_those_that_were_given(limit):
    trace = drawn(Format())
    limits = Limits(de_lead_bits=limit, de_lag_bits=limit, de_cut_bits=limit)
    for inside, outside in (
        ((0.98, 0.98), (1.02, 0.98)),
        ((0.98, -0.98), (0.98, 1.02)),
        ((0, 0), (0, -1.02)),
    ):
        for (lead, lag), found in ((inside, 0), (outside, 1)):
            pulses = pulse(trace, lead * limit, lag * limit)
            assert len(faults(trace, pulses=pulses, limits=limits)) == found, (lead, lag)


def test_de_that_is_low_at_the_first_start_bit_is_a_fault():
    trace = drawn(Format())
    assert faults(trace, pulses=[]) == ["DE is low at its first start bit"]
    assert faults(trace, pulses=pulse(trace, -0.1, 0.5)) == ["DE is low at its first start bit"]
