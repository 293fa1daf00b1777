// SPDX-License-Identifier: Apache-2.0
// A register of states whose codes differ in two bits: no tool gives them other codes.
//
// A tool that finds a state machine chooses codes of its own, of which one flipped bit may make another
// state. The attributes forbid it; docs/guide/integration.md has the sentences of the manuals.
// rst sets START, as power-up does. WIDTH: bits. Clock domain: clk. Rule: SAFE-4.
`default_nettype none

module sparse_state #(
    parameter WIDTH = 4,
    parameter [WIDTH-1:0] START = 0
) (
    input  wire             clk,
    input  wire             rst,
    input  wire [WIDTH-1:0] next,
    // status
    output wire [WIDTH-1:0] state
);

  (* fsm_encoding = "none", syn_preserve = 1 *) reg [WIDTH-1:0] code = START;

  assign state = code;

  always @(posedge clk) code <= rst ? START : next;

endmodule

`default_nettype wire
