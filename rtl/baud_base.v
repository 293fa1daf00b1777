// SPDX-License-Identifier: Apache-2.0
// Generates the base tick of both ports: 1.8432 MHz on average, from a clock of 2 to 100 MHz.
//
// 1.8432 MHz is 16 x 115200 Hz. Every other rate is a whole fraction of it, so one phase
// accumulator serves both ports. The 16-bit step is rounded to the nearest whole number. The
// worst rate error is 0.5 / 1208 = 0.041 %, at 100 MHz; LINE-4 allows 0.1 %. No tick is more
// than one clock early or late.
// Clock domain: clk.
`default_nettype none

module baud_base #(
    parameter CLK_HZ = 12_000_000
) (
    input  wire clk,
    input  wire rst,
    // stream out
    output reg  tick_base
);

  localparam [63:0] BASE_HZ = 1_843_200;
  localparam [63:0] STEP_EXACT = (64'd65536 * BASE_HZ + CLK_HZ / 2) / CLK_HZ;
  localparam [15:0] STEP = STEP_EXACT[15:0];

  reg  [15:0] phase = 16'd0;
  wire [16:0] phase_next = {1'b0, phase} + {1'b0, STEP};

  initial tick_base = 1'b0;

  // A module that does not exist stops every tool and names the mistake.
  generate
    if (CLK_HZ < 2_000_000 || CLK_HZ > 100_000_000) begin : g_mistake
      CLK_HZ_is_not_between_2_and_100_MHz mistake_i ();
    end
  endgenerate

  always @(posedge clk) begin
    phase <= phase_next[15:0];
    tick_base <= phase_next[16];
    if (rst) begin
      phase <= 16'd0;
      tick_base <= 1'b0;
    end
  end

endmodule

`default_nettype wire
