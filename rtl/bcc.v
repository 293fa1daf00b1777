// SPDX-License-Identifier: Apache-2.0
// Computes the BCC of the FC protocol, the XOR of all bytes from STX on, bit by bit.
//
// Data bits arrive in line order, LSB first. The value rotates by one position with each bit,
// so it is aligned again after every whole byte. good: the value is 0, as it is after the BCC
// of an undamaged telegram. clear sets the value to 0. Clock domain: clk. Rule: FC-1.
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
