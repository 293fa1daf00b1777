# SPDX-License-Identifier: Apache-2.0
"""The manual's examples on netlists of the whole card, with the bench of the whole card.

A netlist runs about 10 000 clocks a second, so each takes 3 to 4 minutes on an idle machine. Therefore
`make test-gates` runs them, not `make test`.
"""

import pytest

from tb.gates.netlists import GATES_HZ
from tb.gates.test_gates import run_gates
from tb.lib.runner import firmware

NETLISTS = [("ice40", "standard"), ("ice40", "tiny"), ("machxo2", "standard"), ("machxo2", "tiny")]


@pytest.mark.rule("TOP-1", "TOP-2", "PERF-4")
@pytest.mark.parametrize(("family", "card"), NETLISTS)
def test_every_example(family, card):
    """At the slowest clock that the mapper takes (GATES_HZ)."""
    parameters = {"CLK_HZ": GATES_HZ[family], "FIRMWARE_HEX": str(firmware(card))}
    run_gates(
        family,
        "rtu2fc",
        parameters,
        card,
        testcase="every_example_is_right_byte_for_byte_on_both_lines",
    )
