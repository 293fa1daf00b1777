// SPDX-License-Identifier: Apache-2.0
// What commit_gate promises, whatever both lines and the firmware do (SAFE-1, FRAME-6, FRAME-7, MAP-9).
//
// The ghosts (g_*) are a second account of the request and of the telegram's content, kept from the strobes
// alone. Assumed of rtu_rx, and proved there: never revoke with candidate or commit, and a newer candidate has
// begun with a start bit. Not assumed, for a restart of the firmware resets the gate alone, and with
// PREPARE_EARLY = 0 there is no candidate to revoke: that commit and revoke come while there is a candidate.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

reg g_candidate = 1'b0;  // the newest request is neither committed nor revoked
reg g_committed = 1'b0;  // the newest request is committed
reg g_heard = 1'b0;  // since then a character began or a reply left
reg g_spent = 1'b0;  // the newest request, committed, has its reply: it licenses nothing more
reg g_content_here = 1'b0;  // the telegram memory was not written since a telegram was queued for ...
reg g_content_ours = 1'b0;  // ... the newest request, as it then was
reg g_licensed = 1'b0;  // and that request was committed
reg g_reply_ours = 1'b0;  // the queued reply is for the newest request

wire g_queued = queue_telegram && !telegram_repeat;

always @(posedge clk) begin
  if (candidate) begin
    g_candidate <= !commit;
    g_committed <= commit;
    g_heard <= 1'b0;
  end else if (commit) begin
    g_candidate <= 1'b0;
    g_committed <= 1'b1;
    g_heard <= 1'b0;
  end else begin
    if (revoke) g_candidate <= 1'b0;
    if (g_committed && (modbus_start_seen || reply_start)) g_heard <= 1'b1;
  end
  if (commit) g_spent <= 1'b0;
  else if (reply_start || (queue_reply && queue_ticket == ticket && broadcast)) g_spent <= 1'b1;

  // A telegram belongs to the request that was the newest when it was queued. One that is queued in the
  // clock in which the request changes belongs to the old one.
  if (g_queued) begin
    g_content_here <= 1'b1;
    g_content_ours <= queue_ticket == ticket && !candidate && !(revoke && g_candidate) &&
        (g_candidate || (g_committed && !g_spent));
    g_licensed <= queue_ticket == ticket && !candidate && !(revoke && g_candidate) &&
        ((g_committed && !g_spent) || commit);
  end else begin
    if (candidate || (revoke && g_candidate)) g_content_ours <= 1'b0;
    if (commit && !candidate && g_content_here && g_content_ours) g_licensed <= 1'b1;
  end
  if (telegram_touched) begin
    g_content_here <= 1'b0;
    g_content_ours <= 1'b0;
    g_licensed <= 1'b0;
  end

  if (rst) begin
    g_candidate <= 1'b0;
    g_committed <= 1'b0;
    g_heard <= 1'b0;
    g_spent <= 1'b0;
    g_content_here <= 1'b0;
    g_content_ours <= 1'b0;
    g_licensed <= 1'b0;
  end
end

always @* begin
  if (g_past) begin
    assume (!(commit && revoke));
    assume (!(candidate && revoke));
    // A newer frame has begun with a start bit.
    assume (!candidate || !g_committed || g_heard);
  end
end

reg g_broadcast = 1'b0;  // rtu_rx holds it from candidate to candidate
always @(posedge clk) g_broadcast <= broadcast;
always @* if (g_past && !candidate) assume (broadcast == g_broadcast);

// ---- safety
always @(posedge clk) begin
  if (g_past && !rst && !loopback_open && !g_loop) begin
    // SAFE-1, SAFE-4: what leaves was queued for a request that was committed and had no reply yet, and was
    // not changed since.
    a_licensed : assert (!telegram_start || (g_licensed && g_content_here));
    // FC-8: and it leaves on a silent line only.
    a_drive_quiet : assert (!telegram_start || drive_quiet);
    // FRAME-6, FRAME-7: a reply answers the newest request, committed, with nothing heard since.
    a_reply_committed : assert (!reply_start || (g_committed && !g_heard));
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

// The loop-back test sends without a request; its traces are not looked at further.
reg g_loop = 1'b0;
always @(posedge clk) g_loop <= (g_loop || loopback_open) && !rst;

// ---- what induction needs to know
always @(posedge clk) begin
  if (g_past && !g_loop) begin
    i_candidate : assert (is_candidate == g_candidate);
    i_committed : assert (is_committed == g_committed);
    i_answerable : assert (answerable == (g_committed && !g_heard));
    i_licensed : assert (!licensed || (g_licensed && g_content_here));
    i_queued : assert (!telegram_queued || licensed || (g_content_here && g_content_ours && g_candidate));
    i_reply : assert (!reply_queued || !broadcast || candidate);
    i_spent : assert (spent == g_spent);
    i_state : assert (!(g_candidate && g_committed));
  end
end

// ---- it is not safe by doing nothing
always @(posedge clk) begin
  if (g_past && !rst && !g_loop && !loopback_open) begin
    c_telegram : cover (telegram_start);
    c_repeat : cover (telegram_start && $past(queue_telegram && telegram_repeat));
    c_newer : cover (telegram_start && g_candidate);
    c_reply : cover (reply_start && wait_drive);
  end
end
