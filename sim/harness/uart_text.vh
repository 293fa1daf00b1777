// SPDX-License-Identifier: Apache-2.0
// What a waveform shows of a UART; sim/harness/wave_rows.py appends it to the module.
//
// The last byte, and in hexadecimal the first 32 bytes of the frame on the line, sent or received.
// A frame is over after 1.5 characters. Spaces, because viewers draw 00 as dots.
localparam [8:0] FRAME_OVER = 9'd264;
reg [6:0] bits_seen = 7'd0;
reg [7:0] last_byte = 8'd0;
reg byte_seen = 1'b0;
reg [8:0] idle_ticks = 9'd0;
reg frame_over = 1'b1;
reg [5:0] bytes_shown = 6'd0;
reg [8*96-1:0] frame_text = {96{" "}};

function [7:0] hex_digit;
  input [3:0] value;
  hex_digit = (value < 4'd10 ? 8'h30 : 8'h37) + {4'd0, value};
endfunction
wire [15:0] byte_text = {hex_digit(last_byte[7:4]), hex_digit(last_byte[3:0])};

always @(posedge clk) begin
  if (bit_valid) bits_seen <= {bit_data, bits_seen[6:1]};
  if (bit_valid && last_bit) last_byte <= {bit_data, bits_seen};
  byte_seen <= bit_valid && last_bit;
  if (tick16) idle_ticks <= idle_ticks + 9'd1;
  if (receiving || sending || frame_over) idle_ticks <= 9'd0;
  if (idle_ticks == FRAME_OVER) frame_over <= 1'b1;
  if (byte_seen) begin
    frame_over <= 1'b0;
    if (frame_over) begin
      frame_text  <= {byte_text, {94{" "}}};
      bytes_shown <= 6'd1;
    end else if (bytes_shown != 6'd32) begin
      frame_text[8*(94-3*bytes_shown)+:16] <= byte_text;
      bytes_shown <= bytes_shown + 6'd1;
    end
  end
end
// Without byte_valid the two errors follow each bit of the character.
wire parity_flaw = byte_valid && byte_parity_error;
wire framing_flaw = byte_valid && byte_framing_error;

