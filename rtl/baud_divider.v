// SPDX-License-Identifier: Apache-2.0
// Divides the base tick to 16 ticks a bit for each port.
//
// One chain serves both ports: a divider by three, then up to seven halvings. A rate is the base
// tick itself (115200) or slower by 3 x a power of 2, from 3 (38400) to 384 (300). A port ticks
// with every third base tick at which all count bits under its mask are 1: mask = ratio / 3 - 1.
// There is no reset: the phase of the ticks does not matter, and rst lasts until card_time has
// counted some of them.
// Clock domain: clk. Rules: LINE-2, LINE-4, FC-1.
`default_nettype none

module baud_divider (
    input  wire       clk,
    // stream in
    input  wire       tick_base,
    // stream out
    output reg        tick16_modbus,
    output reg        tick16_drive,
    // configuration
    input  wire       modbus_undivided,
    input  wire [6:0] modbus_mask
);

  localparam [6:0] DRIVE_MASK = 7'd3;

  reg [1:0] thirds = 2'd0;
  reg [6:0] count = 7'd0;

  wire third = tick_base && thirds[1];

  initial begin
    tick16_modbus = 1'b0;
    tick16_drive  = 1'b0;
  end

  always @(posedge clk) begin
    if (tick_base) thirds <= third ? 2'd0 : thirds + 2'd1;
    if (third) count <= {count[6:4] + {2'd0, &count[3:0]}, count[3:0] + 4'd1};
    tick16_modbus <= modbus_undivided ? tick_base : third && &(count | ~modbus_mask);
    tick16_drive  <= third && &(count | ~DRIVE_MASK);
  end

endmodule

`default_nettype wire
