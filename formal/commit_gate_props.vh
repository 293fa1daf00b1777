// SPDX-License-Identifier: Apache-2.0
// What commit_gate promises, whatever both lines and the firmware do (SAFE-1, FRAME-6, FRAME-7, FC-9, MAP-9).
//
// The ghosts (g_*) are a second account of the request and of the telegram's content, kept from the strobes
// alone. Assumed of rtu_rx, and proved there: never revoke with candidate or commit, and a newer candidate has
// begun with a start bit; of network_port: a line on which a character begins is not quiet. Not assumed, for a
// restart of the firmware resets the gate alone, and with PREPARE_EARLY = 0 there is no candidate to revoke: that
// commit and revoke come while there is a candidate.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

reg g_candidate = 1'b0;  // the newest request is neither committed nor revoked
reg g_committed = 1'b0;  // the newest request is committed
reg g_heard = 1'b0;  // since then a character began or a reply left
reg g_spent = 1'b0;  // the newest request has its reply, or has sent its write of coils: nothing more of it
reg g_content_here = 1'b0;  // the telegram memory was not written since a telegram was queued for ...
reg g_content_ours = 1'b0;  // ... the newest request, as it then was
reg g_licensed = 1'b0;  // and that request was committed
reg g_reply_ours = 1'b0;  // the queued reply is for the newest request

reg g_newest = 1'b0;  // no other request was committed since it was queued
reg g_to_all = 1'b0;  // it was queued for a broadcast
reg [1:0] g_sends = 2'd0;  // of this telegram
reg g_told = 1'b0;  // since the first of them its request had its reply
reg g_coils_left = 1'b0;  // the newest request has sent its write of coils
reg g_open = 1'b0;
reg g_control = 1'b0;  // the telegram's request, committed, writes coils

wire g_queued = queue_telegram && !telegram_repeat;
// A commit counts for the candidate that is there, on a silent line.
wire g_commit = commit && modbus_quiet && (candidate || g_candidate);
// A start bit is enough to revoke (FRAME-6).
wire g_revoke = revoke || modbus_start_seen;
wire g_ends = telegram_touched || (g_open && !loopback_open);

