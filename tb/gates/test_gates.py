# SPDX-License-Identifier: Apache-2.0
"""Modules after synthesis, as cells, with their own benches: the mapping kept their function.

`make test-gates` runs the whole card from its finished images (tb/gates/all.py), minutes for each family.
"""

import pytest

from constraints.parts import COUNTED_ON
from rtl.sources import bench_file
from tb.gates import machxo2
from tb.gates.netlists import netlist
from tb.lib.nightly import first
from tb.lib.runner import run
from tb.rtl import test_firmware_ram as ram
from tb.rtl.test_uart import UNIT_TESTS

# All tests of the gate except those that flip a register by its name in the Verilog, and those of options.
BY_PORTS = r"(?!no_single_bit|a_flipped|stop_|second_)\w+"

each_family = pytest.mark.parametrize("family", COUNTED_ON)
# One family is enough for the benches of modules.
first_family = pytest.mark.parametrize("family", first([*COUNTED_ON]))


def run_gates(family: str, top: str, parameters=None, **more) -> None:
    """Runs on Icarus, where x shows a flip-flop without a defined start value."""
    parameters = parameters or {}
    bench = ".".join(bench_file(top).with_suffix("").parts)
    sources = netlist(family, top, parameters)
    run(top, bench, sim="icarus", parameters=parameters, sources=sources, **more)


@pytest.mark.nightly
@pytest.mark.rule("FRAME-6", "FRAME-7")
@first_family
def test_commit_gate_in_cells(family):
    run_gates(family, "commit_gate", testcase=BY_PORTS)


@pytest.mark.rule("LINE-1", "LINE-5")
@first_family
def test_uart_in_cells(family):
    run_gates(family, "uart", testcase=UNIT_TESTS)


@pytest.mark.rule("TOP-1")
@pytest.mark.nightly
@each_family
def test_firmware_memory_in_block_rams(family, tmp_path):
    """As large as the tiny card's memory, so that it is mapped to block RAMs."""
    words = 1536
    hex_file = tmp_path / "image.hex"
    ram.write_image(hex_file, words)
    run_gates(
        family,
        "firmware_ram",
        {"BYTES": 4 * words, "FIRMWARE_HEX": str(hex_file)},
        extra_env={"WORDS": str(words)},
    )


# ---------------------------------------------------------------- the readers of finished images

SLICE = """.tile R3C5:PLC
arc: A0 H02E0201
word: SLICEB.K1.INIT 1000000000000000
enum: SLICEB.REG1.REGSET RESET
enum: SLICEB.CEMUX INV

"""


def at(place: str, **parameters: str) -> dict:
    return {"attributes": {"NEXTPNR_BEL": f"X4/Y3/SLICEB.{place}"}, "parameters": parameters}


@pytest.mark.parametrize(
    ("place", "parameters", "same"),
    [
        ("K1", {"INITVAL": "1000000000000000"}, True),
        ("K1", {"INITVAL": "1000000000000001"}, False),
        # A table that is not named has ones alone.
        ("K0", {"INITVAL": "1" * 16}, True),
        ("K0", {"INITVAL": "1000000000000000"}, False),
        ("FF1", {"REGSET": "RESET", "SD": "1 ", "CEMUX": "INV"}, True),
        ("FF1", {"REGSET": "SET", "SD": "1 ", "CEMUX": "INV"}, False),
        ("FF1", {"REGSET": "RESET", "SD": "0 ", "CEMUX": "INV"}, False),
        ("FF1", {"REGSET": "RESET", "SD": "1 ", "CEMUX": "CE"}, False),
        ("FF0", {"REGSET": "SET", "SD": "1 ", "CEMUX": "INV"}, True),
        ("FF0", {"REGSET": "RESET", "SD": "1 ", "CEMUX": "INV"}, False),
    ],
)
def test_a_cell_that_differs_from_its_slice_is_found(place, parameters, same):
    assert (machxo2.Slices(SLICE).differs("cell", at(place, **parameters)) is None) == same


def test_the_inputs_of_a_look_up_table_may_be_exchanged():
    """A AND NOT B in every order of four inputs; NOT A OR B is another table."""
    orders = machxo2.orders_of(0x2222)
    assert len(orders) == 12 and {0x2222, 0x4444, 0x00AA} < orders and 0xDDDD not in orders
