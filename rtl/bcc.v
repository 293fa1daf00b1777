// SPDX-License-Identifier: Apache-2.0
// The FC protocol's check byte: XOR of all bytes from STX on, one byte a clock.
//
// value is what the BCC has to be after the bytes so far. clear sets 0; a byte in
// the same clock wins, so the user may hold clear for as long as no telegram is
// under way. Clock domain: clk. Rule: FC-1.
`default_nettype none

module bcc (
    input  wire       clk,
    // stream in
    input  wire       clear,
    input  wire       byte_valid,
    input  wire [7:0] byte_data,
    // status
    output reg  [7:0] value
);

  initial value = 8'h00;

  always @(posedge clk) begin
    if (byte_valid) value <= value ^ byte_data;
    else if (clear) value <= 8'h00;
  end

endmodule

`default_nettype wire
