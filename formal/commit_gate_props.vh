// SPDX-License-Identifier: Apache-2.0
// commit_gate at its pins: what leaves, and what must leave (SAFE-1, SAFE-4, FRAME-6, FRAME-7, FC-8, FC-9, MAP-9).
//
// The ghosts (g_*) follow the rules from the strobes alone: the fate of the newest request, the reply ordered for it,
// the request that caused the telegram in the memory, and the requests whose licences wait. One committed request,
// whichever, is marked, and all that it causes is followed. SMALL: PLACES = 1. STOP: MASTER_LOSS_STOP = 1. Assumed of
// rtu_rx, and proved there: no revoke together with candidate or commit; a newer candidate began with a start bit;
// broadcast and writes_coils stay until the next candidate.
// Assumed of network_port: a line on which a character begins is not silent, a quiet line is. Assumed of mailbox_regs:
// one order in a clock. No candidate is assumed before a commit or revoke, because a restart of the firmware resets
// the gate alone.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

// Registers inside the instances, by their hierarchical names.
(* hierconn *) wire \request_i.committed_i.held ;
(* hierconn *) wire \request_i.committed_i.opposite ;
(* hierconn *) wire \request_i.answerable ;
(* hierconn *) wire \request_i.spent ;
(* hierconn *) wire \reply_i.wait_drive ;
(* hierconn *) wire \telegram_i.licence_i.held ;
(* hierconn *) wire \telegram_i.licence_i.opposite ;
(* hierconn *) wire \telegram_i.newest ;
(* hierconn *) wire \telegram_i.repeatable ;
(* hierconn *) wire \telegram_i.fresh_i.held ;
(* hierconn *) wire \telegram_i.fresh_i.opposite ;
(* hierconn *) wire \telegram_i.from_place ;
(* hierconn *) wire \request_i.to_keep ;
(* hierconn *) wire \broadcast_i.valid_i.held ;
(* hierconn *) wire \broadcast_i.valid_i.opposite ;
`ifdef SMALL
`else
(* hierconn *) wire \g_unicast.unicast_i.valid_i.held ;
(* hierconn *) wire \g_unicast.unicast_i.valid_i.opposite ;
`endif
(* hierconn *) wire \loopback_i.was_open ;
// Such a name loses its power-up value; a reset sets the others.
initial assume (\reply_i.wait_drive == 1'b0);
wire g_gate_licensed = \telegram_i.licence_i.held ;
wire g_gate_newest = \telegram_i.newest ;
wire g_gate_begun = !\telegram_i.fresh_i.held ;

// ---- the newest request (FRAME-6): raised as a candidate, then committed, or revoked by a character
reg g_pending = 1'b0;
reg g_committed = 1'b0;
reg g_heard = 1'b0;  // since its commit a character began (FRAME-7), or its reply left
reg g_spent = 1'b0;  // its reply or its write of coils has left; or, a broadcast, the firmware is done with it
reg g_command_left = 1'b0;
wire g_commits = commit && modbus_silent && (candidate || g_pending);
// A commit on a line that is not silent ends the candidate, too.
wire g_revoked = g_pending && (revoke || modbus_start_seen || (commit && !modbus_silent));
reg [3:0] g_ticket = 4'd0;  // its number
wire g_broadcast_done = queue_reply && queue_ticket == g_ticket && broadcast;

// ---- the reply: ordered for the newest request
reg g_reply_due = 1'b0;
reg g_reply_waits = 1'b0;  // for the drive's reply (PERF-3)

// ---- the telegram in the memory, as it was ordered, and the request that caused it
localparam [1:0] G_NO_CAUSE = 2'd0;
localparam [1:0] G_PENDING = 2'd1;
localparam [1:0] G_COMMITTED = 2'd2;
reg [1:0] g_cause = G_NO_CAUSE;
reg g_command = 1'b0;  // the cause, committed, writes coils
reg g_newest = 1'b0;  // no other request was committed since the order
reg g_to_all = 1'b0;  // ordered for a broadcast
reg g_answered = 1'b0;  // since the order the cause had its reply
reg [1:0] g_sends = 2'd0;
reg g_first = 1'b0;  // not sent yet; a repeat ordered before the first start withdraws it
reg g_placed = 1'b0;  // its licence had waited
reg g_waited = 1'b0;  // in the clock before another licence waited
reg g_open = 1'b0;

// An order of the loop-back test has no request (LOOP-1). In the clock in which a request ends, an order is still for
// that request.
wire g_for_newest = queue_ticket == g_ticket && !loopback_open && !candidate && !g_revoked;

// ---- the stop when the master is lost (SAFE-7)
`ifdef STOP
(* hierconn *) wire \g_loss.loss_i.beat_before ;
(* hierconn *) wire [19:0] \g_loss.loss_i.limit ;
(* hierconn *) wire [19:0] \g_loss.loss_i.left ;
(* hierconn *) wire \g_loss.loss_i.armed_i.held ;
(* hierconn *) wire \g_loss.loss_i.armed_i.opposite ;
(* hierconn *) wire \g_loss.loss_i.over_i.held ;
(* hierconn *) wire \g_loss.loss_i.over_i.opposite ;
initial assume (!\g_loss.loss_i.beat_before );
wire g_for_stop = waiting_stop;
wire g_watch = watch && queue_ticket == g_ticket && g_committed && !candidate;
reg g_beat = 1'b0;
reg g_start = 1'b0;  // a write of coils with the start bit 1 was committed, and no stop was licensed since
reg g_known = 1'b0;
reg [19:0] g_limit = 20'd0;
reg [20:0] g_since = 21'd0;  // ticks since the last commit and the last order to watch
always @(posedge clk) begin
  g_beat <= beat;
  if (g_watch) {g_known, g_limit} <= {1'b1, period};
  if (g_watch && writes_coils) g_start <= running;
  else if (use_waiting && waiting_stop && stop_due) g_start <= 1'b0;
  if (g_commits || g_watch) g_since <= 21'd0;
  else if (beat != g_beat && !g_since[20]) g_since <= g_since + 21'd1;
  if (rst) {g_known, g_start} <= 2'b00;
end
always @(posedge clk) begin
  if (g_past) begin
    // None is licensed without a committed start, or before the time without a commit has passed.
    a_stop_due : assert (stop_due == (g_start && g_limit != 20'd0 && g_since > {1'b0, g_limit} && !g_commits));
    i_stop_beat : assert (\g_loss.loss_i.beat_before == g_beat);
    i_stop_armed : assert (\g_loss.loss_i.armed_i.held == g_start && \g_loss.loss_i.armed_i.opposite == !g_start);
    i_stop_over : assert (\g_loss.loss_i.over_i.opposite == !\g_loss.loss_i.over_i.held );
    i_stop_known : assert (g_known || !g_start);
    i_stop_limit : assert (!g_known || \g_loss.loss_i.limit == g_limit);
    i_stop_left : assert (!g_known || (g_since <= {1'b0, g_limit} ?
        {1'b0, \g_loss.loss_i.left } == {1'b0, g_limit} - g_since : \g_loss.loss_i.left == 20'd0));
    i_stop_passed : assert (!(g_known && g_start) ||
        \g_loss.loss_i.over_i.held == (g_limit != 20'd0 && g_since > {1'b0, g_limit}));
    i_stop_most : assert (!g_since[20] || g_since[19:0] == 20'd0);
  end
  if (g_past && !rst) c_stop : cover (telegram_start && telegram_stop);
end
`else
wire g_for_stop = 1'b0;
always @(posedge clk) if (g_past) a_no_stop : assert (!stop_due && !telegram_stop);
`endif
reg g_stops = 1'b0;  // the telegram in the memory was ordered as the stop
always @(posedge clk) begin
  if (queue_telegram || use_waiting) g_stops <= use_waiting && g_for_stop;
  // The stop never carries the start bit: fc_tx sends it as 0 with telegram_stop.
  if (g_past) a_stops : assert (telegram_stop == g_stops);
end

// ---- the licences that wait: 1 of a broadcast, 0 of a unicast write (FRAME-7)
reg [1:0] g_there = 2'b00;
reg [1:0] g_place_command = 2'b00;  // that request writes coils
reg g_wish = 1'b0;  // ordered for the candidate
`ifdef SMALL
wire g_keep = keep_write && queue_ticket == g_ticket && broadcast;
`else
wire g_keep = keep_write && queue_ticket == g_ticket;
`endif
wire g_may_keep = !candidate && (g_commits ? g_wish || g_keep : g_keep && g_committed && !g_spent);
// It has a telegram of its own in the memory.
wire g_own_now = queue_telegram && g_for_newest;
wire g_has_own = g_commits ? g_own_now || g_cause == G_PENDING : g_cause == G_COMMITTED && g_newest;
// Not `kept` alone: a register that flips must not change the rule (formal/flips.py).
wire g_kept = kept && g_may_keep;
wire [1:0] g_filled = {g_kept && broadcast, g_kept && !broadcast};
wire g_take = use_waiting && !g_for_stop;
wire [1:0] g_taken = {g_take && waiting_to_all, g_take && !waiting_to_all};
wire g_use = use_waiting && (g_for_stop ? stop_due : g_there[waiting_to_all]);

wire g_order = queue_telegram || use_waiting;
wire g_lost = telegram_touched || (g_open && !loopback_open);

always @(posedge clk) begin
  g_open <= loopback_open;

  if (g_commits) {g_pending, g_committed, g_heard} <= 3'b010;
  else if (candidate) {g_pending, g_committed, g_heard} <= {!commit, 2'b00};
  else begin
    if (g_revoked) g_pending <= 1'b0;
    if (g_committed && (modbus_start_seen || reply_start)) g_heard <= 1'b1;
  end
  if (g_commits) {g_spent, g_command_left} <= {g_kept && writes_coils, 1'b0};
  else begin
    if (g_kept && writes_coils) g_spent <= 1'b1;
    if (reply_start || g_broadcast_done) g_spent <= 1'b1;
    if (telegram_start && telegram_control && g_newest) {g_spent, g_command_left} <= 2'b11;
  end

  if (queue_reply) begin
    g_reply_waits <= reply_after_drive;
    g_reply_due <= queue_ticket == g_ticket && !loopback_open && !reply_empty && !broadcast &&
        (g_pending || (g_committed && !g_heard));
  end else if (reply_start) g_reply_due <= 1'b0;
  if (candidate || g_revoked || (g_committed && modbus_start_seen)) g_reply_due <= 1'b0;
  if ((g_open && !loopback_open) || (drive_bad && g_reply_waits)) g_reply_due <= 1'b0;

  if (candidate || g_commits || g_revoked) g_wish <= 1'b0;
  else if (g_keep && g_pending) g_wish <= 1'b1;
  g_there <= (g_there & ~g_taken) | g_filled;
  g_place_command <= (g_place_command & ~g_filled) | (g_filled & {2{writes_coils}});
  g_waited <= g_there != 2'b00;

  if (use_waiting) begin
    g_cause <= g_use ? G_COMMITTED : G_NO_CAUSE;
    {g_command, g_newest, g_to_all, g_answered, g_sends} <= {
      g_for_stop || g_place_command[waiting_to_all], queue_ticket == g_ticket && !candidate,
      waiting_to_all && !g_for_stop, 1'b0, 2'd0
    };
    g_placed <= 1'b1;
  end else if (g_order) begin
    g_placed <= 1'b0;
    g_cause <= G_NO_CAUSE;
    if (g_for_newest && g_pending) g_cause <= g_commits ? G_COMMITTED : G_PENDING;
    if (g_for_newest && g_committed && (g_commits || !g_spent)) g_cause <= G_COMMITTED;
    {g_command, g_newest, g_to_all, g_answered, g_sends} <= {writes_coils, 1'b1, broadcast, 1'b0, 2'd0};
  end else begin
    if (g_cause == G_PENDING) begin
      if (g_revoked || candidate) g_cause <= G_NO_CAUSE;
      else if (g_commits) {g_cause, g_command} <= {G_COMMITTED, writes_coils};
    end
    if (g_commits && !(g_cause == G_PENDING && !candidate)) g_newest <= 1'b0;
    if (reply_start && g_newest && !loopback_open) g_answered <= 1'b1;
    if (telegram_start && g_sends != 2'd3) g_sends <= g_sends + 2'd1;
  end
  if (g_order) g_first <= 1'b1;
  else if (telegram_start || repeat_telegram) g_first <= 1'b0;
  if (g_lost) g_cause <= G_NO_CAUSE;

  if (rst) begin
    {g_pending, g_committed, g_heard, g_spent, g_command_left, g_reply_due} <= 6'd0;
    g_cause <= G_NO_CAUSE;
    {g_there, g_wish} <= 3'd0;
  end
end

// ---- one committed write of coils, and the commands that it caused
(* anyseq *) reg g_pick;
reg g_marked = 1'b0;  // a request was marked as it was committed
reg g_mark_newest = 1'b0;  // it is still the newest that has committed
reg g_mark_own = 1'b0;  // the telegram in the memory was ordered for it
reg g_mark_kept = 1'b0;  // its licence was kept
reg [1:0] g_mark_there = 2'b00;  // and waits
reg g_mark_left = 1'b0;  // a command that it caused has left
wire g_mark = g_commits && g_pick && !g_marked && writes_coils;
wire g_mark_kept_now = g_kept && (g_commits ? g_mark : g_mark_newest);
always @(posedge clk) begin
  if (g_mark) g_marked <= 1'b1;
  if (g_commits) g_mark_newest <= g_mark;
  if (g_mark_kept_now) g_mark_kept <= 1'b1;
  g_mark_there <= (g_mark_there & ~g_taken & ~g_filled) | (g_filled & {2{g_mark_kept_now}});
  if (use_waiting) g_mark_own <= !g_for_stop && g_mark_there[waiting_to_all];
  else if (queue_telegram) g_mark_own <= g_for_newest && (g_commits ? g_mark : g_committed && !g_spent && g_mark_newest);
  else if (g_mark) g_mark_own <= g_cause == G_PENDING && !candidate;
  if (telegram_start && telegram_control && g_mark_own) g_mark_left <= 1'b1;
  if (rst) {g_mark_newest, g_mark_own, g_mark_there} <= 4'd0;
  // In the loop-back test telegrams have no request.
  if (loopback_open || g_open)
    {g_marked, g_mark_newest, g_mark_own, g_mark_kept, g_mark_there, g_mark_left} <= 7'd0;
end

reg g_broadcast = 1'b0;
reg g_coils = 1'b0;
always @(posedge clk) {g_broadcast, g_coils} <= {broadcast, writes_coils};
always @* begin
  if (g_past) begin
    assume (!(revoke && (candidate || commit)));
    assume (!(modbus_start_seen && modbus_silent));
    assume (!modbus_quiet || modbus_silent);
    assume ({2'd0, queue_telegram} + {2'd0, use_waiting} + {2'd0, repeat_telegram} + {2'd0, keep_write} +
        {2'd0, queue_reply} + {2'd0, watch} <= 3'd1);
    assume (!candidate || !g_committed || g_heard);
    if (!candidate) assume (broadcast == g_broadcast && writes_coils == g_coils);
  end
end

wire g_sound = g_past && !rst && !loopback_open && !g_open;
always @(posedge clk) begin
  if (g_past && !rst && !loopback_open) begin
    // SAFE-1, SAFE-4: what leaves was ordered for a request that has committed or as the stop, and its memory was not written since,
    // nor is in this clock.
    a_caused : assert (!telegram_start || (g_cause == G_COMMITTED && !telegram_touched));
    // SAFE-1: only a write of coils commands the drive, and the stop.
    a_command : assert (!(telegram_start && telegram_control) || g_command);
    // FC-9: one repeat, and only of the newest request that has committed, or of one that had waited; without a
    // reply yet, not of a broadcast, and not while another write waits.
    a_twice : assert (!telegram_start || g_sends < 2'd2);
    a_repeat : assert (!telegram_start || g_sends == 2'd0 || (!g_to_all && (g_newest || g_placed) && !g_waited));
    a_answered : assert (!telegram_start || !g_answered);
    // SAFE-4: a write of coils makes no second telegram.
    a_one_command : assert (!(telegram_start && telegram_control && g_mark_own) || g_sends != 2'd0 || !g_mark_left);
    // FC-8
    a_drive_quiet : assert (!telegram_start || drive_quiet);
    // FRAME-6, FRAME-7, MAP-9: a reply answers the newest request, committed, no broadcast, nothing heard since.
    a_reply : assert (!reply_start || (g_reply_due && g_committed && !g_heard && !broadcast));
    // FRAME-8: t3.5 of silence.
    a_reply_quiet : assert (!reply_start || modbus_quiet);
    // PERF-3
    a_after_drive : assert (!reply_start || !g_reply_waits || drive_good);
  end
  // The other way round: nothing that should leave stays.
  if (g_sound) begin
    // FRAME-6: what was ordered for a request leaves when that has committed and the line is quiet.
    a_reply_leaves : assert (reply_start || !(g_reply_due && g_committed && !g_heard && modbus_quiet &&
        (!g_reply_waits || drive_good)));
    a_telegram_leaves : assert (telegram_start || !(g_cause == G_COMMITTED && g_first && !g_answered &&
        drive_quiet && !g_order && !repeat_telegram && !telegram_touched));
  end
  if (g_past) begin
    // FRAME-6, LINE-5: a candidate that is not revoked commits; the firmware sees both.
    a_status : assert ({is_candidate, is_committed} == {g_pending, g_committed});
    // FRAME-7: a licence is kept for a committed request only, and is kept if that has no telegram of its own yet.
    a_kept : assert (!kept || g_may_keep);
    a_keeps : assert (kept || !g_may_keep || g_has_own || g_open || loopback_open);
    // It stays until it is used, a newer one of its kind takes its place, or the gate is reset; the order for it has
    // its right in the next clock.
    a_waits : assert ({broadcast_valid, unicast_valid} == g_there);
    a_used : assert (g_open || loopback_open || rst || !$past(g_use && !g_lost && !rst) ||
        (telegram_queued && g_cause == G_COMMITTED && g_sends == 2'd0));
  end
end

// The firmware sees whether the telegram that it ordered last has left.
reg g_started = 1'b0;
always @(posedge clk) begin
  if (telegram_start) g_started <= 1'b1;
  if (g_order || repeat_telegram || rst) g_started <= 1'b0;
  if (candidate) g_ticket <= g_ticket + 4'd1;
  if (g_past) a_started : assert (telegram_started == g_started);
  // FRAME-5: every candidate has the next number.
  a_ticket : assert (ticket == g_ticket);
end

// ---- what induction needs to know
always @(posedge clk) begin
  if (g_past) begin
    i_committed : assert (\request_i.committed_i.held == g_committed && \request_i.committed_i.opposite == !g_committed);
    i_opposite : assert (\telegram_i.licence_i.opposite == !g_gate_licensed);
    i_fresh_halves : assert (\telegram_i.fresh_i.opposite == g_gate_begun);
    i_answerable : assert (\request_i.answerable == (g_committed && !g_heard));
    i_spent : assert (\request_i.spent == g_spent);
    i_open : assert (\loopback_i.was_open == g_open);
    i_either : assert (!(g_pending && g_committed) && g_cause != 2'd3);
    i_sends : assert (!g_first || g_sends == 2'd0);
    i_left : assert (!g_command_left || g_spent);
    i_cause : assert (g_cause != G_PENDING || (g_pending && g_newest && g_sends == 2'd0 && !g_answered));
    i_waits : assert (\reply_i.wait_drive == g_reply_waits);
    i_reply : assert (reply_queued == g_reply_due || g_open);
    i_reply_due : assert (!g_reply_due || (reply_queued && !broadcast && (g_pending || g_committed)) || candidate);
    i_newest : assert (!g_gate_licensed || g_gate_newest == g_newest);
    i_licensed : assert (!g_gate_licensed || g_open || g_cause == G_COMMITTED);
    i_queued : assert (!telegram_queued || g_gate_licensed || (g_cause == G_PENDING && g_first));
    i_pending : assert (g_cause != G_PENDING || !g_first || (telegram_queued && !g_gate_licensed && !g_gate_begun && g_gate_newest));
    i_not_yet : assert (g_cause != G_PENDING || !g_gate_licensed);
    i_first : assert (!(g_cause == G_COMMITTED && g_first && !g_answered) || (telegram_queued && g_gate_licensed));
    i_command : assert (!(g_gate_licensed && telegram_control) || g_open || g_command);
    i_repeatable : assert (!(g_gate_licensed && \telegram_i.repeatable ) || g_open ||
        ((g_newest || g_placed) && !g_to_all));
    i_placed : assert (!(g_gate_licensed || g_cause == G_PENDING) || \telegram_i.from_place == (g_placed && !g_to_all));
    i_wish : assert (\request_i.to_keep == g_wish && (!g_wish || g_pending));
    i_place : assert (\broadcast_i.valid_i.held == g_there[1] && \broadcast_i.valid_i.opposite == !g_there[1]);
    i_place_command : assert ((!g_there[1] || broadcast_control == g_place_command[1]) &&
        (!g_there[0] || unicast_control == g_place_command[0]));
`ifdef SMALL
    i_place_none : assert (!g_there[0] && !(g_wish && !broadcast && !candidate));
`else
    i_place_unicast : assert (\g_unicast.unicast_i.valid_i.held == g_there[0] &&
        \g_unicast.unicast_i.valid_i.opposite == !g_there[0]);
`endif
    // The marked request commands once: by its own telegram, or by the licence that was kept.
    i_mark : assert ((g_marked || !(g_mark_newest || g_mark_own || g_mark_kept || g_mark_left || g_mark_there != 2'b00)));
    i_mark_there : assert ((g_mark_there & ~g_there) == 2'b00 && g_mark_there != 2'b11);
    i_mark_waits : assert (g_mark_there == 2'b00 || (g_mark_kept && !g_mark_left && !(g_mark_own && g_gate_licensed)));
    i_fresh : assert (g_cause != G_PENDING || \telegram_i.repeatable == !g_to_all);
    i_begun : assert (!g_gate_licensed || (g_open && g_cause != G_COMMITTED) || g_gate_begun == (g_sends != 2'd0));
    i_twice : assert (!g_gate_licensed || g_open || (g_sends < 2'd2 && !g_answered));
    i_repeat : assert (!(telegram_queued && g_gate_licensed && g_gate_begun) || g_open || \telegram_i.repeatable );
    i_one : assert (!(g_gate_licensed && telegram_control && g_mark_own && !g_gate_begun) || g_open || !g_mark_left);
    i_mark_coils : assert (!(g_mark_newest && g_committed) || g_coils);
    i_mark_kept : assert (!(g_mark_newest && (g_mark_kept || g_mark_left)) || !g_committed || g_spent);
    i_mark_placed : assert (!(g_mark_own && g_placed) || g_mark_kept);
    i_mark_either : assert (!(g_mark_own && g_gate_licensed && !g_placed && g_mark_kept));
    i_mark_cause : assert (g_cause != G_PENDING || !(g_mark_own || g_placed));
    i_mark_own : assert (!(g_mark_own && g_cause == G_COMMITTED && !g_placed && g_gate_licensed && g_mark_newest) || g_newest);
  end
end

`ifdef FLIPPED
// ---- one flipped bit of the gate (formal/flips.py): what its neighbours still promise
reg g_live = 1'b0;  // rtu_rx: no commit without its candidate, or after its revoke
reg [1:0] g_fault = 2'b00;  // supervisor: a fault restarts the firmware, which resets the gate
always @(posedge clk) begin
  g_live <= (g_live || candidate) && !revoke && !commit;
  g_fault <= {g_fault[0], fault};
end
always @* begin
  assume (!commit || candidate || g_live);
  assume (!g_fault[1] || rst);
end
`endif

// ---- covers: the module does act
always @(posedge clk) begin
  if (g_sound) begin
    c_telegram : cover (telegram_start);
    c_command : cover (telegram_start && telegram_control);
    c_repeat : cover (telegram_start && $past(repeat_telegram));
    c_kept : cover (telegram_start && telegram_control && g_placed && g_mark_own && !g_mark_newest);
    c_newer : cover (telegram_start && g_pending);
    // Prepared early: ordered for the candidate, it leaves with the commit.
    c_early : cover (telegram_start && g_newest && $past(g_commits && !g_order));
    c_reply : cover (reply_start && g_reply_waits);
  end
end
