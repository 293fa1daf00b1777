// SPDX-License-Identifier: Apache-2.0
// CRC-16/MODBUS over a stream of bytes, one byte a clock.
//
// Polynomial 8005h, reflected (A001h), start FFFFh, sent low byte first (FRAME-4).
// After the two CRC bytes of an undamaged frame have passed, the remainder is 0:
// that is good. clear sets the start value; a byte in the same clock wins, so the
// user may hold clear for as long as no frame is under way. Clock domain: clk.
`default_nettype none

module crc16_modbus (
    input  wire        clk,
    // stream in
    input  wire        clear,
    input  wire        byte_valid,
    input  wire [ 7:0] byte_data,
    // status
    output reg  [15:0] crc,
    output wire        good
);

  function [15:0] next(input [15:0] now, input [7:0] data);
    integer i;
    begin
      next = now ^ {8'd0, data};
      for (i = 0; i < 8; i = i + 1) next = {1'b0, next[15:1]} ^ (next[0] ? 16'hA001 : 16'h0000);
    end
  endfunction

  initial crc = 16'hFFFF;

  always @(posedge clk) begin
    if (byte_valid) crc <= next(crc, byte_data);
    else if (clear) crc <= 16'hFFFF;
  end

  assign good = crc == 16'h0000;

endmodule

`default_nettype wire
