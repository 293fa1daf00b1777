// SPDX-License-Identifier: Apache-2.0
// Measures the silence on one line against two limits.
//
// Network port: short = t1.5, long = t3.5 (FRAME-1). Drive port: short and long
// are both the two characters of FC-8.
//
// The count starts when the receiver votes on the first stop bit. The filter shows
// everything five to six ticks late, so of that bit two to three ticks are still to
// come, and one bit more with two stop bits: with one, the count starts 16 ahead.
// TAIL_TICKS is chosen so that a limit is reached 0 to 1 tick early (FRAME-1 allows
// 4): at 300 bit/s a whole tick late would cost PERF-2. busy must rise with the pin,
// not with the filtered line, for the filter's delay is taken off here. It stops the
// count for as long as it lasts, so a glitch or a false start costs no more than
// itself; restart starts it anew, at the end of each character, and sending holds it.
// *_reached: one clock. long_silent: level, until the next restart.
// Units: tick16 = 1/16 bit. Clock domain: clk. Rules: FRAME-1, FC-8.
`default_nettype none

module silence_timer #(
    parameter [11:0] TAIL_TICKS = 12'd17
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        tick16,
    // line activity
    input  wire        restart,
    input  wire        sending,
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
    if (restart || sending || rst) begin
      // The card's own last character is over when DE falls, whatever its format.
      count <= sending ? TAIL_TICKS + 12'd1 : two_stop ? 12'd0 : 12'd16;
      short_reached <= 1'b0;
      long_reached <= 1'b0;
      long_silent <= 1'b0;
    end
  end

endmodule

`default_nettype wire
