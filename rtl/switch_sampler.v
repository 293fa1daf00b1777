// SPDX-License-Identifier: Apache-2.0
// Reads both DIP switches once after reset and keeps their positions (LINE-8).
//
// The switches pass two flip-flops. The second one stops with settled, when the pull-ups have
// charged the lines. ready: the positions are valid and do not change until the next reset.
// settled: high at least once, after the pull-ups' settling time.
// Clock domain: clk. Rules: LINE-2, LINE-3, LINE-7, LINE-8.
`default_nettype none

module switch_sampler (
    input  wire       clk,
    input  wire       rst,
    input  wire       settled,
    // pins
    input  wire [9:1] sw_baud,
    input  wire [8:1] sw_addr,
    // status
    output reg        ready,
    output reg  [9:1] baud,
    output reg  [8:1] addr,
    output wire       addr_valid
);

  (* async_reg = "true", syn_preserve = 1 *) reg [16:0] stage = 17'd0;

  // 0 is the broadcast address, 248 to 255 are reserved.
  assign addr_valid = addr != 8'd0 && addr[8:4] != 5'b11111;

  initial begin
    ready = 1'b0;
    baud  = 9'd0;
    addr  = 8'd0;
  end

  always @(posedge clk) begin
    stage <= {sw_baud, sw_addr};
    if (!ready) {baud, addr} <= stage;
    if (settled) ready <= 1'b1;
    if (rst) ready <= 1'b0;
  end

endmodule

`default_nettype wire
