// SPDX-License-Identifier: Apache-2.0
// Sees a start bit by a count of its own, so that no flipped bit of the UART hides one.
//
// low_seen: one clock, at the tenth tick in a row in which the line is low. A start bit is low
// for 16 ticks, and the UART has passed it one tick before. So low_seen never comes on a silent
// line without start_seen of the UART. Inside a character it also comes from zero bits.
// Units: tick16 = 1/16 bit. Clock domain: clk. Rules: FRAME-6, SAFE-4.
// docs/hardening.md, Second look at start bits (SAFE-4)
`default_nettype none

module start_watch (
    input  wire clk,
    input  wire rst,
    input  wire tick16,
    // line activity
    input  wire line,
    // status
    output reg  low_seen
);

  localparam [3:0] ENOUGH = 4'd10;

  reg [3:0] lows = 4'd0;

  initial low_seen = 1'b0;

  always @(posedge clk) begin
    low_seen <= tick16 && !line && lows == ENOUGH - 4'd1;
    if (line) lows <= 4'd0;
    else if (tick16 && lows != ENOUGH) lows <= lows + 4'd1;
    if (rst) low_seen <= 1'b0;
  end

endmodule

`default_nettype wire
