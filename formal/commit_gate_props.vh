// SPDX-License-Identifier: Apache-2.0
// commit_gate at its pins: what leaves, and what must leave (SAFE-1, SAFE-7, SAFE-8, FRAME-6, FRAME-7, FC-9, MAP-9).
//
// The ghosts (g_*) follow the rules from the strobes alone: the newest request, the licences that commits gave and
// telegrams used, and the telegram that was ordered last. STOP: MASTER_LOSS_STOP = 1.
// SECOND: SECOND_TELEGRAM = 1. LIVE adds assumptions about the firmware, and proves that a changed image leaves in time.
// Assumed of rtu_rx, and proved there: no revoke together with candidate or commit, and no commit with a candidate. A start
// bit comes before each candidate. broadcast and writes_* change with a candidate only. Assumed of network_port: a line
// on which a character begins is not silent, a quiet line is. Assumed of mailbox_regs: one order in a clock. Assumed of
// the supervisor: the loop-back test ends in the clock after its order, and never begins again.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst && !order_telegram);  // the soft core is in reset, too

// ---- the newest request (FRAME-6)
reg g_pending = 1'b0;
reg g_committed = 1'b0;
reg g_heard = 1'b0;  // since its commit a character began (FRAME-7)
reg g_answered = 1'b0;
reg [3:0] g_ticket = 4'd0;
wire g_commits = commit && modbus_silent && g_pending;
wire g_revoked = g_pending && (revoke || modbus_start_seen || (commit && !modbus_silent));
wire g_current = order_ticket == g_ticket;

