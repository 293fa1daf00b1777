// SPDX-License-Identifier: Apache-2.0
// telegram_slot: nothing leaves without a licence, and no licence is lost (SAFE-1, SAFE-4, FC-8, FC-9, LOOP-1).
//
// Assumed of request_fate, and proved there: a request takes an order only with its own ticket, and has one fate. Assumed of
// mailbox_regs, and proved there: one order in a clock. Assumed of reply_slot: no reply leaves while a candidate's telegram waits.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

(* hierconn *) wire \licence_i.held ;
(* hierconn *) wire \licence_i.opposite ;
(* hierconn *) wire \fresh_i.held ;
(* hierconn *) wire \fresh_i.opposite ;

reg g_here = 1'b0;  // the memory holds what was ordered
reg g_prepared = 1'b0;  // ordered for a candidate that is still one
reg g_right = 1'b0;  // its request has committed, or the loop-back test ordered it
reg g_command = 1'b0;  // and writes coils
reg g_newest = 1'b0;  // no other request committed since
reg g_placed = 1'b0;  // its licence came from a place
reg g_waited = 1'b0;  // in the clock before another write waited
reg g_to_all = 1'b0;
reg g_stop = 1'b0;  // ordered under the licence of the stop
reg g_answered = 1'b0;
reg g_first = 1'b0;  // not sent yet, and no repeat ordered
reg [1:0] g_sends = 2'd0;

always @(posedge clk) begin
  g_waited <= others_wait;
  if (queue || use_place) g_stop <= use_place && place_stop;
  if (use_place) begin
    {g_here, g_prepared, g_right, g_command} <= {2'b10, place_valid, place_control};
    {g_newest, g_to_all, g_answered, g_sends} <= {current && !candidate, place_to_all, 1'b0, 2'd0};
    g_placed <= 1'b1;
  end else if (queue) begin
    g_here <= 1'b1;
    g_placed <= 1'b0;
    g_prepared <= takes_telegram && !loopback_open && !licenses && !candidate && !withdrawn && !commits;
    g_right <= !candidate && (licenses || loopback_open || (commits && current));
    g_command <= writes_coils && (licenses || (commits && current && !candidate));
    {g_newest, g_to_all, g_answered, g_sends} <= {1'b1, broadcast, 1'b0, 2'd0};
  end else begin
    if (candidate || withdrawn || commits) g_prepared <= 1'b0;
    if (commits && g_prepared && !candidate) {g_right, g_command} <= {g_here, writes_coils};
    else if (commits) g_newest <= 1'b0;
    if (reply_left && g_newest && !loopback_open) g_answered <= 1'b1;
    if (start && g_sends != 2'd3) g_sends <= g_sends + 2'd1;
    // What was ordered a second time before it left is no longer there.
    if (again) g_prepared <= 1'b0;
  end
  if (queue || use_place) g_first <= use_place ? place_valid : loopback_open || takes_telegram;
  else if (start || again) g_first <= 1'b0;
  if (touched || closing || rst) {g_here, g_prepared, g_right} <= 3'd0;
  if (queue && (candidate || withdrawn)) g_first <= 1'b0;
end

always @* begin
  assume ({1'b0, queue} + {1'b0, again} + {1'b0, use_place} <= 2'd1);
  assume (!licenses || (current && takes_telegram));
  assume (!takes_telegram || current);
  assume (!(commits && withdrawn));
  assume (!(reply_left && g_prepared) || loopback_open);
end

always @(posedge clk) begin
  if (g_past && !rst) begin
    // SAFE-1
    a_right : assert (!start || (g_here && g_right));
    a_command : assert (!(start && control) || g_command);
    // The memory is as it was ordered in this very clock, and no order comes in it.
    a_clear : assert (!start || !(queue || again || use_place || touched || closing));
    // FRAME-7: a telegram that was ordered and has a licence leaves, unless its request is answered first.
    a_leaves : assert (start || !(g_first && g_right && g_here && !g_answered && quiet) ||
        queue || again || use_place || touched || closing);
    // FC-8, FC-9
    a_quiet : assert (!start || quiet);
    a_twice : assert (!start || g_sends < 2'd2);
    a_repeat : assert (!start || g_sends == 2'd0 || (!g_to_all && (g_newest || g_placed) && !g_waited));
    a_answered : assert (!start || !g_answered);
    a_command_left : assert (command_left == (start && control && g_newest));
  end
end

reg g_started = 1'b0;
always @(posedge clk) begin
  if (start) g_started <= 1'b1;
  if (queue || again || use_place || rst) g_started <= 1'b0;
  if (g_past) a_started : assert (started == g_started);
  // SAFE-7: the stop, and no other telegram, leaves without the start bit.
  if (g_past) a_stop : assert (stop == g_stop);
end

// ---- what induction needs to know
wire g_licensed = \licence_i.held ;
wire begun = !\fresh_i.held ;
always @(posedge clk) begin
  if (g_past) begin
    i_halves : assert (\licence_i.opposite == !g_licensed && \fresh_i.opposite == begun);
    i_either : assert (!(g_prepared && g_right));
    i_right : assert (!g_licensed || (g_here && g_right));
    i_queued : assert (!queued || g_licensed || (g_here && g_prepared));
    i_newest : assert (!g_licensed || newest == g_newest);
    i_fresh : assert (!(queued && !g_licensed) || (!begun && newest && g_newest && g_sends == 2'd0 && !g_answered && repeatable == !g_to_all));
    i_begun : assert (!g_licensed || begun == (g_sends != 2'd0));
    i_repeatable : assert (!(g_licensed && repeatable) || ((g_newest || g_placed) && !g_to_all));
    i_placed : assert (from_place == (g_placed && !g_to_all));
    i_prepared : assert (!g_prepared || !g_first || (queued && !g_licensed && !begun));
    i_first : assert (!(g_first && g_right && g_here && !g_answered) || (queued && g_licensed && !begun));
    i_waited : assert (!(g_licensed && begun) || !g_waited || g_sends == 2'd1);
    i_command : assert (!(g_licensed && control) || g_command);
    i_twice : assert (!g_licensed || (g_sends < 2'd2 && !g_answered));
    i_waiting : assert (!(queued && g_licensed && begun) || repeatable);
  end
end

always @(posedge clk) begin
  if (g_past && !rst) begin
    c_at_once : cover (start && g_first);
    c_prepared : cover (start && $past(commits));
    c_repeat : cover (start && g_sends == 2'd1);
    c_older : cover (start && !g_newest);
    c_placed : cover (start && g_placed && g_sends == 2'd1 && !g_newest);
    c_command : cover (command_left);
  end
end
