// SPDX-License-Identifier: Apache-2.0
// A flip-flop kept as two opposite halves, so that one flipped bit never makes it 1.
//
// value: 1 only while both halves say so. fault: the halves disagree, which only a
// flipped bit brings about; the next load or reset ends it. load takes data at the
// clock edge; rst clears and has priority. Power-up value 0. docs/hardening.md, Guarded bits.
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

  wire held;
  wire opposite;

  assign value = held && !opposite;
  assign fault = held == opposite;

  guarded_half #(
      .RESET_VALUE(1'b0)
  ) held_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (load),
      .data (data),
      // status
      .value(held)
  );

  guarded_half #(
      .RESET_VALUE(1'b1)
  ) opposite_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (load),
      .data (!data),
      // status
      .value(opposite)
  );

endmodule

`default_nettype wire
