// SPDX-License-Identifier: Apache-2.0
// DE is off in reset, follows the direction for 14 beats of every frame, and is off from the 15th beat to the end of
// the request (SAFE-2, SAFE-6).
//
// Assumed: nothing. A tick that jumps or an uneven mask makes other beats, and each of them counts.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;

reg g_tick = 1'b0;
reg [3:0] g_beats = 4'd0;  // since driven rose, up to 15
reg g_off = 1'b0;  // switched off in this frame
wire g_beat = ticks[0] != g_tick && (ticks & mask) == mask;
wire g_reset = !rst_n || rst;

always @(posedge clk) begin
  g_tick <= ticks[0];
  if (!driven) g_beats <= 4'd0;
  else if (g_beat && g_beats != 4'd15) g_beats <= g_beats + 4'd1;
  g_off <= driven && (g_off || (g_past && !g_reset && $fell(de) && $past(driven && !g_reset)));
end

// From the first moment on and without a clock.
always @* a_reset : assert (rst_n || !de);

always @(posedge clk) begin
  if (!g_past) a_power_up : assert (!de);
  if (g_past) begin
    a_only : assert (!de || $past(driven && !g_reset));
    a_follows : assert (!rst_n || $past(g_reset) || $past(g_beats) == 4'd15 || de == $past(driven));
    a_limit : assert ($past(g_beats) != 4'd15 || !de);
    a_stays_off : assert (!g_off || !de);
  end
end

// ---- helpers for induction
always @(posedge clk) begin
  if (g_past) begin
    i_beats : assert (beats == g_beats && tick_before == g_tick);
    i_off : assert (!g_off || g_beats == 4'd15);
  end
end

// ---- covers
always @(posedge clk) begin
  c_off : cover (g_past && g_off && mask == 7'd1);
  c_again : cover (g_past && $rose(de) && g_tick);
end
