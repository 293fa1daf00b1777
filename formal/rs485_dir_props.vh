// SPDX-License-Identifier: Apache-2.0
// DE is high from a request to the end of the last stop bit, and not one clock longer (LINE-6, FC-10, SAFE-2).

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

reg [3:0] g_ticks = 4'd0;  // ticks with DE high, up to 15
reg g_was_requested = 1'b0;  // in the clock before
reg g_was_busy = 1'b0;
reg g_was_reset = 1'b1;
always @(posedge clk) begin
  g_was_requested <= request;
  g_was_busy <= tx_busy;
  g_was_reset <= rst;
  if (!de) g_ticks <= 4'd0;
  else if (tick16 && g_ticks != 4'd15) g_ticks <= g_ticks + 4'd1;
  if (rst) g_ticks <= 4'd0;
end

reg g_was_de = 1'b0;
always @(posedge clk) g_was_de <= de;

always @(posedge clk) begin
  if (g_past) begin
    a_reset : assert (!g_was_reset || !de);
    // DE rises for a request only, one clock after it.
    a_rises_for_request : assert (!de || g_was_de || g_was_requested);
    a_rises : assert (g_was_reset || !g_was_requested || de);
    // DE stays while a character is on the line, and falls in the next clock.
    a_stays : assert (g_was_reset || !g_was_de || !g_was_busy || de);
    a_falls : assert (g_was_requested || g_was_busy || !de);
    // The first start bit may begin LEAD_TICKS after DE: 1/4 bit, or 9/16 bit (LINE-6).
    a_lead : assert (ready == (g_ticks >= LEAD_TICKS));
  end
end

// ---- helpers for induction
always @(posedge clk) if (g_past) i_lead : assert (lead == (g_ticks < LEAD_TICKS ? g_ticks : LEAD_TICKS));

// ---- covers
always @(posedge clk) begin
  c_sends : cover (g_past && de && ready && tx_busy && !request);
  c_falls : cover (g_was_de && !de && g_ticks == 4'd9);
end
