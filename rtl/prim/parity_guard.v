// SPDX-License-Identifier: Apache-2.0
// Keeps the parity of a register, so that a flipped bit in it is seen.
//
// The guarded register is outside: it takes next at each clock with load and is read back as
// value. damaged: level, the parity of value is not the one that was loaded; the next load ends
// it. An even number of flips in value and in the parity bit is not seen. INITIAL: parity of
// the register at power-up. There is no reset: a reset of the register is a load.
// WIDTH: bits of the register. Clock domain: clk. Rule: SAFE-4.
`default_nettype none

module parity_guard #(
    parameter WIDTH = 8,
    parameter [0:0] INITIAL = 1'b0
) (
    input  wire             clk,
    // guarded register
    input  wire             load,
    input  wire [WIDTH-1:0] next,
    input  wire [WIDTH-1:0] value,
    // status
    output wire             damaged
);

  reg odd = INITIAL;

  assign damaged = odd != ^value;

  always @(posedge clk) if (load) odd <= ^next;

endmodule

`default_nettype wire
