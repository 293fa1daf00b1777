// SPDX-License-Identifier: Apache-2.0
// The CRC of any stream of bits is the remainder that the Modbus specification defines (FRAME-4).
//
// The reference is the polynomial division itself: 8005h, highest power first, start FFFFh. The module keeps the
// same remainder with its bits reversed, in line order.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;

reg [15:0] g_remainder = 16'hFFFF;
reg [4:0] g_own = 5'd0;  // check bits taken in succession, up to 16
integer g_i;

always @(posedge clk) begin
  if (clear) begin
    g_remainder <= 16'hFFFF;
    g_own <= 5'd0;
  end else if (bit_valid) begin
    g_remainder <= (g_remainder << 1) ^ ((g_remainder[15] ^ bit_data) ? 16'h8005 : 16'h0000);
    g_own <= bit_data != check_bit ? 5'd0 : g_own == 5'd16 ? 5'd16 : g_own + 5'd1;
  end
end

reg [15:0] g_turned;
always @* for (g_i = 0; g_i < 16; g_i = g_i + 1) g_turned[g_i] = g_remainder[15-g_i];

always @(posedge clk) begin
  a_remainder : assert (crc == g_turned);
  // Sent low byte first; good if the remainder is 0.
  a_check_bit : assert (check_bit == g_remainder[15]);
  a_good : assert (good == (g_remainder == 16'h0000));
  // Sixteen check bits in succession complete an undamaged frame.
  a_own_crc_is_good : assert (g_own != 5'd16 || good);
end

// ---- helpers for induction
always @(posedge clk) begin
  i_own : assert (g_own <= 5'd16);
  for (g_i = 0; g_i < 16; g_i = g_i + 1) if (g_i < g_own) assert (!crc[15-g_i]);
end

// ---- covers
always @(posedge clk) c_good : cover (g_past && good && g_own == 5'd16 && $past(g_own) == 5'd15);
