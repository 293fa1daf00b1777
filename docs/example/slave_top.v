// SPDX-License-Identifier: Apache-2.0
// The example slave on a development board: register 0 bit 0 lights the LED (lit by a low pin).
//
// rx, tx, de: the pins of an EIA-485 transceiver, those of the card's network line on the same board.
// The reset lasts 15 clocks after configuration. Clock domain: clk, CLK_HZ.
`default_nettype none

module slave_top #(
    parameter CLK_HZ = 12_000_000,
    parameter BAUD   = 19_200
) (
    input  wire clk,
    input  wire rx,
    output wire tx,
    output wire de,
    output wire led_n
);
  reg [3:0] started;
  wire rst = started != 4'd15;
  wire [127:1] unused;
  wire lit;
  assign led_n = !lit;

  initial started = 4'd0;
  always @(posedge clk) if (rst) started <= started + 4'd1;

  holding_registers #(
      .CLK_HZ(CLK_HZ),
      .BAUD  (BAUD)
  ) slave_i (
      .clk(clk),
      .rst(rst),
      .rx(rx),
      .tx(tx),
      .de(de),
      .registers({unused, lit})
  );
endmodule

`default_nettype wire
