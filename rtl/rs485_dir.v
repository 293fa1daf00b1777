// SPDX-License-Identifier: Apache-2.0
// Controls the direction (DE) of one EIA-485 transceiver.
//
// DE rises with request. ready, LEAD_TICKS later (at most 15), allows the first start bit. DE
// falls when request is gone and the last stop bit is over (tx_busy low), without any lag
// (LINE-6, FC-10, SAFE-2). Units: tick16 = 1/16 bit. Clock domain: clk.
`default_nettype none

module rs485_dir #(
    parameter LEAD_TICKS = 4
) (
    input  wire clk,
    input  wire rst,
    input  wire tick16,
    // stream in
    input  wire request,
    output wire ready,
    // pin
    output reg  de,
    // status
    input  wire tx_busy
);

  localparam [3:0] LEAD = LEAD_TICKS;

  reg [3:0] lead = 4'd0;

  assign ready = lead == LEAD;

  initial de = 1'b0;

  always @(posedge clk) begin
    if (request) de <= 1'b1;
    else if (!tx_busy) de <= 1'b0;
    if (!de) lead <= 4'd0;
    else if (tick16 && !ready) lead <= lead + 4'd1;
    if (rst) begin
      de   <= 1'b0;
      lead <= 4'd0;
    end
  end

endmodule

`default_nettype wire
