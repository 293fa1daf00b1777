// SPDX-License-Identifier: Apache-2.0
// Arbiter, registers and gate, wired: no telegram starts unless a committed request caused just that telegram,
// every byte of it and its length, and none of it changes while it is on the wire; no reply leaves but to the
// newest request (SAFE-1, SAFE-4, FRAME-6, FRAME-7). Seen from the pins of the memory, so by whatever way it was
// written.
//
// Assumed of rtu_rx, and proved there: never revoke with candidate or commit; a newer candidate has begun with a
// start bit; the status of a request stays until the next candidate. Assumed of the ports: neither line reads and
// writes at once, the drive port sends after a start only, a line on which a character begins is not silent, and a
// quiet line is.
// Nothing is assumed of the firmware.

// Written by `make regs`, the macros of regs/ that this file uses:
`define MBX_EVENTS_REVOKED_BITS 5
`define CARD_REQUEST_CANDIDATE_BITS 0
`define CARD_REQUEST_COMMIT_BITS 1
`define CARD_REQUEST_BROADCAST_BITS 2
`define CARD_REQUEST_WRITES_COILS_BITS 3
`define CARD_REQUEST_BANK_BITS 5
`define CARD_REQUEST_LENGTH_BITS 13:6
`define CARD_REQUEST_SILENT_BITS 14
`define CARD_TELEGRAM_LENGTH_BITS 4:0
`define CARD_TELEGRAM_NO_REPLY_BITS 5
`define CARD_TELEGRAM_CONTROL_BITS 6
`define CARD_EXCHANGE_QUIET_BITS 1
`define CARD_EXCHANGE_CANDIDATE_BITS 2
`define CARD_EXCHANGE_GOOD_BITS 3
`define CARD_EXCHANGE_BAD_BITS 4
// End of what `make regs` writes.

localparam G_WORD_BITS = $clog2(MEMORY_BYTES / 4);
localparam [31:0] G_LAST = MEMORY_BYTES / 4 - 1;

// The fields of the vectors.
wire candidate = request[`CARD_REQUEST_CANDIDATE_BITS];
wire commit = request[`CARD_REQUEST_COMMIT_BITS];
wire frame_broadcast = request[`CARD_REQUEST_BROADCAST_BITS];
wire frame_writes_coils = request[`CARD_REQUEST_WRITES_COILS_BITS];
wire frame_bank = request[`CARD_REQUEST_BANK_BITS];
wire modbus_silent = request[`CARD_REQUEST_SILENT_BITS];
wire [7:0] frame_length = request[`CARD_REQUEST_LENGTH_BITS];
wire revoke = network_events[`MBX_EVENTS_REVOKED_BITS];
wire drive_quiet = exchange[`CARD_EXCHANGE_QUIET_BITS];
wire drive_candidate = exchange[`CARD_EXCHANGE_CANDIDATE_BITS];
wire drive_good = exchange[`CARD_EXCHANGE_GOOD_BITS];
wire drive_bad = exchange[`CARD_EXCHANGE_BAD_BITS];
wire [4:0] telegram_length = telegram[`CARD_TELEGRAM_LENGTH_BITS];
wire telegram_no_reply = telegram[`CARD_TELEGRAM_NO_REPLY_BITS];
wire telegram_control = telegram[`CARD_TELEGRAM_CONTROL_BITS];

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (core_rst);

