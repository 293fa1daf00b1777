// SPDX-License-Identifier: Apache-2.0
// loopback_end: one clock of closing for each end of the loop-back test, and none else (LOOP-1).

reg g_before = 1'b0;
always @(posedge clk) g_before <= loopback_open;

always @(posedge clk) begin
  a_end : assert (closing == (g_before && !loopback_open));
  i_open : assert (was_open == g_before);
  c_end : cover (closing);
end
