// SPDX-License-Identifier: Apache-2.0
// An intact register is never damaged; a register with one flipped bit always is (SAFE-4).
//
// Nothing is assumed: value may be any, as if any of its bits had flipped since the last load.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;

reg [WIDTH-1:0] g_loaded = {{(WIDTH - 1) {1'b0}}, INITIAL};
always @(posedge clk) if (load) g_loaded <= next;

wire [WIDTH-1:0] g_flipped = value ^ g_loaded;
wire g_one = g_flipped != 0 && (g_flipped & (g_flipped - 1'b1)) == 0;

always @(posedge clk) begin
  a_intact : assert (g_flipped != 0 || !damaged);
  a_one_flip : assert (!g_one || damaged);
end

// ---- helpers for induction
always @(posedge clk) i_parity : assert (odd == ^g_loaded);

// ---- covers
always @(posedge clk) begin
  c_seen : cover (g_past && damaged && g_one && $past(load));
  c_ended : cover (g_past && !damaged && $past(damaged && load) && g_loaded != 0);
end
