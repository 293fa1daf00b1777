// SPDX-License-Identifier: Apache-2.0
// The last gate before DE: off in reset without a clock, and off after the longest frame.
//
// de is a flip-flop, so that the pin has no glitch. It follows driven one clock later. rst_n clears it
// without a clock (SAFE-6), and rst keeps it 0 (see asked of reset_sync). It falls 14 to 15 beats after
// driven rose, and stays 0 until driven falls. A beat is (mask + 1) / 1200 s: mask is
// that of baud_divider, so a beat is 32 bits at every rate up to 38400 bit/s and 96
// bits at 115200. The longest frame is 375 bits; 14 beats are 448. No counter of a sender is in it
// (SAFE-2). The beat comes from card_time, which counts the tick of the drive line's sender.
// Clock domain: clk.
// docs/hardening.md, Time limit of DE (SAFE-4)
`default_nettype none

module driver_limit (
    input  wire       clk,
    input  wire       rst_n,
    input  wire       rst,
    // time, in 1/1200 s
    input  wire [6:0] ticks,
    // configuration
    input  wire [6:0] mask,
    // direction
    input  wire       driven,
    // pin
    output reg        de
);

  reg tick_before = 1'b0;
  reg [3:0] beats = 4'd0;

  wire beat = ticks[0] != tick_before && &(ticks | ~mask);
  wire over = beats == 4'd15;

  initial de = 1'b0;

  always @(posedge clk or negedge rst_n) begin
    if (!rst_n) de <= 1'b0;
    else de <= driven && !over && !rst;
  end

  always @(posedge clk) begin
    tick_before <= ticks[0];
    if (!driven) beats <= 4'd0;
    else if (beat && !over) beats <= beats + 4'd1;
  end

endmodule

`default_nettype wire
