// SPDX-License-Identifier: Apache-2.0
// After whole bytes the value is the XOR of all of them, lowest bit first (FC-1).

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;

reg [7:0] g_sum = 8'h00;  // XOR of the whole bytes
reg [7:0] g_byte = 8'h00;  // bits of the next byte, lowest first
reg [2:0] g_bits = 3'd0;
wire [7:0] g_taken = g_byte | ({7'd0, bit_data} << g_bits);

always @(posedge clk) begin
  if (clear) begin
    g_sum  <= 8'h00;
    g_byte <= 8'h00;
    g_bits <= 3'd0;
  end else if (bit_valid) begin
    g_bits <= g_bits + 3'd1;
    g_byte <= g_bits == 3'd7 ? 8'h00 : g_taken;
    if (g_bits == 3'd7) g_sum <= g_sum ^ g_taken;
  end
end

always @(posedge clk) begin
  a_sum : assert (g_bits != 3'd0 || value == g_sum);
  a_good : assert (g_bits != 3'd0 || good == (g_sum == 8'h00));
end

// ---- helpers for induction
wire [15:0] g_ring = {g_sum ^ g_byte, g_sum ^ g_byte};
wire [15:0] g_turned = g_ring >> g_bits;
always @(posedge clk) begin
  i_turned : assert (value == g_turned[7:0]);
  i_byte : assert ((g_byte >> g_bits) == 8'h00);
end

// ---- covers
always @(posedge clk) c_good : cover (g_past && good && g_bits == 3'd0 && $past(value) == 8'h01);
