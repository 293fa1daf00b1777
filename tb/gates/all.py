# SPDX-License-Identifier: Apache-2.0
"""The whole card on netlists, under its own bench: minutes each, so `make test-gates` and not `make test`.

A netlist of the standard card runs about 1000 clocks a second: example 1 takes two to five minutes.
"""

import pytest

from tb.lib.runner import firmware
from tb.test_gates import run_gates

CLK_HZ = 2_000_000
NETLISTS = [("ice40", "standard"), ("machxo2", "standard"), ("machxo2", "tiny")]


def run_card(family: str, config: str, testcase: str) -> None:
    parameters = {"CLK_HZ": CLK_HZ, "FIRMWARE_HEX": str(firmware(config))}
    run_gates(family, "rtu2fc", parameters, config, testcase=testcase)


@pytest.mark.rule("TOP-1", "PERF-4")
@pytest.mark.parametrize(("family", "config"), NETLISTS)
def test_first_example(family, config):
    """With gaps in the request; the shortest run there is."""
    run_card(family, config, "gap_of_1_4_characters_is_no_gap")


@pytest.mark.rule("TOP-1", "PERF-4")
@pytest.mark.parametrize(("family", "config"), NETLISTS)
def test_every_example(family, config):
    run_card(family, config, "every_example_is_right_byte_for_byte_on_both_lines")
