// SPDX-License-Identifier: Apache-2.0
// A flip-flop kept as two opposite halves, so that one flipped bit never makes it 1.
//
// value: 1 only while both halves say so. fault: the halves disagree, which only a
// flipped bit brings about; the next load or reset ends it. load takes data at the
// clock edge; rst clears and has priority. Power-up value 0. No tool may merge the
// halves: `make test` counts the flip-flops after synthesis. docs/hardening.md, Guarded bits.
// Width: 1 bit. Clock domain: clk. Rule: SAFE-4.
`default_nettype none

module guarded_bit (
    input  wire clk,
    input  wire rst,
    // next value
    input  wire load,
    input  wire data,
    // status
    output wire value,
    output wire fault
);

  reg held = 1'b0;
  reg opposite = 1'b1;

  assign value = held && !opposite;
  assign fault = held == opposite;

  always @(posedge clk) begin
    if (rst) begin
      held <= 1'b0;
      opposite <= 1'b1;
    end else if (load) begin
      held <= data;
      opposite <= !data;
    end
  end

endmodule

`default_nettype wire
