// SPDX-License-Identifier: Apache-2.0
// guarded_bit: a flip-flop as long as nothing flips, and never 1 while its halves disagree (SAFE-4).
//
// prove: from power-up on, value is what was loaded last, and no fault shows. prove_flipped: from any state, so with
// any bit flipped in the clock before.

reg g_after_load = 1'b0;  // in the clock before a load or reset came
reg g_loaded = 1'b0;
always @(posedge clk) begin
  g_after_load <= load || rst;
  g_loaded <= load && data && !rst;
end

`ifdef FLIPPED
reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;

always @(posedge clk) begin
  // A pair that disagrees shows it and counts as 0. One flip makes every pair that agrees such a pair.
  a_not_one : assert (!(value && fault));
  a_either_half : assert (fault == !(held ^ opposite));
  // The next load or reset mends it.
  if (g_past) a_mended : assert (!g_after_load || (!fault && value == g_loaded));
end
`else
reg g_value = 1'b0;
always @(posedge clk) begin
  if (rst) g_value <= 1'b0;
  else if (load) g_value <= data;
end

always @(posedge clk) begin
  a_follows : assert (value == g_value);
  a_no_fault : assert (!fault);
  i_halves : assert (held == g_value && opposite == !g_value);
  c_one : cover (value && g_after_load);
  c_zero : cover (!value && g_after_load && !rst && $past(value));
end
`endif
