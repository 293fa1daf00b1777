// SPDX-License-Identifier: Apache-2.0
// Synchronizes one asynchronous pin with two flip-flops.
//
// Delay: 2 clocks. RESET_VALUE is 1 for serial lines, so that an idle line does not look like a
// start bit during reset. The attributes keep both flip-flops apart from all others and close to each
// other; docs/guide/integration.md has the sentences of the manuals.
// Clock domain of synced: clk. Rule: LINE-5.
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

  (* async_reg = "true", syn_preserve = 1 *) reg [1:0] stage = {2{RESET_VALUE}};

  always @(posedge clk) begin
    stage <= {stage[0], raw};
    if (rst) stage <= {2{RESET_VALUE}};
  end

  assign synced = stage[1];

endmodule

`default_nettype wire
