// SPDX-License-Identifier: Apache-2.0
// Free-running milliseconds, from the drive port's ticks.
//
// A millisecond is 153.6 ticks of 1/(16 * 9600) s. Counting five a tick up to 768
// makes that exact on average; one millisecond is off by less than a tick (7 us).
// ms wraps round after 65.536 s; ms_tick is high for one clock a millisecond. Clock domain: clk. Rules: FC-9, LED-1.
`default_nettype none

module ms_timer (
    input  wire        clk,
    input  wire        rst,
    input  wire        tick16,
    // status
    output wire        ms_tick,
    output reg  [15:0] ms
);

  localparam [9:0] FIFTHS_PER_MS = 10'd768;

  reg [9:0] fifths = 10'd0;
  wire over = fifths >= FIFTHS_PER_MS - 10'd5;

  assign ms_tick = tick16 && over;

  initial ms = 16'd0;

  always @(posedge clk) begin
    if (tick16) begin
      fifths <= over ? fifths - (FIFTHS_PER_MS - 10'd5) : fifths + 10'd5;
      if (over) ms <= ms + 16'd1;
    end
    if (rst) begin
      fifths <= 10'd0;
      ms <= 16'd0;
    end
  end

endmodule

`default_nettype wire
