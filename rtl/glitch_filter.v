// SPDX-License-Identifier: Apache-2.0
// Majority filter: shows the level that most of the last nine ticks had.
//
// A tick is 1/16 bit. A glitch shorter than 1/4 bit is at most four samples of nine, so it
// never passes. Next to a real edge it moves that edge by no more than its own width, which
// leaves the middle of the bit intact (LINE-5). A filter that waits for five equal ticks in a
// row would restart at every glitch and move the edge further. Clean edges are delayed by five
// ticks, rising and falling alike, so the width of a bit is kept. While mute is high the output
// is idle (1), and the port does not hear what it sends (LINE-6, FC-10). Clock domain: clk.
`default_nettype none

module glitch_filter (
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

  reg [7:0] history = 8'hFF;

  // Counted anew at each tick. docs/hardening.md, Undefined states (SAFE-4)
  wire [3:0] ones = {3'd0, raw} + {3'd0, history[0]} + {3'd0, history[1]} + {3'd0, history[2]} +
      {3'd0, history[3]} + {3'd0, history[4]} + {3'd0, history[5]} + {3'd0, history[6]} +
      {3'd0, history[7]};

  initial clean = 1'b1;

  always @(posedge clk) begin
    if (tick16) begin
      history <= {history[6:0], raw};
      clean   <= ones >= 4'd5;
    end
    if (rst || mute) begin
      history <= 8'hFF;
      clean   <= 1'b1;
    end
  end

endmodule

`default_nettype wire
