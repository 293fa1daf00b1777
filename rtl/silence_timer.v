// SPDX-License-Identifier: Apache-2.0
// Measures the silence on one line in half characters, against two limits.
//
// t1.5 and t3.5 are 3 and 7 halves of 88 ticks, above 19200 bit/s of 250 us, so one count of
// ticks serves both (FRAME-1). On the drive line both limits are the 4 halves of the pause (FC-8).
//
// The filter delays the line by five to six ticks. The receiver votes on the first stop bit
// eight to nine ticks after its beginning. At restart two to three ticks of that bit are
// therefore still to come, and one more bit with two stop bits. The count starts that much below
// SILENCE_START, where later halves start. A limit is then reached 0 to 1 tick early; FRAME-1
// allows 4. One tick late at 300 bit/s would violate PERF-2. The card's own last character ends
// when DE falls.
// busy must rise with the pin and not with the filtered line, because the filter's delay is
// subtracted here. The count stops while busy is high, so a glitch or a false start costs only
// its own duration. restart, at the vote on the first stop bit of each character, restarts the
// count; sending holds it at its start.
// half_reached, short_reached, long_reached: one clock. long_silent: level, until the next restart.
// half_end: the count in the last tick of a half. half_uneven takes one tick off the second,
// fourth and sixth half.
// WIDTH: bits of the count. SHORT_HALVES, LONG_HALVES: the two limits, in halves.
// Units: tick16 = 1/16 bit. Clock domain: clk. Rules: FRAME-1, FC-8, SAFE-4.
`default_nettype none

module silence_timer #(
    parameter WIDTH = 9,
    parameter [2:0] SHORT_HALVES = 3'd3,
    parameter [2:0] LONG_HALVES = 3'd7
) (
    input  wire             clk,
    input  wire             rst,
    input  wire             tick16,
    // line activity
    input  wire             restart,
    input  wire             sending,
    input  wire             busy,
    // configuration
    input  wire [WIDTH-1:0] half_end,
    input  wire             half_uneven,
    input  wire             two_stop,
    // status
    output reg              half_reached,
    output reg              short_reached,
    output wire             long_reached,
    output reg              long_silent
);

  localparam [8:0] SILENCE_START = 9'd18;
  localparam [WIDTH-1:0] START = SILENCE_START[WIDTH-1:0];
  localparam [WIDTH-1:0] STOP_LEFT = 2;
  localparam [WIDTH-1:0] SECOND_STOP = 16;

  reg [WIDTH-1:0] ticks = START;
  reg [2:0] halves = 3'd0;  // halves that are over
  reg long_over = 1'b0;  // one clock: the long limit was reached

  wire counting = tick16 && !busy && !long_silent;
  wire half_over = counting && ticks == half_end;
  wire shorter = half_uneven && !halves[0];  // the next half
  wire again = restart || sending || rst;

  initial begin
    half_reached  = 1'b0;
    short_reached = 1'b0;
    long_silent   = 1'b0;
  end

  // docs/hardening.md, End of silence (SAFE-4)
  assign long_reached = long_over && long_silent;

  always @(posedge clk) begin
    // A sum, for a clock enable of its own would leave slices of the small card half empty.
    ticks <= ticks + {{(WIDTH - 1) {1'b0}}, counting};
    if (half_over) begin
      ticks  <= START | {{(WIDTH - 1) {1'b0}}, shorter};
      halves <= halves + 3'd1;
    end
    half_reached <= half_over && halves == 3'd0;
    short_reached <= half_over && halves == SHORT_HALVES - 3'd1;
    long_over <= half_over && halves == LONG_HALVES - 3'd1;
    if (half_over && halves == LONG_HALVES - 3'd1) long_silent <= 1'b1;
    if (again) begin
      ticks         <= sending ? START : START - STOP_LEFT - (two_stop ? SECOND_STOP : 0);
      halves        <= 3'd0;
      half_reached  <= 1'b0;
      short_reached <= 1'b0;
      long_over     <= 1'b0;
      long_silent   <= 1'b0;
    end
  end

endmodule

`default_nettype wire
