// SPDX-License-Identifier: Apache-2.0
// request_fate: one fate for each request, and rights for its own ticket only (FRAME-6, FRAME-7, MAP-9, FC-9).
//
// Assumed: no revoke together with candidate or commit, no start bit on a silent line; writes_coils changes with
// a candidate only.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

(* hierconn *) wire \committed_i.held ;
(* hierconn *) wire \committed_i.opposite ;

localparam [1:0] G_NONE = 2'd0;
localparam [1:0] G_CANDIDATE = 2'd1;
localparam [1:0] G_COMMITTED = 2'd2;
reg [1:0] g_fate = G_NONE;
reg g_ended = 1'b0;  // since the commit a character began or the reply left
reg g_spent = 1'b0;
reg g_wish = 1'b0;  // the firmware ordered that the candidate's licence is to wait
reg g_kept = 1'b0;  // the licence of the committed request went to its place
reg [3:0] g_number = 4'd0;
wire g_there = candidate || g_fate == G_CANDIDATE;
wire g_commits = g_there && commit && silent;
wire g_order = keep && queue_ticket == ticket;
wire g_keeps = !candidate && !used && (g_order || g_wish) &&
    (g_commits || (g_order && g_fate == G_COMMITTED && !g_spent));

always @(posedge clk) begin
  if (candidate) g_number <= g_number + 4'd1;
  if (g_commits) {g_fate, g_ended, g_spent, g_kept} <= {G_COMMITTED, 1'b0, g_keeps && writes_coils, g_keeps};
  else begin
    // The line was not silent at the commit: no second one comes.
    if (candidate) {g_fate, g_ended} <= {commit ? G_NONE : G_CANDIDATE, 1'b0};
    else if (g_fate == G_CANDIDATE && (revoke || start_seen || commit)) g_fate <= G_NONE;
    else if (start_seen || reply_left) g_ended <= 1'b1;
    if (reply_left || command_left || (queue_reply && broadcast && queue_ticket == ticket)) g_spent <= 1'b1;
    if (candidate) g_kept <= 1'b0;
    if (g_keeps) g_kept <= 1'b1;
    if (g_keeps && writes_coils) g_spent <= 1'b1;
  end
  if (candidate || g_commits || withdrawn) g_wish <= 1'b0;
  else if (g_order && g_fate == G_CANDIDATE) g_wish <= 1'b1;
  if (rst) {g_fate, g_spent, g_wish, g_kept} <= {G_NONE, 3'b000};
end

reg g_coils = 1'b0;
always @(posedge clk) g_coils <= writes_coils;

always @* begin
  if (g_past && !candidate) assume (writes_coils == g_coils);
  assume (!(revoke && (candidate || commit)));
  assume (!(start_seen && silent));
end

always @(posedge clk) begin
  if (g_past) begin
    // FRAME-6
    a_candidate : assert (is_candidate == (g_fate == G_CANDIDATE));
    a_committed : assert (is_committed == (g_fate == G_COMMITTED));
    a_commits : assert (commits == g_commits);
    a_withdrawn : assert (withdrawn == (g_fate == G_CANDIDATE && (revoke || start_seen || (commit && !silent))));
    // No candidate outlives its commit: it is committed or gone.
    a_no_rest : assert (!$past(commit) || !is_candidate);
    a_one_fate : assert (!(commits && withdrawn));
    // FRAME-7: one reply, and none after a character.
    a_answerable : assert (answerable == (is_committed && !g_ended));
    // An older ticket has no rights, nor has a request without a fate.
    a_stale : assert (!(takes_reply || takes_telegram || licenses) || queue_ticket == ticket);
    a_nothing : assert (!(takes_reply || takes_telegram || licenses) || is_candidate || is_committed);
    a_own : assert (current == (queue_ticket == ticket));
    // MAP-9
    a_to_all : assert (!takes_reply || !broadcast);
    a_reply : assert (takes_reply || broadcast || !current || !(is_candidate || answerable));
    // SAFE-1, FC-9: only a committed request licenses, until it is spent; a candidate may prepare.
    a_licenses : assert (licenses == (current && is_committed && !g_spent));
    a_prepares : assert (takes_telegram == (licenses || (current && is_candidate)));
    // FRAME-7: a licence waits only from the commit on, as ordered. That of a write of coils does so once, and then
    // the request licenses nothing else (SAFE-4).
    a_kept : assert (kept == g_keeps);
    a_kept_committed : assert (!kept || g_commits || is_committed);
    a_kept_once : assert (!kept || g_commits || !g_kept || !writes_coils);
    a_kept_spends : assert (!(licenses && g_kept && g_coils));
  end
  a_ticket : assert (ticket == g_number);
end

// ---- what induction needs to know
always @(posedge clk) begin
  if (g_past) begin
    i_halves : assert (\committed_i.opposite == !\committed_i.held );
    i_spent : assert (spent == g_spent && (!g_kept || g_spent || !g_coils));
    i_wish : assert (to_keep == g_wish && (!g_wish || g_fate == G_CANDIDATE));
    i_fate : assert (g_fate != 2'd3);
  end
end

always @(posedge clk) begin
  if (g_past && !rst) begin
    c_withdrawn : cover (withdrawn);
    c_licenses : cover (licenses && g_ended);
    c_spent : cover (is_committed && current && !licenses);
    c_to_all : cover (takes_telegram && broadcast);
    c_kept_late : cover (kept && !commits);
    c_kept_early : cover (kept && !keep);
  end
end
