# SPDX-License-Identifier: Apache-2.0
"""What a card's registers hold at power-up is left to the simulator, but for the firmware memory."""

from __future__ import annotations

import re

import pytest

from rtl.sources import card_files, configurations
from sim.harness.power_up import without_values

VALUE = re.compile(r"\binitial\b|\breg\b[^;=<()]*=[^=]")
IMAGE = "initial $readmemh(FIRMWARE_HEX, words);"


@pytest.mark.parametrize("card", configurations())
@pytest.mark.rule("SAFE-5")
def test_no_register_of_a_card_keeps_a_value(card) -> None:
    left = {}
    for path in card_files(card):
        after = without_values(path.read_text())
        assert path.read_text().count("\n") == after.count("\n"), path
        if found := VALUE.findall(after.replace(IMAGE, "")):
            left[path.name] = found
    assert not left


def test_a_value_goes_wherever_it_stands() -> None:
    text = """module m(output reg a = 1'b0, input b); // initial c
reg [3:0] d = {2{2'd1}};
initial a = 1'b1;
initial begin
  if (b) begin d = 4'd3; end
end
initial $readmemh("x", m);
always @(posedge b) d <= 4'd2;
endmodule
"""
    stripped = """module m(output reg a, input b);
reg [3:0] d;
;
;
initial $readmemh("x", m);
always @(posedge b) d <= 4'd2;
endmodule
"""
    assert without_values(text).split() == stripped.split()
