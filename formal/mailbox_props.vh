// SPDX-License-Identifier: Apache-2.0
// Arbiter, registers and gate, wired. What the gate promises at its pins (commit_gate_props.vh) it promises for the
// mailbox: each pin of the gate is the field of the bus or of a vector that it stands for. The gate hears of each write to
// a byte of the telegram before that byte changes in the memory. So each telegram was caused by a committed request, with
// all its bytes and its length, and no byte changes while it is sent. Only the newest request gets a reply (SAFE-1,
// SAFE-7, FRAME-6, FRAME-7).
//
// Assumed of the ports: neither line reads and writes at once, the drive port sends after a start only, and a quiet
// line is silent. Nothing is assumed of the firmware.

localparam G_WORD_BITS = $clog2(MEMORY_BYTES / 4);
localparam [31:0] G_LAST = MEMORY_BYTES / 4 - 1;

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

// ---- what the firmware does, from the bus and the memory's pins
wire g_write = regs_valid && core_wstrb != 4'd0;  // to a register
wire g_order = g_write && core_addr[4:2] == 3'd3 && !drive_sending;
wire g_telegram = g_order && core_wdata[7:6] != 2'd1;
wire g_reply = g_write && core_addr[4:2] == 3'd2;
wire g_supervise = g_write && core_addr[4:2] == 3'd7;
// The telegram: 32 words of the last 64, their lowest bytes.
wire g_written = ram_enable && ram_wstrb[0] && ram_word[G_WORD_BITS-1:5] == {G_LAST[G_WORD_BITS-1:6], 1'b1};

reg [5:0] g_ordered = 6'd0;  // length and no_reply of the telegram
reg [5:0] g_answer = 6'd0;  // length and after_drive of the reply
reg g_was_sending = 1'b0;
reg g_start = 1'b0;
reg [1:0] g_was_marked = 2'd0;
reg g_read = 1'b0;  // a line read the memory in the clock before
reg g_asked_regs = 1'b0;
reg g_core_rst = 1'b1;
reg [31:0] g_status = 32'd0;  // what the firmware asked for, as it was then
reg [7:0] g_events = 8'd0;  // that happened and were not cleared

always @(posedge clk) begin
  g_was_sending <= drive_sending;
  g_start <= telegram_start;
  g_was_marked <= {telegram_control, telegram_stop};
  g_read <= modbus_read_ready || drive_read_ready;
  if (g_telegram) g_ordered <= core_wdata[5:0];
  if (g_reply) g_answer <= core_wdata[5:0];
  g_asked_regs <= regs_valid && core_wstrb == 4'd0;
  g_core_rst <= core_rst;
  g_status <= {
    ticks,
    frame_length,
    core_addr[2] ? restarts : {stop_due, loopback_heard, loopback_open, drive_good, drive_candidate, telegram_started,
    drive_sending, telegram_queued},
    core_addr[2] ? g_events : {frame_bank, frame_broadcast, is_committed, is_candidate, ticket}
  };
  g_events <= (g_write && core_addr[4:2] == 3'd1 ? g_events & ~core_wdata[7:0] : g_events) |
      {drive_bad, count_foreign, revoke, count_overrun, count_t15, count_framing, count_parity, count_crc};
end

always @* begin
  assume (!modbus_quiet || modbus_silent);
  assume (!(modbus_read_valid && modbus_write_valid));
  assume (!(drive_read_valid && drive_write_valid));
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
        {core_wdata[5], core_wdata[12], core_wdata[13], core_wdata[11:8]})));
    a_kind_seen : assert (!g_telegram || \gate_i.order_kind == (core_wdata[7:6] == 2'd0 ? 2'd0 :
        core_wdata[7:6] == 2'd3 ? 2'd1 : core_wdata[5] ? 2'd3 : 2'd2));
    a_reply_seen : assert (\gate_i.order_reply == g_reply && (!g_reply || ({\gate_i.reply_empty ,
        \gate_i.reply_after_drive , \gate_i.order_ticket } == {core_wdata[4:0] == 5'd0, core_wdata[5], core_wdata[11:8]})));
    // SAFE-7, LOOP-1
    a_watch_seen : assert (\gate_i.watch == (g_supervise && core_wdata[2]) && (!\gate_i.watch ||
        {\gate_i.period , \gate_i.order_ticket , \gate_i.running } == {core_wdata[31:8], core_wdata[3]}));
    a_beat_seen : assert (\gate_i.beat == ticks[0]);
    a_loopback_seen : assert (\gate_i.loopback_open == loopback_open &&
        \gate_i.loopback_close == (g_supervise && core_wdata[1]) && loopback_close == \gate_i.loopback_close );
    a_restart_seen : assert (\gate_i.rst == core_rst);
    // SAFE-1: no byte of the telegram changes but with the gate's knowledge, by whatever address, and none on the wire.
    a_touched : assert (\gate_i.telegram_touched || !g_written);
    a_frozen : assert (!drive_sending || !g_written);
    a_touched_for_a_write : assert (!telegram_touched || (core_valid && !core_ready && core_wstrb[0]));
    a_ordered : assert ({telegram_no_reply, telegram_length} == g_ordered);
    a_length_frozen : assert (!g_was_sending || {telegram_no_reply, telegram_length} == $past({telegram_no_reply, telegram_length}));
    a_marks_frozen : assert (!drive_sending || {telegram_control, telegram_stop} == g_was_marked);
    // FC-8, SAFE-2: both ports rely on it.
    a_drive_quiet : assert (!telegram_start || (drive_quiet && !drive_sending));
    a_modbus_quiet : assert (!reply_start || modbus_quiet);
    // FRAME-4: a reply has a length, the one that it was ordered with.
    a_reply_length : assert (!reply_start || (reply_length != 5'd0 && reply_length == g_answer[4:0]));
    a_after_drive : assert (!reply_start || !g_answer[5] || drive_good);
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
    a_dark : assert (!g_core_rst || {lit_drive_green, lit_drive_red, lit_modbus_green, lit_modbus_red} == 4'd0);
  end
end

// ---- what induction needs to know
always @(posedge clk) begin
  if (g_past) begin
    i_answer : assert (reply_length == g_answer[4:0]);
    i_reply_length : assert (!reply_queued || reply_length != 5'd0);
    i_not_queued : assert (!((drive_sending || g_start) && telegram_queued));
    i_regs : assert (g_asked_regs || regs_rdata == 32'd0);
    i_waits : assert (!reply_queued || \gate_i.reply_i.wait_drive == g_answer[5]);
    i_flags : assert (\regs_i.flags == g_events);
    i_turn : assert (!(g_read && g_asked_regs));
  end
end

// ---- covers: the module does act
wire g_sound = g_past && !core_rst && !loopback_open;
always @(posedge clk) begin
  if (g_sound) begin
    c_telegram : cover (telegram_start && telegram_length == 5'd14);
    c_image : cover (telegram_start && telegram_control && telegram_no_reply);
    c_repeat : cover (telegram_start && $past(g_order && !g_telegram) && $past(g_was_sending, 2));
    c_reply : cover (reply_start && $past(core_ready, 2));
    c_dropped : cover (drive_sending && ram_enable && core_wstrb[0] && core_addr == 32'hFFFFFF80);
  end
end
