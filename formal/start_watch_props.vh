// SPDX-License-Identifier: Apache-2.0
// A low of ten ticks is reported once, in the clock after its tenth tick, and no shorter one is (FRAME-6, SAFE-4).
//
// Assumed: nothing.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;

reg [3:0] g_lows = 4'd0;  // ticks of the present low, up to 11
reg g_tenth = 1'b0;  // the tenth was in the clock before
always @(posedge clk) begin
  g_tenth <= tick16 && !line && g_lows == 4'd9 && !rst;
  if (line) g_lows <= 4'd0;
  else if (tick16 && g_lows != 4'd11) g_lows <= g_lows + 4'd1;
end

always @(posedge clk) begin
  if (g_past) begin
    a_seen : assert (low_seen == g_tenth);
    i_lows : assert (lows == (g_lows == 4'd11 ? 4'd10 : g_lows));
  end
end

// ---- covers
always @(posedge clk) begin
  c_seen : cover (g_past && low_seen);
  c_longer : cover (g_past && g_lows == 4'd11);
end
