# SPDX-License-Identifier: Apache-2.0
"""Modules after synthesis, cell by cell, under their own benches: that what was mapped is what was written.

The whole card takes minutes a family: `make test-gates` (tb/gates/all.py).
"""

import re

import pytest

from tb import test_firmware_ram as ram
from tb.lib.gates import netlist
from tb.lib.runner import run
from tb.test_uart import UNIT_TESTS
from tools.synth import COUNTED_ON

each_family = pytest.mark.parametrize("family", COUNTED_ON)


def run_gates(family: str, top: str, parameters=None, config: str = "standard", **more) -> None:
    """On Icarus, which knows x: a flip-flop without a defined start would show."""
    parameters = parameters or {}
    bench = f"tb.test_{top}"
    sources = netlist(family, top, config, parameters)
    run(top, bench, sim="icarus", config=config, parameters=parameters, sources=sources, **more)


@pytest.mark.rule("FRAME-6", "FRAME-7")
@each_family
def test_commit_gate_in_cells(family):
    run_gates(family, "commit_gate")


@pytest.mark.rule("LINE-1", "LINE-5")
@each_family
def test_uart_in_cells(family):
    run_gates(family, "uart", testcase=UNIT_TESTS)


@pytest.mark.rule("TOP-1")
@each_family
def test_firmware_memory_in_block_rams(family, tmp_path):
    """As large as the small card's, so that it is mapped to block RAMs."""
    words = 1536
    hex_file = tmp_path / "image.hex"
    ram.write_image(hex_file, words)
    run_gates(
        family,
        "firmware_ram",
        {"BYTES": 4 * words, "FIRMWARE_HEX": str(hex_file)},
        extra_env={"WORDS": str(words)},
    )


@each_family
def test_a_wrong_look_up_table_is_noticed(family, tmp_path):
    """The first content in the netlist upside down."""
    cells, gates = netlist(family, "commit_gate", "standard", {})
    upside_down = {": 0;": ": 1;", ": 1;": ": 0;"}
    wrong = re.sub(
        r"^table .*",
        lambda row: re.sub(r": [01];", lambda m: upside_down[m[0]], row[0]),
        gates.read_text(),
        count=1,
        flags=re.MULTILINE,
    )
    spoilt = tmp_path / gates.name
    spoilt.write_text(wrong)
    assert wrong != gates.read_text()
    with pytest.raises(pytest.fail.Exception, match=r"of \d+ cocotb tests failed"):
        run("commit_gate", "tb.test_commit_gate", sim="icarus", sources=[cells, spoilt])