// ---- licences: what was committed and has not left (FRAME-7)
reg g_image = 1'b0;
reg g_free = 1'b0;  // by a committed write of coils, so the start bit may be 1
reg [1:0] g_ones = 2'd0;  // of a parameter for one
`ifdef SECOND
localparam [1:0] G_EACH = 2'd2;  // telegrams that one commit gives
`else
localparam [1:0] G_EACH = 2'd1;
`endif
wire g_one = g_ones != 2'd0;
reg g_all = 1'b0;
wire g_gives_image = g_commits && writes_coils;
wire g_gives_one = g_commits && writes_parameter && !broadcast;
wire g_gives_all = g_commits && writes_parameter && broadcast;
wire g_stops = order_telegram && order_kind == 2'd1 && order_stop && g_current && !candidate && !g_pending &&
    stop_due;

// ---- the telegram that was ordered last
localparam [1:0] G_NONE = 2'd0;
localparam [1:0] G_QUEUED = 2'd1;  // no licence yet: ordered just now, or for the candidate
localparam [1:0] G_LICENSED = 2'd2;
localparam [1:0] G_LEFT = 2'd3;
reg [1:0] g_telegram = G_NONE;
reg [1:0] g_kind = 2'd0;  // 0 of the newest request, 1 image, 2 parameter for one, 3 for all
reg g_no_reply = 1'b0;
reg [1:0] g_sends = 2'd0;
reg g_again = 1'b0;  // its repeat was ordered
wire g_own = g_telegram == G_QUEUED && g_pending;  // ordered for a candidate that has not been decided
reg g_early = 1'b0;  // made for the candidate
reg g_was_committed = 1'b0;  // which has committed since, or had before
reg g_old = 1'b0;  // since it was made, its kind changed by another commit
reg g_started = 1'b0;
reg g_told_free = 1'b0;
reg g_is_stop = 1'b0;  // the stop of a lost master (SAFE-7)
wire g_licence = g_kind == 2'd0 ? g_committed && !g_answered && !broadcast :
    g_kind == 2'd1 ? g_image : g_kind == 2'd2 ? g_one : g_all;
wire g_changes = g_kind == 2'd0 ? g_commits : g_kind == 2'd1 ? g_gives_image :
    g_kind == 2'd2 ? g_gives_one : g_gives_all;
wire g_takes = telegram_start && g_sends == 2'd0 && !loopback_open;

// ---- the reply
reg g_reply_due = 1'b0;
reg g_reply_waits = 1'b0;
reg g_open = 1'b0;
reg g_close = 1'b0;

always @(posedge clk) begin
  {g_open, g_close} <= {loopback_open, loopback_close};
  if (candidate) {g_pending, g_committed, g_heard, g_answered} <= 4'b1000;
  else if (g_commits) {g_pending, g_committed, g_heard, g_answered} <= 4'b0100;
  else begin
    if (g_revoked) g_pending <= 1'b0;
    if (g_committed && modbus_start_seen) g_heard <= 1'b1;
    if (g_committed && !g_heard && reply_start) g_answered <= 1'b1;
  end
  if (candidate) g_ticket <= g_ticket + 4'd1;

  if (g_gives_image) {g_image, g_free} <= 2'b11;
  else if (g_takes && g_kind == 2'd1) {g_image, g_free} <= 2'b00;
  else if (g_stops) g_image <= 1'b1;
  if (g_gives_one) g_ones <= G_EACH;
  else if (g_takes && g_kind == 2'd2 && g_one) g_ones <= g_ones - 2'd1;
  if (g_gives_all) g_all <= 1'b1;
  else if (g_takes && g_kind == 2'd3) g_all <= 1'b0;

  if (telegram_start && g_sends != 2'd3) g_sends <= g_sends + 2'd1;
  if (telegram_start) {g_telegram, g_started} <= {G_LEFT, 1'b1};
  if (telegram_start && g_sends == 2'd0) g_told_free <= g_free;
  if (g_telegram == G_QUEUED && !order_telegram) begin
    if (g_commits) g_was_committed <= 1'b1;
    if (candidate || g_revoked) g_telegram <= G_NONE;
    else if (!g_pending) g_telegram <= g_licence || loopback_open ? G_LICENSED : G_NONE;
  end
  if (g_changes && !g_own && (g_kind != 2'd0 || g_sends != 2'd0)) g_old <= 1'b1;
  if (order_repeat && g_telegram == G_LEFT && g_sends == 2'd1 && !g_no_reply && !g_old) g_again <= 1'b1;
  if (order_repeat) g_started <= 1'b0;
  if (order_telegram) begin
    g_telegram <= loopback_open || (g_current && !candidate && !g_revoked &&
        (order_early ? g_pending || g_committed : !g_pending)) ? G_QUEUED : G_NONE;
    {g_early, g_was_committed} <= {order_early, g_committed || g_commits};
    g_kind <= loopback_open ? 2'd0 : order_kind;
    g_is_stop <= g_stops;
    {g_no_reply, g_sends, g_again, g_old, g_started} <= {order_no_reply, 5'd0};
  end
  if (telegram_touched || loopback_close) g_telegram <= G_NONE;

  if (order_reply) begin
    g_reply_waits <= reply_after_drive;
    g_reply_due <= !loopback_open && !reply_empty && g_current && !broadcast &&
        (g_pending || (g_committed && !g_heard && !g_answered && !reply_start));
  end else if (reply_start) g_reply_due <= 1'b0;
  if (candidate || g_revoked || (g_committed && modbus_start_seen) || loopback_close ||
      (drive_bad && g_reply_waits))
    g_reply_due <= 1'b0;

  if (rst) begin
    {g_pending, g_committed, g_heard, g_answered, g_image, g_free, g_ones, g_all, g_reply_due} <= 10'd0;
    {g_telegram, g_started} <= {G_NONE, 1'b0};
  end
end

reg g_broadcast = 1'b0;
reg g_coils = 1'b0;
reg g_parameter = 1'b0;
always @(posedge clk)
  {g_broadcast, g_coils, g_parameter} <= {broadcast, writes_coils, writes_parameter};
always @* begin
  assume (!(writes_coils && writes_parameter));
  assume (!(candidate && commit));
  if (g_past) begin
    assume (!(revoke && (candidate || commit)));
    assume (!(modbus_start_seen && modbus_silent));
    assume (!modbus_quiet || modbus_silent);
    assume ({2'd0, order_telegram} + {2'd0, order_repeat} + {2'd0, order_reply} + {2'd0, watch} +
        {2'd0, loopback_close} <= 3'd1);
    assume (!candidate || !g_committed || g_heard);
    assume (g_open || !loopback_open);
    assume (!g_open || loopback_open || g_close);
    assume (!g_close || !loopback_open);
    if (!candidate)
      assume ({broadcast, writes_coils, writes_parameter} == {g_broadcast, g_coils, g_parameter});
  end
end

wire g_first = telegram_start && g_sends == 2'd0;
wire g_sound = g_past && !rst && !loopback_open;
always @(posedge clk) begin
  if (g_sound) begin
    // SAFE-1, FRAME-7: the first telegram of a kind uses a licence that a commit gave, and each commit gives one.
    a_licence : assert (!g_first || g_kind == 2'd0 || g_licence);
    // FRAME-6: never for a candidate, nor after its memory was written.
    a_committed : assert (!telegram_start || (g_telegram == G_LICENSED || g_again));
    a_untouched : assert (!telegram_start || !telegram_touched);
    a_candidate : assert (!telegram_start || (!g_own && (!g_early || g_was_committed)));
    // SAFE-8: the image leaves as it is: none that was made before the newest committed write of coils.
    a_as_it_is : assert (!telegram_start || (!g_old && !(g_changes && (g_kind != 2'd0 || g_sends != 2'd0))));
    // SAFE-1: only the image has bit 10, and SAFE-7: without a committed write of coils, or as the stop, it has no start bit.
    a_command : assert (!(telegram_start && telegram_control) || g_kind == 2'd1);
    a_no_start : assert (!(telegram_start && telegram_control) || telegram_stop ||
        (!g_is_stop && (g_sends == 2'd0 ? g_free : g_told_free)));
    // FC-9: one repeat, none of a broadcast, none without its order.
    a_repeat : assert (!telegram_start || g_sends == 2'd0 || (g_sends == 2'd1 && g_again && !g_no_reply));
    // FC-8
    a_drive_quiet : assert (!telegram_start || drive_quiet);
    // FRAME-6, FRAME-7, MAP-9: a reply answers the newest request, committed, no broadcast, nothing heard since.
    a_reply : assert (!reply_start || (g_reply_due && g_committed && !g_heard && !g_answered && !broadcast));
    // FRAME-8, PERF-3
    a_reply_quiet : assert (!reply_start || modbus_quiet);
    a_after_drive : assert (!reply_start || !g_reply_waits || drive_good);
    // The other way round: what may leave does not stay.
    a_reply_leaves : assert (reply_start || !(g_reply_due && g_committed && !g_heard && modbus_quiet &&
        (!g_reply_waits || drive_good)));
    a_telegram_leaves : assert (telegram_start || !(g_telegram == G_LICENSED && g_sends == 2'd0 && !g_old && !g_changes &&
        drive_quiet && !order_telegram && !order_repeat && !telegram_touched && !loopback_close));
  end
  if (g_past) begin
    // FRAME-6, LINE-5: a candidate that is not revoked commits; the firmware sees both.
    a_status : assert ({is_candidate, is_committed} == {g_pending, g_committed});
    a_started : assert (telegram_started == g_started);
    // FRAME-5: every candidate has the next number.
    a_ticket : assert (ticket == g_ticket);
    // FRAME-7: nothing but its telegram takes a licence away.
    a_stays : assert ({image_valid, one_valid, all_valid} == {g_image, g_one, g_all});
  end
end

// ---- what induction needs to know: registers inside the instances, by their hierarchical names
(* hierconn *) wire [2:0] \request_i.state ;
(* hierconn *) wire \request_i.committed_i.held ;
(* hierconn *) wire \request_i.committed_i.opposite ;
(* hierconn *) wire \reply_i.wait_drive ;
(* hierconn *) wire \licences_i.image_i.held ;
(* hierconn *) wire \licences_i.image_i.opposite ;
(* hierconn *) wire \licences_i.one_i.held ;
(* hierconn *) wire \licences_i.one_i.opposite ;
(* hierconn *) wire \licences_i.all_i.held ;
(* hierconn *) wire \licences_i.all_i.opposite ;
(* hierconn *) wire [2:0] \telegram_i.state ;
(* hierconn *) wire \request_i.ticket_is_odd ;
(* hierconn *) wire \telegram_i.repeatable ;
(* hierconn *) wire \telegram_i.repeated ;
(* hierconn *) wire \telegram_i.is_stop ;
(* hierconn *) wire \telegram_i.licence_i.held ;
(* hierconn *) wire \telegram_i.licence_i.opposite ;
initial assume (\reply_i.wait_drive == 1'b0);
initial assume (\telegram_i.repeatable == 1'b0 && \telegram_i.repeated == 1'b0 && \telegram_i.is_stop == 1'b0);
wire image_valid = \licences_i.image_i.held ;
wire one_valid = \licences_i.one_i.held ;
wire all_valid = \licences_i.all_i.held ;
`ifdef SECOND
(* hierconn *) wire \licences_i.g_second.second_i.held ;
(* hierconn *) wire \licences_i.g_second.second_i.opposite ;
always @(posedge clk)
  if (g_past)
    i_second : assert (\licences_i.g_second.second_i.held == (g_ones == 2'd2) &&
        \licences_i.g_second.second_i.opposite == (g_ones != 2'd2));
`endif
wire g_held = \telegram_i.licence_i.held ;
// Its place as long as its telegram may still leave or be repeated: 0 none, 1 queued, 2 licensed, 3 left.
wire g_over = \telegram_i.state == 3'b110 && !g_held;
wire [1:0] g_slot = \telegram_i.state == 3'b011 ? 2'd1 : \telegram_i.state == 3'b101 ? 2'd2 :
    \telegram_i.state == 3'b110 && g_held ? 2'd3 : 2'd0;
// ---- the stop when the master is lost (SAFE-7)
`ifdef STOP
(* hierconn *) wire \licences_i.g_stop.free_i.held ;
(* hierconn *) wire \licences_i.g_stop.free_i.opposite ;
(* hierconn *) wire \g_loss.loss_i.beat_before ;
(* hierconn *) wire [19:0] \g_loss.loss_i.limit ;
(* hierconn *) wire [19:0] \g_loss.loss_i.left ;
(* hierconn *) wire \g_loss.loss_i.armed_i.held ;
(* hierconn *) wire \g_loss.loss_i.armed_i.opposite ;
(* hierconn *) wire \g_loss.loss_i.over_i.held ;
(* hierconn *) wire \g_loss.loss_i.over_i.opposite ;
initial assume (!\g_loss.loss_i.beat_before );
// The ordered stop gets its licence: a candidate in the clock after the order drops it, and it stays due.
wire g_grants_stop = g_telegram == G_QUEUED && !order_telegram && !telegram_touched && !loopback_close && !candidate &&
    !g_pending && g_kind == 2'd1 && g_image && (!g_free || g_is_stop) && stop_due;
wire g_watch = watch && order_ticket == g_ticket && g_committed && !candidate;
reg g_beat = 1'b0;
reg g_start = 1'b0;  // a write of coils with the start bit 1 was committed, and no stop was licensed since
reg g_known = 1'b0;
reg [19:0] g_limit = 20'd0;
reg [20:0] g_since = 21'd0;  // ticks since the last commit and the last order to watch
always @(posedge clk) begin
  g_beat <= beat;
  if (g_watch) {g_known, g_limit} <= {1'b1, period};
  if (g_watch && writes_coils) g_start <= running;
  else if (g_grants_stop) g_start <= 1'b0;
  if (g_commits || g_watch) g_since <= 21'd0;
  else if (beat != g_beat && !g_since[20]) g_since <= g_since + 21'd1;
  if (rst) {g_known, g_start} <= 2'b00;
end
always @(posedge clk) begin
  if (g_past) begin
    // None is licensed without a committed start, or before the time without a commit has passed.
    a_stop_due : assert (stop_due == (g_start && g_limit != 20'd0 && g_since > {1'b0, g_limit} && !g_commits));
    // As a_stays: nothing but its telegram takes the right to the start bit away.
    a_stays_free : assert (\licences_i.g_stop.free_i.held == g_free);
    i_free_half : assert (\licences_i.g_stop.free_i.opposite == !g_free);
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
always @(posedge clk) if (g_past) begin
  a_no_stop : assert (!stop_due && !(telegram_start && telegram_control && telegram_stop));
  i_no_stop : assert (!g_is_stop && !\telegram_i.is_stop && g_image == g_free && (g_slot < 2'd2 || g_kind != 2'd1 || !telegram_stop));
end
`endif

always @(posedge clk) begin
  if (g_past) begin
    i_request : assert (\request_i.state == (g_pending ? 3'd1 : !g_committed ? 3'd0 : g_answered ? 3'd4 :
        g_heard ? 3'd3 : 3'd2));
    i_halves : assert (\request_i.committed_i.held == g_committed &&
        \request_i.committed_i.opposite == !g_committed && \licences_i.image_i.opposite == !g_image &&
        \licences_i.one_i.opposite == !g_one &&
        \licences_i.all_i.opposite == !g_all && \telegram_i.licence_i.opposite == !g_held);
    i_codes : assert (g_slot != 2'd0 || g_over || \telegram_i.state == 3'd0);
    i_started : assert (g_started == (g_slot == 2'd3 || g_over));
    i_ticket : assert (\request_i.ticket_is_odd == ^ticket);
    i_either : assert (!(g_pending && (g_committed || g_heard || g_answered)) && (!g_free || g_image));
    i_waits : assert (\reply_i.wait_drive == g_reply_waits);
    i_reply : assert (reply_queued == g_reply_due || g_open || (reply_queued && g_answered));
    i_reply_due : assert (!g_reply_due || (!broadcast && (g_pending || g_committed) && !g_heard && !g_answered) || candidate);
    i_kind : assert (g_slot == 2'd0 || (kind == g_kind && \telegram_i.repeatable == !g_no_reply));
    i_ones : assert (g_ones <= G_EACH);
    i_is_stop : assert (\telegram_i.is_stop == g_is_stop);
    i_queued : assert ((g_slot == 2'd1) == (g_telegram == G_QUEUED));
    i_own : assert (g_telegram != G_QUEUED || (!g_old && g_sends == 2'd0 && !g_again));
    i_licensed : assert (g_slot != 2'd2 || (g_held && (g_telegram == G_LICENSED || g_again) && !g_old));
    i_leaves : assert (g_telegram != G_LICENSED || g_old || g_slot == 2'd2 || g_open);
    i_right : assert (g_slot != 2'd2 || g_sends != 2'd0 || g_kind == 2'd0 || g_licence || g_open);
    i_stop : assert (g_slot != 2'd2 || g_kind != 2'd1 || g_open || telegram_stop || (!g_is_stop && (g_sends == 2'd0 ? g_free : g_told_free)));
    i_stops : assert (g_slot != 2'd3 || g_kind != 2'd1 || g_open || telegram_stop || (!g_is_stop && g_told_free));
    i_left : assert (g_slot != 2'd3 || (g_telegram == G_LEFT && g_sends != 2'd0));
    i_held : assert (!g_held || g_slot == 2'd2 || (g_slot == 2'd3 && g_sends == 2'd1 && !g_no_reply && !g_old && !g_again));
    i_sends : assert (g_slot != 2'd2 || \telegram_i.repeated == (g_sends != 2'd0));
    i_fresh : assert (g_slot != 2'd1 || !\telegram_i.repeated );
    i_early : assert (g_slot == 2'd0 || !g_early || g_was_committed || g_open || (g_slot == 2'd1 && g_pending));
    i_twice : assert (g_slot != 2'd2 || g_sends < 2'd2);
    i_again : assert (g_slot != 2'd2 || (g_sends != 2'd0) == g_again);
    i_repeats : assert (g_slot != 2'd2 || !g_again || (!g_no_reply && g_sends == 2'd1));
    i_open : assert (!loopback_open || (g_open && (g_slot == 2'd0 || g_kind == 2'd0)));
  end
end

// ---- a changed image leaves in time, whatever requests come (FRAME-7, SAFE-8)
`ifdef LIVE
// Assumed of the firmware (orders.c): as soon as no exchange holds it up and no candidate decides, it orders a changed image
// within g_round clocks, nothing else, and leaves it alone. Of the network line: a candidate decides within g_decision
// clocks, and the next frame takes longer than a round.
(* anyconst *) wire [9:0] g_round;
(* anyconst *) wire [9:0] g_decision;
(* anyseq *) wire g_holds;  // an exchange that is not over (FC-9)
localparam [11:0] G_MORE = 12'd10;
wire g_on_its_way = (g_telegram == G_QUEUED || g_telegram == G_LICENSED) && g_kind == 2'd1 && g_sends == 2'd0 && !g_old;
wire g_idle = g_image && !g_on_its_way && !g_holds && !g_pending;
reg [11:0] g_idles = 12'd0;  // clocks in which the firmware could have ordered the image
reg [11:0] g_decides = 12'd0;  // clocks of this candidate
reg [11:0] g_calm = 12'd0;  // clocks since the last candidate was decided
reg [11:0] g_waits = 12'd0;  // clocks that the image has waited on a free line
always @(posedge clk) begin
  g_idles <= g_idle && !order_telegram && !candidate ? g_idles + 12'd1 : 12'd0;
  g_decides <= g_pending ? g_decides + 12'd1 : 12'd0;
  if (g_pending || candidate) g_calm <= 12'd0;
  else if (!g_calm[11]) g_calm <= g_calm + 12'd1;
  g_waits <= g_image && drive_quiet && !g_holds && !telegram_start && !rst ? g_waits + 12'd1 : 12'd0;
end
always @* if (g_past) begin
  assume (!rst && !loopback_open && !loopback_close);
  assume (g_decides <= {2'd0, g_decision});
  assume (g_idles <= {2'd0, g_round});
  assume (!candidate || (!g_pending && g_calm > {2'd0, g_round} + 12'd3));
  if (g_image) begin
    assume (!order_telegram || (g_idle && order_kind == 2'd1 && g_current && !order_early && !candidate && !telegram_touched));
    assume (!g_on_its_way || !(g_holds || order_repeat || telegram_touched));
  end
end
wire [11:0] g_bound = {1'b0, g_round, 1'b0} + {2'd0, g_decision} + G_MORE;
always @(posedge clk) if (g_past) begin
  a_in_time : assert (g_waits <= g_bound);
  i_live_idle : assert (g_pending || g_on_its_way || g_waits <= g_idles + 12'd1 ||
      (g_waits <= {2'd0, g_round} + {2'd0, g_decision} + 12'd5 + g_idles && g_idles + 12'd1 >= g_calm));
  i_live_pending : assert (!g_pending || g_on_its_way || g_waits <= {2'd0, g_round} + 12'd4 + g_decides);
  i_live_queued : assert (g_telegram != G_QUEUED || !g_on_its_way || g_waits + 12'd2 <= g_bound);
  i_live_calm : assert (g_telegram != G_QUEUED || !g_on_its_way || g_waits <= {2'd0, g_round} + 12'd2 ||
      g_calm <= {2'd0, g_round} + 12'd3);
  i_live_licensed : assert (g_telegram != G_LICENSED || !g_on_its_way || g_waits + 12'd1 <= g_bound);
  i_live_own : assert (g_telegram != G_QUEUED || !g_on_its_way || !g_pending || !g_image);
  i_live_leaves : assert (g_telegram != G_LICENSED || !g_on_its_way || !g_pending || g_waits == 12'd0);
  c_in_time : cover (telegram_start && g_waits > {2'd0, g_round} + {2'd0, g_decision});
end
`endif

// ---- covers: the module does act
always @(posedge clk) begin
  if (g_sound) begin
    c_telegram : cover (telegram_start);
    c_command : cover (telegram_start && telegram_control && !telegram_stop);
    c_repeat : cover (telegram_start && g_sends == 2'd1);
    c_waited : cover (g_first && g_kind == 2'd1 && g_pending);
    c_parameter : cover (g_first && g_kind == 2'd3);
    // Prepared early: ordered for the candidate, it leaves after the commit.
    c_early : cover (g_first && g_kind == 2'd1 && $past(g_commits, 2));
    c_reply : cover (reply_start && g_reply_waits);
  end
end
