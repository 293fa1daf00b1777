// SPDX-License-Identifier: Apache-2.0
// master_loss: the licence is there exactly if a start was committed, it was not used since, and more than the period
// has passed since the last commit and the last order of the firmware (SAFE-7).
//
// Assumed of commit_gate, and proved there: no order is for a committed request in the clock of a commit.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

(* hierconn *) wire \armed_i.held ;
(* hierconn *) wire \armed_i.opposite ;
(* hierconn *) wire \over_i.held ;
(* hierconn *) wire \over_i.opposite ;

always @* assume (!(commits && rights));

reg g_beat = 1'b0;
reg g_start = 1'b0;  // a write of coils that leaves the start bit at 1 was committed, and the licence was not used since
reg [19:0] g_limit = 20'd0;  // of the last order
reg [20:0] g_since = 21'd0;  // ticks since the last commit or order; one more than any period at most
reg g_known = 1'b0;  // there was an order
wire g_tick = beat != g_beat;
wire g_order = watch && rights;
always @(posedge clk) begin
  g_beat <= beat;
  if (g_order && writes_coils) g_start <= running;
  else if (take && due) g_start <= 1'b0;
  if (g_order) {g_known, g_limit} <= {1'b1, period};
  if (commits || g_order) g_since <= 21'd0;
  else if (g_tick && !g_since[20]) g_since <= g_since + 21'd1;
  if (rst) {g_start, g_known} <= 2'b00;
end

always @(posedge clk) begin
  if (g_past) begin
    // None without a start, none before the time, none in the clock of a commit.
    a_start : assert (!due || g_start);
    a_time : assert (!due || (g_limit != 20'd0 && g_since > {1'b0, g_limit}));
    a_commit : assert (!(due && commits));
    // It is used once.
    a_once : assert (!$past(take && due) || !due);
    // The other way round: it comes.
    a_comes : assert (due || commits || !(g_start && g_limit != 20'd0 && g_since > {1'b0, g_limit}));
    i_beat : assert (beat_before == g_beat);
    i_armed : assert (\armed_i.held == g_start && \armed_i.opposite == !g_start);
    i_over : assert (\over_i.opposite == !\over_i.held );
    i_known : assert (!g_start || g_known);
    i_limit : assert (!g_known || limit == g_limit);
    i_left : assert (!g_known || (g_since <= {1'b0, limit} ? {1'b0, left} == {1'b0, limit} - g_since : left == 20'd0));
    i_passed : assert (!(g_known && g_start) || \over_i.held == (limit != 20'd0 && g_since > {1'b0, limit}));
    i_most : assert (!g_since[20] || g_since[19:0] == 20'd0);
  end
  if (g_past && !rst) begin
    c_due : cover (due && $past(due));
    c_used : cover (!due && $past(due && take));
    c_anew : cover (due && $past(commits, 4));
  end
end
