# SPDX-License-Identifier: Apache-2.0
"""The figures for the two flip-flops of a serial pin, and the page that shows them."""

from __future__ import annotations

import pytest

from constraints import metastability
from rtl.sources import ROOT


def test_the_formula_gives_the_example_of_its_source():
    """AC312: 100 MHz, 12.5 million edges a second and 2.96 ns to settle are one year. The 2.96 is rounded."""
    seconds = 10 ** metastability.log10_seconds(2.96e-9, 100e6, 12.5e6)
    assert seconds == pytest.approx(365 * 24 * 3600, rel=0.1)


def test_the_slowest_tau_that_does_gives_that_time():
    clock, edges = 24e6, 48e6
    tau = metastability.enough_tau(clock, edges)
    assert tau > metastability.TAU
    # Settling in units of TAU is all that the formula takes.
    settling = metastability.settling_s(clock) * metastability.TAU / tau
    assert 10 ** metastability.log10_seconds(settling, clock, edges) == pytest.approx(
        1000 * metastability.YEAR_S, rel=1e-6
    )


def test_the_guide_has_the_printed_table():
    assert metastability.table() in (ROOT / "docs/guide/bring-up.md").read_text()