always @(posedge clk) begin
  if (candidate) begin
    g_candidate <= !g_commit;
    g_committed <= g_commit;
    g_heard <= 1'b0;
  end else if (g_commit) begin
    g_candidate <= 1'b0;
    g_committed <= 1'b1;
    g_heard <= 1'b0;
  end else begin
    if (g_revoke) g_candidate <= 1'b0;
    if (g_committed && (modbus_start_seen || reply_start)) g_heard <= 1'b1;
  end
  g_open <= loopback_open;
  if (g_commit) {g_spent, g_coils_left} <= 2'b00;
  else begin
    if (reply_start || (queue_reply && queue_ticket == ticket && broadcast)) g_spent <= 1'b1;
    if (telegram_start && telegram_control && g_newest && !g_open) {g_spent, g_coils_left} <= 2'b11;
  end

  if (candidate) g_reply_ours <= 1'b0;
  else if (queue_reply) g_reply_ours <= queue_ticket == ticket;

  // A telegram belongs to the request that was the newest when it was queued. One that is queued in the
  // clock in which the request changes belongs to the old one.
  if (g_queued) begin
    g_content_here <= 1'b1;
    g_content_ours <= queue_ticket == ticket && !candidate && !(g_revoke && g_candidate) &&
        (g_candidate || (g_committed && !g_spent));
    g_licensed <= queue_ticket == ticket && !candidate && !(g_revoke && g_candidate) &&
        ((g_committed && !g_spent) || g_commit);
    g_control <= writes_coils && queue_ticket == ticket && !candidate && ((g_committed && !g_spent) || g_commit);
    g_newest <= 1'b1;
    g_to_all <= broadcast;
    g_sends <= 2'd0;
    g_told <= 1'b0;
  end else begin
    if (candidate || (g_revoke && g_candidate)) g_content_ours <= 1'b0;
    if (g_commit && !candidate && g_content_here && g_content_ours && !g_licensed) begin
      g_licensed <= 1'b1;
      g_control <= writes_coils;
    end else if (g_commit) g_newest <= 1'b0;
    if (telegram_start && g_sends != 2'd3) g_sends <= g_sends + 2'd1;
    if (reply_start && g_newest && !loopback_open) g_told <= 1'b1;
  end
  if (g_ends) begin
    g_content_here <= 1'b0;
    g_content_ours <= 1'b0;
    g_licensed <= 1'b0;
  end

  if (rst) begin
    g_candidate <= 1'b0;
    g_committed <= 1'b0;
    g_heard <= 1'b0;
    g_reply_ours <= 1'b0;
    {g_spent, g_coils_left} <= 2'b00;
    g_content_here <= 1'b0;
    g_content_ours <= 1'b0;
    g_licensed <= 1'b0;
  end
end

always @* begin
  if (g_past) begin
    assume (!(commit && revoke));
    assume (!(candidate && revoke));
    assume (!(modbus_start_seen && modbus_quiet));
    // A newer frame has begun with a start bit.
    assume (!candidate || !g_committed || g_heard);
  end
end

reg g_broadcast = 1'b0;  // rtu_rx holds it from candidate to candidate
always @(posedge clk) g_broadcast <= broadcast;
always @* if (g_past && !candidate) assume (broadcast == g_broadcast);

// ---- safety
always @(posedge clk) begin
  if (g_past && !rst && !loopback_open) begin
    // SAFE-1, SAFE-4: what leaves was queued for a request that was committed and had no reply yet, and was
    // not changed since, nor in this clock.
    a_licensed : assert (!telegram_start || (g_licensed && g_content_here && !telegram_touched));
    // SAFE-1: and only a write of coils may command the drive.
    a_control : assert (!(telegram_start && telegram_control) || g_control);
    // FC-9, SAFE-4: at most twice; the second time only while its request is the newest that was committed, has
    // no reply and is no broadcast. A write of coils makes no second telegram.
    a_twice : assert (!telegram_start || g_sends < 2'd2);
    a_repeat : assert (!telegram_start || g_sends == 2'd0 || (g_newest && !g_to_all));
    a_told : assert (!telegram_start || !g_told);
    a_one_command : assert (!(telegram_start && telegram_control && g_newest) || g_sends != 2'd0 || !g_coils_left);
    // FC-8: and it leaves on a silent line only.
    a_drive_quiet : assert (!telegram_start || drive_quiet);
    // FRAME-6, FRAME-7: a reply answers the newest request, committed, with nothing heard since.
    a_reply_committed : assert (!reply_start || (g_committed && !g_heard && g_reply_ours));
    a_reply_quiet : assert (!reply_start || modbus_quiet);
    // MAP-9
    a_no_reply_to_all : assert (!reply_start || !broadcast);
  end
end

// What the firmware reads: whether the telegram that it queued last has left.
reg g_started = 1'b0;
always @(posedge clk) begin
  if (telegram_start) g_started <= 1'b1;
  if (queue_telegram) g_started <= 1'b0;
  if (rst) g_started <= 1'b0;
  if (g_past) a_started : assert (telegram_started == g_started);
end

// ---- what induction needs to know
always @(posedge clk) begin
  if (g_past) begin
    i_candidate : assert (is_candidate == g_candidate);
    i_committed : assert (is_committed == g_committed && committed == g_committed && uncommitted == !committed);
    i_answerable : assert (answerable == (g_committed && !g_heard));
    i_opposite : assert (unlicensed == !licensed);
    i_licensed : assert (!licensed || g_open || (g_licensed && g_content_here));
    i_queued : assert (!telegram_queued || licensed || (g_content_here && g_content_ours && g_candidate));
    i_fresh : assert (!telegram_queued || licensed || (!begun && newest && g_newest && repeatable == !g_to_all &&
        g_sends == 2'd0 && !g_told));
    i_not_yet : assert (!(telegram_queued && !licensed && g_licensed));
    i_reply : assert (!reply_queued || !broadcast || candidate || g_open);
    i_reply_ours : assert (!reply_queued || g_reply_ours || g_open);
    i_spent : assert (spent || !g_spent);
    i_left : assert (!g_coils_left || spent);
    i_state : assert (!(g_candidate && g_committed));
    i_control : assert (!(licensed && telegram_control) || g_open || g_control);
    i_open : assert (was_open == g_open);
    i_newest : assert (!licensed || g_open || newest == g_newest);
    i_repeatable : assert (!(licensed && repeatable) || g_open || (g_newest && !g_to_all));
    i_begun : assert (!licensed || g_open || begun == (g_sends != 2'd0));
    i_twice : assert (!licensed || g_open || g_sends < 2'd2);
    i_told : assert (!licensed || g_open || !g_told);
    i_waiting : assert (!(telegram_queued && licensed && begun) || g_open || repeatable);
    i_coils_left : assert (!(licensed && telegram_control && newest && !begun) || g_open || !g_coils_left);
  end
end

// ---- it is not safe by doing nothing
always @(posedge clk) begin
  if (g_past && !rst && !g_open && !loopback_open) begin
    c_telegram : cover (telegram_start);
    c_control : cover (telegram_start && telegram_control);
    c_repeat : cover (telegram_start && $past(queue_telegram && telegram_repeat));
    c_newer : cover (telegram_start && g_candidate);
    // Prepared early: it was queued for the candidate, and leaves with the commit.
    c_early : cover (telegram_start && g_newest && $past(g_commit && !g_queued));
    c_reply : cover (reply_start && wait_drive);
  end
end
