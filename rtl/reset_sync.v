// SPDX-License-Identifier: Apache-2.0
// Turns the reset pin into the card's one internal reset.
//
// rst asserts at once with rst_n, without a clock. It is released two clocks after rst_n,
// synchronous to clk. It is also high for the first clocks after power-up, so a card without a
// reset pin starts clean. Clock domain: clk. Rule: TOP-1.
`default_nettype none

module reset_sync (
    input  wire clk,
    input  wire rst_n,
    // status
    output wire rst
);

  (* async_reg = "true" *) reg [1:0] released = 2'b00;

  always @(posedge clk or negedge rst_n) begin
    if (!rst_n) released <= 2'b00;
    else released <= {released[0], 1'b1};
  end

  assign rst = !released[1];

endmodule

`default_nettype wire
