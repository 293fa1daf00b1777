// SPDX-License-Identifier: Apache-2.0
// Two flip-flops against metastability, for one asynchronous pin.
//
// Delay: 2 clocks. RESET_VALUE is 1 for serial lines: an idle line must not look
// like a start bit while the reset lasts. Clock domain of synced: clk. Rule: LINE-5.
`default_nettype none

module sync_2ff #(
    parameter [0:0] RESET_VALUE = 1'b1
) (
    input  wire clk,
    input  wire rst,
    // pin
    input  wire raw,
    // status
    output wire synced
);

  (* async_reg = "true" *) reg [1:0] stage = {2{RESET_VALUE}};

  always @(posedge clk) begin
    stage <= {stage[0], raw};
    if (rst) stage <= {2{RESET_VALUE}};
  end

  assign synced = stage[1];

endmodule

`default_nettype wire
