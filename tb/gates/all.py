# SPDX-License-Identifier: Apache-2.0
"""The manual's examples on netlists of the whole card, with the bench of the whole card.

A netlist runs about 10 000 clocks a second, so each takes 3 to 4 minutes on an idle machine. Therefore
`make test-gates` runs them, not `make test`.
"""

import pytest

from constraints.boards import board
from constraints.image import up_to_date
from constraints.synth import build
from tb.gates.gowin import verilog
from tb.gates.netlists import GATES_HZ
from tb.gates.test_gates import run_gates
from tb.lib.runner import ROOT, firmware, run

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


@pytest.mark.rule("TOP-1", "LED-1", "LINE-7")
@pytest.mark.parametrize("name", ["card-gw1n-9"])
def test_the_finished_bitstream_answers(name):
    """What is in the flash: block RAMs, start values, wrapper and polarities, at the board's own clock."""
    entry = board(name)
    if not up_to_date(entry):
        build(entry)
    source = ROOT / f"build/gates/{name}.v"
    source.parent.mkdir(parents=True, exist_ok=True)
    source.write_text(verilog(entry, ROOT / f"build/synth/{name}/firmware.fs"))
    run(
        entry.top,
        "constraints.test_boards",
        sim="icarus",
        config=entry.config,
        sources=[source],
        testcase="answers_without_ever_having_been_reset",
        extra_env={"BOARD_CLK_HZ": str(entry.clk_hz)},
    )
