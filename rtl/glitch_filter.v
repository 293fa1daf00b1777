// SPDX-License-Identifier: Apache-2.0
// Lets a level pass only after it stood for SAMPLES ticks in a row.
//
// A tick is 1/16 bit. Five samples in a row span at least four ticks, so whatever
// is shorter than 1/4 bit never passes (LINE-5), and both edges are delayed alike
// by five ticks, so the width of a bit is kept. While mute is high the output is
// held at idle (1): the port does not hear its own sending (LINE-6, FC-10).
// Clock domain: clk.
`default_nettype none

module glitch_filter #(
    parameter SAMPLES = 5
) (
    input  wire clk,
    input  wire rst,
    input  wire tick16,
    // pin
    input  wire raw,
    // configuration
    input  wire mute,
    // status
    output reg  clean
);

  localparam [2:0] LAST = SAMPLES - 1;

  reg [2:0] differing = 3'd0;

  initial clean = 1'b1;

  always @(posedge clk) begin
    if (tick16) begin
      if (raw == clean) differing <= 3'd0;
      else if (differing == LAST) begin
        differing <= 3'd0;
        clean <= raw;
      end else differing <= differing + 3'd1;
    end
    if (rst || mute) begin
      differing <= 3'd0;
      clean <= 1'b1;
    end
  end

endmodule

`default_nettype wire
