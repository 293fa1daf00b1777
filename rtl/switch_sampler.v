// SPDX-License-Identifier: Apache-2.0
// Reads both DIP switches once after reset and keeps what they said (LINE-8).
//
// The switches pass two flip-flops and are taken SETTLE_TICKS after reset, when the
// pull-ups have charged the lines; ready tells that from then on the values hold
// until the next reset. Units: tick_base = 1/1.8432 MHz, so 1024 ticks are 0.56 ms.
// Clock domain: clk. Rules: LINE-2, LINE-3, LINE-7, LINE-8.
`default_nettype none

module switch_sampler #(
    parameter SETTLE_TICKS = 1024
) (
    input  wire       clk,
    input  wire       rst,
    input  wire       tick_base,
    // pins
    input  wire [9:1] sw_baud,
    input  wire [8:1] sw_addr,
    // status
    output wire       ready,
    output reg  [9:1] baud,
    output reg  [8:1] addr,
    output wire       addr_valid
);

  localparam TIMER_BITS = $clog2(SETTLE_TICKS + 1);
  localparam [TIMER_BITS-1:0] SETTLED = SETTLE_TICKS;

  reg [TIMER_BITS-1:0] timer = {TIMER_BITS{1'b0}};
  reg [16:0] stage = 17'd0;

  assign ready = timer == SETTLED;
  // 0 is the broadcast address, 248 to 255 are reserved.
  assign addr_valid = addr != 8'd0 && addr[8:4] != 5'b11111;

  initial begin
    baud = 9'd0;
    addr = 8'd0;
  end

  always @(posedge clk) begin
    stage <= {sw_baud, sw_addr};
    if (!ready) begin
      {baud, addr} <= stage;
      if (tick_base) timer <= timer + {{(TIMER_BITS - 1) {1'b0}}, 1'b1};
    end
    if (rst) timer <= {TIMER_BITS{1'b0}};
  end

endmodule

`default_nettype wire
