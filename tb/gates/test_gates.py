# SPDX-License-Identifier: Apache-2.0
"""Modules after synthesis, as cells, with their own benches: the mapping kept their function.

`make test-gates` runs the whole card (tb/gates/all.py), which takes minutes for each family.
"""

import itertools
import re
import subprocess

import pytest

from constraints.boards import board, ports
from constraints.image import ImageError
from constraints.parts import COUNTED_ON
from rtl.sources import bench_file
from tb.gates import ice40, machxo2
from tb.gates.netlists import cells, netlist, with_fast_tables, with_joined_flip_flops
from tb.lib.nightly import first
from tb.lib.runner import run
from tb.lib.seeds import seeded
from tb.rtl import test_firmware_ram as ram
from tb.rtl.test_uart import UNIT_TESTS

# All tests of the gate except those that flip a register by its name in the Verilog.
BY_PORTS = r"(?!no_single_bit|a_flipped|stop_)\w+"

each_family = pytest.mark.parametrize("family", COUNTED_ON)
# One family is enough for the benches of modules.
first_family = pytest.mark.parametrize("family", first([*COUNTED_ON]))


def run_gates(family: str, top: str, parameters=None, config: str = "standard", **more) -> None:
    """Runs on Icarus, where x shows a flip-flop without a defined start value."""
    parameters = parameters or {}
    bench = ".".join(bench_file(top).with_suffix("").parts)
    sources = netlist(family, top, config, parameters)
    run(top, bench, sim="icarus", config=config, parameters=parameters, sources=sources, **more)


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


def test_the_words_of_a_block_ram_are_its_parameters():
    words = [seeded("words").randrange(512) for _ in range(machxo2.BRAM_WORDS)]
    rows = re.findall(r"\.(INITVAL_\w\w)\(320'h(\w+)\)", machxo2.initvals(words))
    cell = {"parameters": {name: f"{int(value, 16):0320b}" for name, value in rows}}
    assert machxo2.initial_words(cell) == words


def test_an_image_without_one_of_the_ports_is_refused():
    entry = board("hx8k-breakout")
    declared = ", ".join(f"{way} {port}" for port, way in ports(entry.wrapper).items() if "[" not in port)
    text = f"module {entry.top} (input [9:1] \\sw_baud_n , input [8:1] \\sw_addr_n , {declared});\n"
    assert ice40.with_header(entry, text).count(";\n") == 1 + 13
    with pytest.raises(ImageError, match="has other ports than hx8k_breakout"):
        ice40.with_header(entry, text.replace("input clk", "output clk"))


# ---------------------------------------------------------------- the fast cell models

FLIP_FLOPS = {
    "ice40": [
        ("SB_DFF", {}, "D", {"C": "c"}),
        ("SB_DFFE", {}, "D", {"C": "c", "E": "e"}),
        ("SB_DFFSR", {}, "D", {"C": "c", "R": "r"}),
        ("SB_DFFSS", {}, "D", {"C": "c", "S": "r"}),
        ("SB_DFFESR", {}, "D", {"C": "c", "E": "e", "R": "r"}),
        ("SB_DFFESS", {}, "D", {"C": "c", "E": "e", "S": "r"}),
    ],
    "machxo2": [
        (
            "TRELLIS_FF",
            {"CEMUX": enable, "CLKMUX": "CLK", "LSRMUX": "LSR", "REGSET": value, "SRMODE": "LSR_OVER_CE"},
            "DI",
            {"CLK": "c", "CE": "e", "LSR": clear},
        )
        for enable, value, clear in itertools.product(("1", "CE", "INV"), ("SET", "RESET"), ("r", "1'h0"))
    ],
}
TABLES = {
    "ice40": ("SB_LUT4", "LUT_INIT", ("I0", "I1", "I2", "I3"), "O"),
    "machxo2": ("LUT4", "INIT", "ABCD", "Z"),
}
STIMULI = 4000


def instance(cell: str, parameters: dict[str, str], name: str, pins: dict[str, str]) -> str:
    """An instance as written by Yosys."""
    sets, joins = (
        ",\n".join(f"    .{name}({value})" for name, value in part.items()) for part in (parameters, pins)
    )
    return f"  {cell} " + (f"#(\n{sets}\n  ) " if sets else "") + f"{name} (\n{joins}\n  );\n"


def each_cell(family: str, inits: list[int]) -> tuple[str, int]:
    """A netlist of two flip-flops of each kind and of look-up tables, as by Yosys; number of outputs."""
    lines, outputs = "", 0
    for cell, parameters, data, pins in FLIP_FLOPS[family]:
        quoted = {name: f'"{value}"' for name, value in parameters.items()}
        for bit in range(2):
            lines += instance(cell, quoted, f"f{outputs}", pins | {data: f"d[{bit}]", "Q": f"q{outputs}"})
            outputs += 1
    cell, parameter, inputs, output = TABLES[family]
    for init in inits:
        pins = {pin: f"d[{bit}]" for bit, pin in enumerate(inputs)}
        lines += instance(cell, {parameter: f"16'h{init:04x}"}, f"l{outputs}", pins | {output: f"q{outputs}"})
        outputs += 1
    ports = ", ".join(f"output q{n}" for n in range(outputs))
    return f"module netlist(input c, e, r, input [3:0] d, {ports});\n{lines}endmodule\n", outputs


def differences(family: str, tmp_path, change=lambda text: text) -> int:
    """Number of differences of fast and package models under random inputs; x counts as a value."""
    rng = seeded("cells")
    text, outputs = each_cell(family, [0, 0xFFFF, 0x6996, *rng.sample(range(1 << 16), 20)])
    fast = with_joined_flip_flops(with_fast_tables(family, text))
    assert "SB_" not in fast and "TRELLIS_FF" not in fast and " LUT4" not in fast
    levels = ["1'b0", "1'b0", "1'b1", "1'b1", "1'bx"]
    steps = "".join(
        f"    {{e, r, d}} = {{{', '.join(rng.choice(levels) for _ in range(6))}}}; step;\n"
        for _ in range(STIMULI)
    )
    (tmp_path / "bench.v").write_text(
        cells(family)
        + text
        + change(fast).replace("module netlist(", "module fast(")
        + f"""module bench;
  reg c = 0, e = 0, r = 0;
  reg [3:0] d = 0;
  wire [{outputs - 1}:0] slow, fast;
  integer wrong = 0;
  netlist slow_i (c, e, r, d, {", ".join(f"slow[{n}]" for n in range(outputs))});
  fast fast_i (c, e, r, d, {", ".join(f"fast[{n}]" for n in range(outputs))});
  task step;
    begin
      #1 if (slow !== fast) wrong = wrong + 1;
      c = 1;
      #1 if (slow !== fast) wrong = wrong + 1;
      c = 0;
    end
  endtask
  initial begin
{steps}    $display("%0d", wrong);
  end
endmodule
"""
    )
    subprocess.run(
        ["iverilog", "-g2012", "-s", "bench", "-o", tmp_path / "bench", tmp_path / "bench.v"], check=True
    )
    done = subprocess.run(["vvp", "-n", tmp_path / "bench"], check=True, capture_output=True, text=True)
    return int(done.stdout)


@each_family
def test_fast_cells_are_equivalent_to_those_of_the_package(family, tmp_path):
    assert differences(family, tmp_path) == 0
