// SPDX-License-Identifier: Apache-2.0
// Counts time in units of 1/1200 s, from the drive port's ticks.
//
// A unit is 128 ticks of 1/(16 * 9600) s. Twelve units are exactly 10 ms, the unit of the
// time-outs, so no time-out is rounded. ticks wraps after 213 ms. Clock domain: clk.
// Rules: FC-9, LED-1.
`default_nettype none

module card_time (
    input  wire       clk,
    input  wire       rst,
    input  wire       tick16,
    // status
    output wire [7:0] ticks
);

  reg [14:0] count = 15'd0;

  assign ticks = count[14:7];

  always @(posedge clk) begin
    if (tick16) count <= count + 15'd1;
    if (rst) count <= 15'd0;
  end

endmodule

`default_nettype wire
