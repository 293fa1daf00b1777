// SPDX-License-Identifier: Apache-2.0
// The place of one committed write whose telegram waits for a running exchange (FRAME-7).
//
// fill: the licence of a request moves in, with its right to command the drive; a licence
// that is there goes. take: an order uses the licence. fill wins over take. valid is a
// guarded bit: one flipped bit never makes a licence (docs/hardening.md, Waiting writes,
// SAFE-4). control: the request writes coils, so bit 10 of the control word may be 1.
// fault: a half of valid has flipped (docs/hardening.md, Faults of guarded bits).
// rst empties the place. Clock domain: clk. Rules: FRAME-7, SAFE-1, SAFE-4.
`default_nettype none

module waiting_place (
    input  wire clk,
    input  wire rst,
    // newest request
    input  wire fill,
    input  wire writes_coils,
    // firmware
    input  wire take,
    // status
    output wire valid,
    output reg  control,
    output wire fault
);

  initial control = 1'b0;

  guarded_bit valid_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (fill || take),
      .data (fill),
      // status
      .value(valid),
      .fault(fault)
  );

  always @(posedge clk) if (fill) control <= writes_coils;

endmodule

`default_nettype wire
