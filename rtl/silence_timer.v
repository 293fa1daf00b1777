// SPDX-License-Identifier: Apache-2.0
// Measures the silence on one line against two limits.
//
// Network port: short = t1.5, long = t3.5 (FRAME-1). Drive port: short and long
// are both the two characters of FC-8.
//
// The count starts when the receiver votes on the first stop bit, which leaves
// half a bit of the character to come, or one and a half with two stop bits. Both
// limits are therefore given with TAIL_TICKS on top, and with one stop bit the
// count starts one bit ahead. A false start stops the count for as long as it
// lasts and no longer. The glitch filter delays both ends of a silence alike, so
// it drops out. *_reached: one clock. long_silent: level, until the next character
// is complete. Units: tick16 = 1/16 bit. Clock domain: clk.
`default_nettype none

module silence_timer #(
    parameter [11:0] TAIL_TICKS = 12'd24
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        tick16,
    // line activity
    input  wire        restart,
    input  wire        busy,
    // configuration
    input  wire [11:0] short_ticks,
    input  wire [11:0] long_ticks,
    input  wire        two_stop,
    // status
    output reg         short_reached,
    output reg         long_reached,
    output reg         long_silent
);

  reg [11:0] count = 12'd0;

  wire counting = tick16 && !busy && !long_silent;
  wire at_short = count == short_ticks + TAIL_TICKS;
  wire at_long = count == long_ticks + TAIL_TICKS;

  initial begin
    short_reached = 1'b0;
    long_reached  = 1'b0;
    long_silent   = 1'b0;
  end

  always @(posedge clk) begin
    short_reached <= counting && at_short;
    long_reached  <= counting && at_long;
    if (counting) begin
      count <= count + 12'd1;
      if (at_long) long_silent <= 1'b1;
    end
    if (restart || rst) begin
      count <= two_stop ? 12'd0 : 12'd16;
      short_reached <= 1'b0;
      long_reached <= 1'b0;
      long_silent <= 1'b0;
    end
  end

endmodule

`default_nettype wire
