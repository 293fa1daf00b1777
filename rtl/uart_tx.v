// SPDX-License-Identifier: Apache-2.0
// Sends one character: start, 8 data bits LSB first, parity or none, 1 or 2 stops.
//
// A byte is taken when byte_valid and byte_ready are both high. byte_ready comes
// back in the last tick of the last stop bit, so bytes that are waiting follow
// each other without any gap (FC-8, LINE-1). Every bit lasts exactly 16 ticks.
// busy: from taking a byte to the end of its last stop bit.
// Units: tick16 = 1/16 bit. Clock domain: clk. Rules: LINE-1, LINE-3, LINE-4, FC-1.
`default_nettype none

module uart_tx (
    input  wire       clk,
    input  wire       rst,
    input  wire       tick16,
    // stream in
    input  wire       byte_valid,
    output wire       byte_ready,
    input  wire [7:0] byte_data,
    // pin
    output wire       txd,
    // configuration
    input  wire       parity_enable,
    input  wire       parity_odd,
    input  wire       two_stop,
    // status
    output reg        busy
);

  // The frame is shifted out LSB first: start, data, parity or stop, then ones.
  // bits_left counts start + 8 data + (parity) + stops, less one.
  reg [9:0] shift = 10'h3FF;
  reg [3:0] bits_left = 4'd0;
  reg [3:0] phase = 4'd0;

  wire parity = (^byte_data) ^ parity_odd;
  wire bit_end = tick16 && phase == 4'd15;
  wire char_end = bit_end && bits_left == 4'd0;

  assign byte_ready = tick16 && (!busy || char_end);
  assign txd = shift[0];

  initial busy = 1'b0;

  always @(posedge clk) begin
    if (tick16) phase <= phase + 4'd1;
    if (bit_end) begin
      shift <= {1'b1, shift[9:1]};
      bits_left <= bits_left - 4'd1;
    end
    if (char_end) busy <= 1'b0;
    if (byte_valid && byte_ready) begin
      shift <= {parity || !parity_enable, byte_data, 1'b0};
      bits_left <= (parity_enable || two_stop) ? 4'd10 : 4'd9;
      phase <= 4'd0;
      busy <= 1'b1;
    end
    if (rst) begin
      shift <= 10'h3FF;
      busy  <= 1'b0;
    end
  end

`ifndef SYNTHESIS
  reg [7:0] last_byte = 8'd0;
  always @(posedge clk) if (byte_valid && byte_ready) last_byte <= byte_data;
`endif

endmodule

`default_nettype wire
