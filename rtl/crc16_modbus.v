// SPDX-License-Identifier: Apache-2.0
// Computes CRC-16/MODBUS bit by bit.
//
// Data bits arrive in line order, LSB first. Polynomial 8005h, reflected (A001h), start value
// FFFFh. Bit 0 is the next CRC bit to send (check_bit); a CRC that is sent or received shifts
// itself out of the register (FRAME-4). good: the remainder is 0, as it is after the two CRC
// bytes of an undamaged frame. clear sets the start value. Clock domain: clk.
`default_nettype none

module crc16_modbus (
    input  wire clk,
    // stream in
    input  wire clear,
    input  wire bit_valid,
    input  wire bit_data,
    // status
    output wire check_bit,
    output wire good
);

  reg [15:0] crc = 16'hFFFF;

  always @(posedge clk) begin
    if (clear) crc <= 16'hFFFF;
    else if (bit_valid) crc <= {1'b0, crc[15:1]} ^ (crc[0] != bit_data ? 16'hA001 : 16'h0000);
  end

  assign check_bit = crc[0];
  assign good = crc == 16'h0000;

endmodule

`default_nettype wire