// Registers inside the instances, by their hierarchical names.
(* hierconn *) wire \gate_i.telegram_i.licence_i.held ;
(* hierconn *) wire \gate_i.telegram_i.licence_i.opposite ;
(* hierconn *) wire \gate_i.request_i.committed_i.held ;
(* hierconn *) wire \gate_i.request_i.committed_i.opposite ;
(* hierconn *) wire \gate_i.telegram_i.fresh_i.held ;
(* hierconn *) wire \gate_i.telegram_i.fresh_i.opposite ;
(* hierconn *) wire \gate_i.loopback_i.was_open ;
(* hierconn *) wire \gate_i.request_i.answerable ;
(* hierconn *) wire \gate_i.request_i.spent ;
(* hierconn *) wire \gate_i.reply_i.wait_drive ;
(* hierconn *) wire \gate_i.kept ;
(* hierconn *) wire \gate_i.request_i.to_keep ;
(* hierconn *) wire \gate_i.broadcast_control ;
(* hierconn *) wire \gate_i.unicast_control ;
(* hierconn *) wire \gate_i.broadcast_i.valid_i.held ;
(* hierconn *) wire \gate_i.broadcast_i.valid_i.opposite ;
`ifdef SMALL
`else
(* hierconn *) wire \gate_i.g_unicast.unicast_i.valid_i.held ;
(* hierconn *) wire \gate_i.g_unicast.unicast_i.valid_i.opposite ;
`endif
(* hierconn *) wire [7:0] \regs_i.flags ;
// Such a name loses its power-up value; the others are reset.
initial assume (\regs_i.flags == 8'd0);
wire g_gate_waits = \gate_i.reply_i.wait_drive ;
wire [7:0] g_flags = \regs_i.flags ;
wire g_gate_licensed = \gate_i.telegram_i.licence_i.held ;
wire g_gate_unlicensed = \gate_i.telegram_i.licence_i.opposite ;
wire g_gate_committed = \gate_i.request_i.committed_i.held ;
wire g_gate_uncommitted = \gate_i.request_i.committed_i.opposite ;
wire g_gate_begun = !\gate_i.telegram_i.fresh_i.held ;
wire g_gate_open = \gate_i.loopback_i.was_open ;
wire g_gate_answerable = \gate_i.request_i.answerable ;
wire g_gate_spent = \gate_i.request_i.spent ;
wire g_kept = \gate_i.kept ;  // the licence of the newest request moves to its place

reg [3:0] g_ticket = 4'd0;  // every candidate has the next number (FRAME-5)

// ---- what the firmware does, from the bus and the memory's pins
wire g_order = regs_valid && core_wstrb != 4'd0;  // a write to a register
wire g_order_keep = g_order && core_addr[4:2] == 3'd3 && core_wdata[7:6] == 2'd3;
wire g_order_telegram = g_order && core_addr[4:2] == 3'd3 && !drive_sending && !g_order_keep;
wire g_queued = g_order_telegram && !core_wdata[6];
wire g_waiting = g_queued && core_wdata[7];  // with the licence of a write that waits
wire g_order_reply = g_order && core_addr[4:2] == 3'd2;
wire g_current = core_wdata[11:8] == g_ticket;
// The telegram: 32 words of the last 64, their lowest bytes. A write to it ends the licence from the clock on in which
// the soft core asks for it, although a line may be served first.
wire g_written = ram_enable && ram_wstrb[0] && ram_word[G_WORD_BITS-1:5] == {G_LAST[G_WORD_BITS-1:6], 1'b1};
wire g_touched = g_written || telegram_touched;

// ---- the request
reg g_candidate = 1'b0;
reg g_committed = 1'b0;
reg g_heard = 1'b0;
reg g_spent = 1'b0;
reg g_reply_ours = 1'b0;  // the reply was queued for the newest request
reg g_here = 1'b0;  // the memory holds the telegram as it was queued
reg g_ours = 1'b0;  // it was queued for the request that was the newest then
reg g_licensed = 1'b0;  // that request has committed
reg g_control = 1'b0;  // that request writes coils
reg g_open = 1'b0;  // the loop-back test sends without a request (LOOP-1)
// FRAME-6: at t3.5 the candidate commits, unless a character has begun.
wire g_commit = commit && modbus_silent && (candidate || g_candidate);
wire g_revoke = revoke || modbus_start_seen || (commit && !modbus_silent);
// ---- the requests whose licences wait: 1 a broadcast, 0 a unicast write (FRAME-7)
reg [1:0] g_there = 2'b00;
reg [1:0] g_place_coils = 2'b00;
reg g_wish = 1'b0;  // ordered for the candidate
wire [1:0] g_filled = {g_kept && frame_broadcast, g_kept && !frame_broadcast};
wire [1:0] g_taken = {g_waiting && core_wdata[5], g_waiting && !core_wdata[5]};
wire g_keep = g_order_keep && g_current;
wire g_may_keep = !candidate && (g_commit ? g_wish || g_keep : g_keep && g_committed && !g_spent);
reg [5:0] g_ordered = 6'd0;  // length and kind, as that order gave them
reg [4:0] g_answer = 5'd0;
reg g_was_sending = 1'b0;
reg g_read = 1'b0;  // a line read the memory in the clock before
reg g_broadcast = 1'b0;
reg g_started = 1'b0;
reg g_coils = 1'b0;
reg g_start = 1'b0;
reg g_was_control = 1'b0;
reg g_waits = 1'b0;  // the reply was queued to wait for the drive's
reg g_asked_regs = 1'b0;
reg g_core_rst = 1'b1;
reg [31:0] g_status = 32'd0;  // what the firmware asked for, as it was then
reg [7:0] g_events = 8'd0;  // that happened and were not cleared

always @(posedge clk) begin
  g_open <= loopback_open;
  g_was_sending <= drive_sending;
  g_read <= modbus_read_ready || drive_read_ready;
  g_broadcast <= frame_broadcast;
  g_coils <= frame_writes_coils;
  g_start <= telegram_start;
  g_was_control <= telegram_control;
  if (g_queued) g_ordered <= core_wdata[5:0];
  if (g_order_reply) {g_waits, g_answer} <= core_wdata[5:0];
  g_asked_regs <= regs_valid && core_wstrb == 4'd0;
  g_core_rst <= core_rst;
  g_status <= {
    ticks,
    frame_length,
    1'b0, loopback_heard, loopback_open, drive_good, drive_candidate, g_started, drive_sending, telegram_queued,
    core_addr[2] ? g_events : {frame_bank, frame_broadcast, g_committed, g_candidate, g_ticket}
  };
  if (candidate) g_ticket <= g_ticket + 4'd1;
  g_events <= (g_order && core_addr[4:2] == 3'd1 ? g_events & ~core_wdata[7:0] : g_events) |
      {drive_bad, network_events};
  if (g_order_telegram) g_started <= 1'b0;
  else if (telegram_start) g_started <= 1'b1;
  if (core_rst) g_started <= 1'b0;

  if (candidate) begin
    g_candidate <= !commit;
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
  if (candidate || g_commit || g_revoke) g_wish <= 1'b0;
  else if (g_keep && g_candidate) g_wish <= 1'b1;
  g_there <= (g_there & ~g_taken) | g_filled;
  g_place_coils <= (g_place_coils & ~g_filled) | (g_filled & {2{frame_writes_coils}});
  if (g_commit) g_spent <= g_kept && frame_writes_coils;
  else if ((g_kept && frame_writes_coils) || reply_start || (g_order_reply && g_current && frame_broadcast)) g_spent <= 1'b1;

  if (candidate) g_reply_ours <= 1'b0;
  else if (g_order_reply) g_reply_ours <= g_current;

  if (g_waiting) begin
    {g_here, g_ours} <= 2'b10;
    g_licensed <= (g_there & g_taken) != 2'b00;
    g_control <= (g_there & g_taken & g_place_coils) != 2'b00;
  end else if (g_queued) begin
    g_here <= 1'b1;
    g_ours <= g_current && !candidate && !(g_revoke && g_candidate) && (g_candidate || (g_committed && !g_spent));
    g_licensed <= g_current && !candidate && !(g_revoke && g_candidate) && ((g_committed && !g_spent) || g_commit);
    g_control <= frame_writes_coils && g_current && !candidate && ((g_committed && !g_spent) || g_commit);
  end else begin
    if (candidate || (g_revoke && g_candidate)) g_ours <= 1'b0;
    if (g_commit && !candidate && g_here && g_ours && !g_licensed) begin
      g_licensed <= 1'b1;
      g_control <= frame_writes_coils;
    end
  end
  if (g_touched || (g_open && !loopback_open)) begin
    g_here <= 1'b0;
    g_ours <= 1'b0;
    g_licensed <= 1'b0;
  end
  if (core_rst) begin
    g_candidate <= 1'b0;
    g_committed <= 1'b0;
    g_heard <= 1'b0;
    g_reply_ours <= 1'b0;
    g_spent <= 1'b0;
    g_here <= 1'b0;
    g_ours <= 1'b0;
    g_licensed <= 1'b0;
    {g_there, g_wish} <= 3'd0;
  end
end

always @* begin
  assume (!(revoke && (candidate || commit)));
  assume (!(modbus_start_seen && modbus_silent));
  assume (!modbus_quiet || modbus_silent);
  assume (!candidate || !g_committed || g_heard);
  assume (!(modbus_read_valid && modbus_write_valid));
  assume (!(drive_read_valid && drive_write_valid));
  if (g_past && !candidate) assume (frame_broadcast == g_broadcast && frame_writes_coils == g_coils);
  assume (!drive_sending || g_was_sending || g_start);
end

wire g_sound = g_past && !core_rst && !loopback_open;
always @(posedge clk) begin
  if (g_sound) begin
    // SAFE-1, SAFE-4: what starts is what was ordered for a request that was committed and had no reply yet: not
    // a byte of it was written since or is now, and its length and kind are those of that order.
    a_licensed : assert (!telegram_start || (g_licensed && g_here && !g_touched));
    // SAFE-1: and only a write of coils may command the drive.
    a_control : assert (!(telegram_start && telegram_control) || g_control);
    // FRAME-7: a licence waits only for a committed request, as ordered.
    a_kept : assert (!g_kept || g_may_keep);
    // FRAME-6, FRAME-7, MAP-9
    a_reply : assert (!reply_start || (g_committed && !g_heard && !frame_broadcast && g_reply_ours));
  end
  if (g_past) begin
    a_ordered : assert ({telegram_no_reply, telegram_length} == g_ordered);
    // Nothing of it changes on the wire, whatever the firmware writes, and to whatever address.
    a_frozen : assert (!drive_sending || !g_touched);
    a_touched_for_a_write : assert (!telegram_touched || (core_valid && !core_ready && core_wstrb[0]));
    a_length_frozen : assert (!g_was_sending || {telegram_no_reply, telegram_length} == $past({telegram_no_reply, telegram_length}));
    a_control_frozen : assert (!drive_sending || telegram_control == g_was_control);
    // FC-8, SAFE-2: both ports rely on it.
    a_drive_quiet : assert (!telegram_start || (drive_quiet && !drive_sending));
    a_modbus_quiet : assert (!reply_start || modbus_quiet);
    // FRAME-4: a reply has a length, the one that it was queued with.
    a_reply_length : assert (!reply_start || (reply_length != 5'd0 && reply_length == g_answer));
    a_after_drive : assert (!reply_start || !g_waits || drive_good);
    // FRAME-5: each line has its own lane and its own half of the frames, and is served at once, the drive line
    // after the network line.
    a_request : assert (!modbus_write_valid || (modbus_write_ready && ram_wstrb == 4'b0010 &&
        ram_word == {G_LAST[G_WORD_BITS-1:6], modbus_write_addr} && ram_wdata[15:8] == modbus_write_data));
    a_drive : assert (!drive_write_valid || modbus_write_valid || modbus_read_valid || (drive_write_ready &&
        ram_wstrb == 4'b0100 && ram_word == {G_LAST[G_WORD_BITS-1:6], 1'b0, drive_write_addr} &&
        ram_wdata[23:16] == drive_write_data));
    a_fetch : assert (!modbus_read_valid || (modbus_read_ready && ram_enable && ram_wstrb == 4'b0000 &&
        ram_word == {G_LAST[G_WORD_BITS-1:6], 1'b0, modbus_read_addr}));
    a_drive_fetch : assert (!drive_read_valid || modbus_write_valid || modbus_read_valid || (drive_read_ready &&
        ram_enable && ram_wstrb == 4'b0000 && ram_word == {G_LAST[G_WORD_BITS-1:6], 1'b1, drive_read_addr}));
    a_not_asked : assert (modbus_write_ready <= modbus_write_valid && modbus_read_ready <= modbus_read_valid &&
        drive_write_ready <= drive_write_valid && drive_read_ready <= drive_read_valid);
    // What a line gets is the memory's answer, with nothing of the registers in it.
    a_read : assert (!g_read || read_data == ram_rdata[7:0]);
    // What the firmware gets is that or the registers, never a mixture, and those as they were in one clock.
    a_core_read : assert (!core_ready || g_asked_regs || core_rdata == ram_rdata);
    a_status : assert (!(core_ready && g_asked_regs) || core_rdata == (ram_rdata | g_status));
    a_served : assert (!core_valid || core_rst || core_ready || modbus_write_valid || modbus_read_valid ||
        drive_write_valid || drive_read_valid || regs_valid || (ram_enable && ram_wdata == core_wdata));
    // SAFE-5: in reset the bus of the soft core reaches nothing.
    a_reset : assert (!core_rst || !(core_ready && g_core_rst) && !regs_valid &&
        (ram_wstrb == 4'b0000 || modbus_write_ready || drive_write_ready));
    a_which : assert (!regs_valid || (core_addr[31] && !core_addr[10]));
    // A restart of the firmware drops its reply and telegram and turns the LEDs off (WDG-1).
    a_restart : assert (!g_core_rst || !(reply_start || telegram_start || telegram_queued || reply_queued || core_ready));
    a_dark : assert (!g_core_rst || leds == 4'd0);
  end
end

// ---- what induction needs to know
always @(posedge clk) begin
  if (g_past) begin
    i_answer : assert (reply_length == g_answer);
    i_reply_length : assert (!reply_queued || reply_length != 5'd0);
    i_not_queued : assert (!(drive_sending && telegram_queued));
    i_regs : assert (g_asked_regs || regs_rdata == 32'd0);
    i_waits : assert (!reply_queued || g_gate_waits == g_waits);
    i_flags : assert (g_flags == g_events);
    i_started : assert (telegram_started == g_started);
    i_turn : assert (!(g_read && g_asked_regs));
  end
  if (g_past) begin
    i_ticket : assert (ticket == g_ticket);
    i_open : assert (g_gate_open == g_open);
    i_opposite : assert (g_gate_unlicensed == !g_gate_licensed);
    i_fresh_halves : assert (\gate_i.telegram_i.fresh_i.opposite == g_gate_begun);
    i_fresh : assert (!telegram_queued || g_gate_licensed || (!g_gate_begun && !g_licensed));
    i_candidate : assert (is_candidate == g_candidate);
    i_committed : assert (g_gate_committed == g_committed && g_gate_uncommitted == !g_committed);
    i_answerable : assert (g_gate_answerable == (g_committed && !g_heard));
    i_licensed : assert (!g_gate_licensed || g_open || (g_licensed && g_here));
    i_queued : assert (!telegram_queued || g_gate_licensed || (g_here && g_ours && g_candidate));
    i_reply_ours : assert (!reply_queued || g_reply_ours || g_open);
    i_reply : assert (!reply_queued || !frame_broadcast || candidate || g_open);
    i_wish : assert (!\gate_i.request_i.to_keep || (g_wish && g_candidate));
    i_place : assert (\gate_i.broadcast_i.valid_i.held == g_there[1] &&
        \gate_i.broadcast_i.valid_i.opposite == !g_there[1]);
    i_place_coils : assert ((!g_there[1] || \gate_i.broadcast_control == g_place_coils[1]) &&
        (!g_there[0] || \gate_i.unicast_control == g_place_coils[0]));
`ifdef SMALL
    i_place_none : assert (!g_there[0] && !(\gate_i.request_i.to_keep && !frame_broadcast && !candidate));
`else
    i_place_unicast : assert (\gate_i.g_unicast.unicast_i.valid_i.held == g_there[0] &&
        \gate_i.g_unicast.unicast_i.valid_i.opposite == !g_there[0]);
`endif
    i_not_yet : assert (!(g_candidate && g_ours && g_licensed));
    i_control : assert (!(g_gate_licensed && telegram_control) || g_open || g_control);
    i_spent : assert (g_gate_spent || !g_spent);
    i_either : assert (!(g_candidate && g_committed));
  end
end

// ---- covers: the module does act
always @(posedge clk) begin
  if (g_sound) begin
    c_telegram : cover (telegram_start && telegram_length == 5'd14);
    c_repeat : cover (telegram_start && $past(g_order_telegram && core_wdata[7:6] == 2'd1) && $past(g_was_sending, 2));
    c_waiting : cover (telegram_start && $past(g_waiting));
    c_reply : cover (reply_start && $past(core_ready, 2));
    c_dropped : cover (drive_sending && ram_enable && core_wstrb[0] && core_addr == 32'hFFFFFF80);
  end
end
