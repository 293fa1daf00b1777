// SPDX-License-Identifier: Apache-2.0
// One half of a guarded bit: a flip-flop in a module that no tool may open.
//
// The two halves of a bit are always opposite, so a synthesiser that merges registers keeps one of
// them, makes the other from it, and `fault` is 0 for ever. An attribute at the register alone does
// not stop each tool; docs/guide/integration.md has the sentences of the manuals.
// rst sets RESET_VALUE, as power-up does, and has priority. Width: 1 bit. Clock domain: clk.
// docs/hardening.md, Guarded bits. Rule: SAFE-4.
`default_nettype none

// No tool opens it.
(* keep_hierarchy = "yes" *)
module guarded_half #(
    parameter [0:0] RESET_VALUE = 1'b0
) (
    input  wire clk,
    input  wire rst,
    // next value
    input  wire load,
    input  wire data,
    // status
    output wire value
);

  (* dont_touch = "yes", syn_preserve = 1 *) reg half = RESET_VALUE;

  assign value = half;

  always @(posedge clk) begin
    if (rst) half <= RESET_VALUE;
    else if (load) half <= data;
  end

endmodule

`default_nettype wire
