// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: one baud_base for each clock of a list, all on the same clk, each
// with a counter of its ticks. CLOCKS holds COUNT values of 32 bits, first one lowest.
`default_nettype none

module baud_bank #(
    parameter COUNT = 1,
    parameter [32*COUNT-1:0] CLOCKS = 0
) (
    input  wire                clk,
    input  wire                rst,
    output wire [   COUNT-1:0] ticks,
    output reg  [32*COUNT-1:0] counts
);

  genvar i;
  generate
    for (i = 0; i < COUNT; i = i + 1) begin : g_base
      baud_base #(
          .CLK_HZ(CLOCKS[32*i+:32])
      ) base_i (
          .clk(clk),
          .rst(rst),
          .tick_base(ticks[i])
      );
      always @(posedge clk) begin
        if (rst) counts[32*i+:32] <= 32'd0;
        else if (ticks[i]) counts[32*i+:32] <= counts[32*i+:32] + 32'd1;
      end
    end
  endgenerate

endmodule

`default_nettype wire
