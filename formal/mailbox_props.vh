// SPDX-License-Identifier: Apache-2.0
// Registers and gate, wired. What the gate promises at its pins (commit_gate_props.vh) it promises for the mailbox: each
// pin of the gate is the field of the bus or of a port that it stands for. The gate hears of each write to the telegram's
// memory that bus_arbiter reports, which is every one. So each telegram was caused by a committed request, with all its
// bytes and its length. Only the newest request gets a reply (SAFE-1, SAFE-7, FRAME-6, FRAME-7).
//
// Assumed of the ports: the drive port sends after a start only, and a quiet line is silent. Nothing is assumed of the
// firmware.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (core_rst);

// Nets inside the instances, by their hierarchical names.
(* hierconn *) wire \gate_i.candidate ;
(* hierconn *) wire \gate_i.commit ;
(* hierconn *) wire \gate_i.revoke ;
(* hierconn *) wire \gate_i.broadcast ;
(* hierconn *) wire \gate_i.writes_coils ;
(* hierconn *) wire \gate_i.writes_parameter ;
(* hierconn *) wire \gate_i.modbus_start_seen ;
(* hierconn *) wire \gate_i.modbus_silent ;
(* hierconn *) wire \gate_i.modbus_quiet ;
(* hierconn *) wire \gate_i.drive_good ;
(* hierconn *) wire \gate_i.drive_bad ;
(* hierconn *) wire \gate_i.drive_quiet ;
(* hierconn *) wire \gate_i.order_reply ;
(* hierconn *) wire \gate_i.reply_empty ;
(* hierconn *) wire \gate_i.reply_after_drive ;
(* hierconn *) wire \gate_i.order_telegram ;
(* hierconn *) wire [1:0] \gate_i.order_kind ;
(* hierconn *) wire \gate_i.order_no_reply ;
(* hierconn *) wire \gate_i.order_early ;
(* hierconn *) wire \gate_i.order_stop ;
(* hierconn *) wire \gate_i.order_repeat ;
(* hierconn *) wire \gate_i.telegram_touched ;
(* hierconn *) wire [3:0] \gate_i.order_ticket ;
(* hierconn *) wire \gate_i.watch ;
(* hierconn *) wire \gate_i.running ;
(* hierconn *) wire [19:0] \gate_i.period ;
(* hierconn *) wire \gate_i.beat ;
(* hierconn *) wire \gate_i.rst ;
(* hierconn *) wire \gate_i.loopback_open ;
(* hierconn *) wire \gate_i.loopback_close ;
(* hierconn *) wire \gate_i.reply_i.wait_drive ;
(* hierconn *) wire [7:0] \regs_i.flags ;
// Such a name loses its power-up value; the others are reset.
initial assume (\regs_i.flags == 8'd0);

// ---- what the firmware does, from the bus
wire g_write = regs_valid && regs_write;
wire g_order = g_write && regs_word == 3'd3 && !drive_sending;
wire g_telegram = g_order && regs_wdata[7:6] != 2'd1;
wire g_reply = g_write && regs_word == 3'd2;
wire g_supervise = g_write && regs_word == 3'd7;

reg [5:0] g_ordered = 6'd0;  // length and no_reply of the telegram
reg [5:0] g_answer = 6'd0;  // length and after_drive of the reply
reg g_was_sending = 1'b0;
reg g_start = 1'b0;
reg [1:0] g_was_marked = 2'd0;
reg g_asked_regs = 1'b0;
reg g_core_rst = 1'b1;
reg [31:0] g_status = 32'd0;  // what the firmware asked for, as it was then
reg [7:0] g_events = 8'd0;  // that happened and were not cleared
// From regs/mailbox.rdl by make regs: fields
wire [63:0] g_shown = g_events << 32 | ticket << 0 | is_candidate << 4 | is_committed << 5 | frame_broadcast << 6 |
    frame_bank << 7 | telegram_queued << 8 | drive_sending << 9 | telegram_started << 10 | drive_candidate << 11 |
    drive_good << 12 | loopback_open << 13 | loopback_heard << 14 | stop_due << 15 | frame_length << 16 | frame_length
    << 48 | ticks << 24 | ticks << 56 | restarts << 40;
wire [7:0] g_happens = count_crc << 0 | count_parity << 1 | count_framing << 2 | count_t15 << 3 | count_overrun << 4 |
    revoke << 5 | count_foreign << 6 | drive_bad << 7;
// end of fields

always @(posedge clk) begin
  g_was_sending <= drive_sending;
  g_start <= telegram_start;
  g_was_marked <= {telegram_control, telegram_stop};
  if (g_telegram) g_ordered <= regs_wdata[5:0];
  if (g_reply) g_answer <= regs_wdata[5:0];
  g_asked_regs <= regs_valid && !regs_write;
  g_core_rst <= core_rst;
  g_status <= regs_word[0] ? g_shown[63:32] : g_shown[31:0];
  g_events <= (g_write && regs_word == 3'd1 ? g_events & ~regs_wdata[7:0] : g_events) | g_happens;
end

always @* begin
  assume (!modbus_quiet || modbus_silent);
  assume (!drive_sending || g_was_sending || g_start);
end

always @(posedge clk) begin
  if (g_past) begin
    // FRAME-6, SAFE-1: the gate sees the request, both lines and the firmware's orders as they are.
    a_request_seen : assert ({\gate_i.candidate , \gate_i.commit , \gate_i.revoke , \gate_i.broadcast ,
        \gate_i.writes_coils , \gate_i.writes_parameter } == {candidate, commit, revoke, frame_broadcast,
        frame_writes_coils, frame_writes_parameter});
    a_lines_seen : assert ({\gate_i.modbus_start_seen , \gate_i.modbus_silent , \gate_i.modbus_quiet ,
        \gate_i.drive_good , \gate_i.drive_bad , \gate_i.drive_quiet } == {modbus_start_seen, modbus_silent,
        modbus_quiet, drive_good, drive_bad, drive_quiet && !drive_sending});
    a_telegram_seen : assert (\gate_i.order_telegram == g_telegram && \gate_i.order_repeat == (g_order && !g_telegram) &&
        (!g_telegram || ({\gate_i.order_no_reply , \gate_i.order_stop , \gate_i.order_early , \gate_i.order_ticket } ==
        {regs_wdata[5], regs_wdata[12], regs_wdata[13], regs_wdata[11:8]})));
    a_kind_seen : assert (!g_telegram || \gate_i.order_kind == (regs_wdata[7:6] == 2'd0 ? 2'd0 :
        regs_wdata[7:6] == 2'd3 ? 2'd1 : regs_wdata[5] ? 2'd3 : 2'd2));
    a_reply_seen : assert (\gate_i.order_reply == g_reply && (!g_reply || ({\gate_i.reply_empty ,
        \gate_i.reply_after_drive , \gate_i.order_ticket } == {regs_wdata[4:0] == 5'd0, regs_wdata[5], regs_wdata[11:8]})));
    // SAFE-7, LOOP-1
    a_watch_seen : assert (\gate_i.watch == (g_supervise && regs_wdata[2]) && (!\gate_i.watch ||
        {\gate_i.period , \gate_i.order_ticket , \gate_i.running } == {regs_wdata[31:8], regs_wdata[3]}));
    a_beat_seen : assert (\gate_i.beat == ticks[0]);
    a_loopback_seen : assert (\gate_i.loopback_open == loopback_open &&
        \gate_i.loopback_close == (g_supervise && regs_wdata[1]) && loopback_close == \gate_i.loopback_close );
    a_restart_seen : assert (\gate_i.rst == core_rst);
    // SAFE-1: the gate hears of each write to the telegram.
    a_touched : assert (\gate_i.telegram_touched == telegram_touched);
    a_ordered : assert ({telegram_no_reply, telegram_length} == g_ordered);
    a_length_frozen : assert (!g_was_sending || {telegram_no_reply, telegram_length} == $past({telegram_no_reply, telegram_length}));
    a_marks_frozen : assert (!drive_sending || {telegram_control, telegram_stop} == g_was_marked);
    // FC-8, SAFE-2: both ports rely on it.
    a_drive_quiet : assert (!telegram_start || (drive_quiet && !drive_sending));
    a_modbus_quiet : assert (!reply_start || modbus_quiet);
    // FRAME-4: a reply has a length, the one that it was ordered with.
    a_reply_length : assert (!reply_start || (reply_length != 5'd0 && reply_length == g_answer[4:0]));
    a_after_drive : assert (!reply_start || !g_answer[5] || drive_good);
    // What the firmware reads is the state of one clock, and 0 in any other clock: a line may read the memory then.
    a_status : assert (regs_rdata == (g_asked_regs ? g_status : 32'd0));
    // A restart of the firmware drops its reply and telegram and turns the LEDs off (WDG-1).
    a_restart : assert (!g_core_rst || !(reply_start || telegram_start || telegram_queued || reply_queued));
    a_dark : assert (!g_core_rst || {lit_drive_green, lit_drive_red, lit_modbus_green, lit_modbus_red} == 4'd0);
  end
end

// ---- what induction needs to know
always @(posedge clk) begin
  if (g_past) begin
    i_answer : assert (reply_length == g_answer[4:0]);
    i_reply_length : assert (!reply_queued || reply_length != 5'd0);
    i_not_queued : assert (!((drive_sending || g_start) && telegram_queued));
    i_waits : assert (!reply_queued || \gate_i.reply_i.wait_drive == g_answer[5]);
    i_flags : assert (\regs_i.flags == g_events);
  end
end

// ---- covers: the module does act
wire g_sound = g_past && !core_rst && !loopback_open;
always @(posedge clk) begin
  if (g_sound) begin
    c_telegram : cover (telegram_start && telegram_length == 5'd14);
    c_image : cover (telegram_start && telegram_control && telegram_no_reply);
    c_repeat : cover (telegram_start && $past(g_order && !g_telegram) && $past(g_was_sending, 2));
    c_reply : cover (reply_start && $past(g_reply, 2));
  end
end
