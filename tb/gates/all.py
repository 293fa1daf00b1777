# SPDX-License-Identifier: Apache-2.0
"""The manual's examples on finished images, with the bench of the whole card: `make test-gates`."""

from pathlib import Path

import pytest

from constraints.boards import board
from tb.gates.images import netlist, with_wrong_tables, with_wrong_word, world
from tb.lib.runner import run

EXAMPLES = "every_example_is_right_byte_for_byte_on_both_lines"
IMAGES = ["card-gw1n-9", "hx8k-breakout", "card-xo2-1200"]
each_image = pytest.mark.parametrize("name", IMAGES)


@pytest.mark.rule("TOP-1", "LED-1", "LINE-7")
@each_image
def test_a_finished_image_answers(name):
    """What is in the flash: block RAMs, start values, wrapper and polarities, at the board's own clock.

    On Icarus, which has x: a flip-flop or a block RAM without a start value would show.
    """
    entry = board(name)
    run(
        entry.top,
        "constraints.test_boards",
        sim="icarus",
        config=entry.config,
        sources=[netlist(entry)],
        testcase="answers_without_ever_having_been_reset",
        extra_env={"BOARD_CLK_HZ": str(entry.clk_hz)},
    )


def run_examples(name: str, image: Path) -> None:
    """Runs the manual's examples on an image behind its switches and LEDs, as the whole card."""
    entry = board(name)
    run(
        "rtu2fc",
        "tb.card.test_rtu2fc",
        sim="verilator",
        config=entry.config,
        parameters={"CLK_HZ": entry.clk_hz, "FIRMWARE_HEX": str(entry.firmware)},
        sources=[image, world(entry)],
        testcase=EXAMPLES,
        extra_env={"CARD_BAUD": "19200"},
    )


@pytest.mark.rule("TOP-1", "TOP-2", "LINE-6", "LED-2")
@each_image
def test_every_example_on_a_finished_image(name):
    """At the board's own clock; on Verilator, because Icarus is too slow there."""
    run_examples(name, netlist(board(name)))


@each_image
@pytest.mark.parametrize("change", [with_wrong_tables, with_wrong_word])
def test_a_changed_image_is_found(name, change, tmp_path):
    """Some inverted look-up tables, one changed bit of a block RAM."""
    changed = tmp_path / "changed.v"
    changed.write_text(change(netlist(board(name)).read_text()))
    with pytest.raises(pytest.fail.Exception, match="1 of 1 cocotb tests failed"):
        run_examples(name, changed)
