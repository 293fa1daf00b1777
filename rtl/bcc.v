// SPDX-License-Identifier: Apache-2.0
// The FC protocol's check byte, XOR of all bytes from STX on, over a stream of data
// bits in the order of the line.
//
// The value turns by a bit with each bit, so after a whole byte it stands as before,
// and the BCC clears it: good after an undamaged telegram. clear sets 0. Clock domain: clk. Rule: FC-1.
`default_nettype none

module bcc (
    input  wire clk,
    // stream in
    input  wire clear,
    input  wire bit_valid,
    input  wire bit_data,
    // status
    output wire good
);

  reg [7:0] value = 8'h00;

  always @(posedge clk) begin
    if (clear) value <= 8'h00;
    else if (bit_valid) value <= {value[0] ^ bit_data, value[7:1]};
  end

  assign good = value == 8'h00;

endmodule

`default_nettype wire
