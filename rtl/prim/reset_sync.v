// SPDX-License-Identifier: Apache-2.0
// Turns the reset pin into the card's one internal reset.
//
// rst is a flip-flop that no pin clears: it rises and falls at a clock edge, two to three clocks after
// rst_n. An edge at any other moment would reach the enable of the memory, and may damage a block RAM
// whose clock is near. asked rises with the fall of rst_n, without a clock, and stays until rst is 1, so
// that no pulse is too short. It is for the drivers alone, which are off at once (SAFE-6).
// Both are 1 at power-up, so a card without a reset pin starts clean.
// Clock domain: clk. Rule: TOP-1.
`default_nettype none

module reset_sync (
    input  wire clk,
    input  wire rst_n,
    // status
    output wire asked,
    output wire rst
);

  reg released = 1'b0;

  assign asked = !released;

  always @(posedge clk or negedge rst_n) begin
    if (!rst_n) released <= 1'b0;
    else released <= released || rst;
  end

  sync_2ff #(
      .RESET_VALUE(1'b1)
  ) sync_i (
      .clk(clk),
      .rst(1'b0),
      // pin
      .raw(asked),
      // status
      .synced(rst)
  );

endmodule

`default_nettype wire
