// SPDX-License-Identifier: Apache-2.0
// Sixteen ticks a bit for one port: every ratio-th base tick.
//
// ratio = 1843200 / (16 * baud) = 1 (115200) to 384 (300). Clock domain: clk.
// Rules: LINE-2, LINE-4, FC-1.
`default_nettype none

module baud_divider (
    input  wire       clk,
    input  wire       rst,
    // stream in
    input  wire       tick_base,
    // stream out
    output reg        tick16,
    // configuration
    input  wire [8:0] ratio
);

  reg [8:0] left = 9'd0;
  wire last = left == 9'd0;

  initial tick16 = 1'b0;

  always @(posedge clk) begin
    tick16 <= tick_base && last;
    if (tick_base) left <= last ? ratio - 9'd1 : left - 9'd1;
    if (rst) begin
      left   <= 9'd0;
      tick16 <= 1'b0;
    end
  end

endmodule

`default_nettype wire
