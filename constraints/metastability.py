# SPDX-License-Identifier: Apache-2.0
"""How long the two flip-flops of a serial pin last, on average, until one is still undecided (LINE-5).

    python -m constraints.metastability      the table of docs/guide/bring-up.md

The first flip-flop of rtl/prim/sync_2ff.v may hang between 0 and 1 when its pin changes with the clock. A
failure is a flip-flop that is still undecided when the second one reads it. The mean time between failures
in seconds, as vendors give it:

    MTBF = exp(SETTLING / TAU) / (WINDOW * clock * edges)

SETTLING is the time of the first flip-flop to decide: `make synth` demands MARGIN times the clock, so the
path to the second one leaves at least 1 - 1/MARGIN of the period. TAU (s) and WINDOW (s) belong to the
silicon. None were found for MachXO2, iCE40 or Gowin. Those here are of an older flash FPGA, the Actel
ProASIC Plus (application note AC312, the example: C2 = 1 / TAU, C1 = WINDOW). The last column gives the TAU
of a slower part that still does.
"""

from __future__ import annotations

import math

from constraints.synth import MARGIN
from rtl.command import run_main
from rtl.sources import configurations

CLOCKS_MHZ = sorted({25, 48, 100} | {entry["clk_hz"] / 1e6 for entry in configurations().values()})
TAU, WINDOW = 1 / 9.148e9, 1.56e-11
BITS = 115200 + 9600  # edges a second: both lines at full rate, another level with each bit
YEAR_S = 365.25 * 24 * 3600
ENOUGH_S = 1000 * YEAR_S


def settling_s(clock: float) -> float:
    return (1 - 1 / MARGIN) / clock


def log10_seconds(settling: float, clock: float, edges: float) -> float:
    """The logarithm of the MTBF: the number itself may be larger than a float."""
    return (settling / TAU - math.log(WINDOW * clock * edges)) / math.log(10)


def log10_years(clock: float, edges: float) -> float:
    return log10_seconds(settling_s(clock), clock, edges) - math.log10(YEAR_S)


def enough_tau(clock: float, edges: float) -> float:
    """The TAU with which the MTBF is still ENOUGH_S."""
    return settling_s(clock) / math.log(ENOUGH_S * WINDOW * clock * edges)


def power_of_ten(exponent: float) -> str:
    return f"10^{math.floor(exponent)}" if exponent >= 4 else f"{10**exponent:.0f}"


def table() -> str:
    rows = [
        "| clock | time to settle | years, edges of the bits only | years, both pins change with each clock"
        " | 1000 years with a TAU of |",
        "|---|---|---|---|---|",
    ]
    for mhz in CLOCKS_MHZ:
        clock = mhz * 1e6
        noise = 2 * clock
        tau = enough_tau(clock, noise)
        cells = (
            f"{mhz:g} MHz",
            f"{settling_s(clock) * 1e9:.1f} ns",
            power_of_ten(log10_years(clock, BITS)),
            power_of_ten(log10_years(clock, noise)),
            f"{tau * 1e9:.2f} ns, {tau / TAU:.1f} τ",
        )
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


if __name__ == "__main__":
    run_main("metastability", lambda: print(table()))
