# SPDX-License-Identifier: Apache-2.0
"""DE has no glitch in cells with any delays: it moves once a clock at most (SAFE-2).

The delays stand for places and wires of an FPGA: each input of each look-up table has its own, drawn anew
for each frame. A pin that is decoded from a binary counter fails here.
"""

from __future__ import annotations

import subprocess

import pytest

from constraints.flow import mapping
from rtl.sources import needed_files
from tb.gates.netlists import cells, synthesise
from tb.lib.runner import ROOT

FRAMES = 60
BENCH = f"""
`timescale 1ps / 1ps
module bench;
  reg clk = 0, driven = 0;
  reg [6:0] ticks = 0;
  wire de;
  integer seed = 1, moves = 0, glitches = 0, rises = 0;
  event places;
  driver_limit limit_i (
      .clk(clk), .rst_n(1'b1), .rst(1'b0), .ticks(ticks), .mask(7'd3), .driven(driven), .de(de)
  );
  always #10_000 clk = !clk;
  always @(posedge clk) moves = 0;
  always @(posedge de) rises = rises + 1;
  always @(de) begin
    moves = moves + 1;
    if (moves == 2 && $time > 0) glitches = glitches + 1;
  end
  initial begin
    repeat ({FRAMES}) begin
      -> places;
      repeat (70) begin
        @(posedge clk) driven <= 1;
        @(posedge clk) ticks <= ticks + 1;
      end
      driven <= 0;
      @(posedge clk);
      @(posedge clk);
    end
    $display("%0d rises, %0d glitches", rises, glitches);
    $finish;
  end
endmodule
"""
# A look-up table whose inputs have delays; pulses shorter than a delay pass, too.
TABLE = """
module SB_LUT4 (output O, input I0, I1, I2, I3);
  parameter [15:0] LUT_INIT = 0;
  integer d0 = 0, d1 = 0, d2 = 0, d3 = 0;
  reg [3:0] at = 0;
  assign O = LUT_INIT[at];
  always @(bench.places) begin
    d0 = 200 + {$random(bench.seed)} % 2000;
    d1 = 200 + {$random(bench.seed)} % 2000;
    d2 = 200 + {$random(bench.seed)} % 2000;
    d3 = 200 + {$random(bench.seed)} % 2000;
  end
  always @(I0) at[0] <= #d0 I0;
  always @(I1) at[1] <= #d1 I1;
  always @(I2) at[2] <= #d2 I2;
  always @(I3) at[3] <= #d3 I3;
endmodule
"""


@pytest.mark.nightly
@pytest.mark.rule("SAFE-2")
def test_de_moves_once_a_clock():
    folder = ROOT / "build/tests/glitches"
    folder.mkdir(parents=True, exist_ok=True)
    commands = mapping("ice40", "hx", "driver_limit")
    synthesise(folder, "driver_limit", commands, needed_files("driver_limit"), {})
    models = cells("ice40").replace("module SB_LUT4 ", "module SB_LUT4_without_delays ", 1)
    (folder / "bench.v").write_text(BENCH + TABLE + (folder / "raw.v").read_text() + models)
    command = ["iverilog", "-g2005", "-s", "bench", "-o", folder / "bench", folder / "bench.v"]
    subprocess.run(command, check=True)
    done = subprocess.run(["vvp", "-n", folder / "bench"], check=True, capture_output=True, text=True)
    assert done.stdout == f"{FRAMES} rises, 0 glitches\n"
