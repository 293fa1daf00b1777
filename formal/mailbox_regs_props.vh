// SPDX-License-Identifier: Apache-2.0
// Between the two sides nothing is lost, doubled, torn or made up: an event stands until it was cleared, a
// command is given once for each write that asks for it, and what is read is all of one clock (FRAME-4, FC-8).
//
// Nothing is assumed. The addresses are those of regs/mailbox.rdl, as bytes.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

wire [4:0] g_address = {word, 2'b00};
wire g_write = valid && write;
wire g_order = g_write && g_address == 5'h0C && !drive_sending;

reg [7:0] g_events = 8'd0;  // that happened and were not cleared
// From regs/mailbox.rdl by make regs: fields
wire [63:0] g_shown = g_events << 32 | ticket << 0 | is_candidate << 4 | is_committed << 5 | frame_broadcast << 6 |
    frame_bank << 7 | telegram_queued << 8 | drive_sending << 9 | telegram_started << 10 | drive_candidate << 11 |
    drive_good << 12 | loopback_open << 13 | loopback_heard << 14 | stop_due << 15 | frame_length << 16 | frame_length
    << 48 | ticks << 24 | ticks << 56 | restarts << 40;
wire [7:0] g_happens = count_crc << 0 | count_parity << 1 | count_framing << 2 | count_t15 << 3 | count_overrun << 4 |
    revoke << 5 | count_foreign << 6 | drive_bad << 7;
wire [31:0] g_pulses = {halt, loopback_close, watch_master};
wire [31:0] g_pulses_data = {word == 3'd7 && wdata[0:0], word == 3'd7 && wdata[1:1], word == 3'd7 && wdata[2:2]};
wire [31:0] g_kept = {lit_modbus_red, lit_modbus_green, lit_drive_red, lit_drive_green};
wire [31:0] g_kept_data = {wdata[0:0], wdata[1:1], wdata[2:2], wdata[3:3]};
wire [31:0] g_fields = {reply_after_drive, order_ticket, order_no_reply, order_stop, order_early, running, period};
wire [31:0] g_fields_data = {wdata[5:5], wdata[11:8], wdata[5:5], wdata[12:12], wdata[13:13], wdata[3:3],
    wdata[31:12]};
// end of fields

reg g_read = 1'b0;  // in the clock before
reg [31:0] g_seen = 32'd0;  // what it showed then
reg [4:0] g_reply_length = 5'd0;  // by the last write that gave one
reg [5:0] g_telegram = 6'd0;
reg [31:0] g_lamps = 32'd0;
reg [1:0] g_options = 2'd0;
reg g_telegram_kept = 1'b0;
reg [5:0] g_telegram_was = 6'd0;

always @(posedge clk) begin
  g_events <= (g_write && g_address == 5'h04 ? g_events & ~wdata[7:0] : g_events) | g_happens;
  g_read <= valid && !write;
  g_seen <= word[0] ? g_shown[63:32] : g_shown[31:0];
  if (g_write && g_address == 5'h08) g_reply_length <= wdata[4:0];
  if (g_order && wdata[7:6] != 2'd1) g_telegram <= wdata[5:0];
  if (g_write && g_address == 5'h10) g_lamps <= g_kept_data;
  if (rst) g_lamps <= 32'd0;
  if (g_write && g_address == 5'h18 && wdata[7:0] == 8'hA5) g_options <= wdata[9:8];
  g_telegram_kept <= drive_sending || !g_write;
  g_telegram_was <= {telegram_no_reply, telegram_length};
end

always @(posedge clk) begin
  if (g_past) begin
    // Every field in its place, all of them as they were in the clock of the reading. An event is shown from the clock
    // after it until a write clears it, also when it comes with that write.
    a_status : assert (rdata == (g_read ? g_seen : 32'd0));
    // Commands: in the clock of the write and for nothing else. A bus access is one clock (bus_arbiter).
    a_reply : assert (order_reply == (g_write && g_address == 5'h08));
    a_telegram : assert (order_telegram == (g_order && wdata[7:6] != 2'd1));
    a_repeat : assert (order_repeat == (g_order && wdata[7:6] == 2'd1));
    a_newest : assert (!order_telegram || (order_kind == 2'd0) == (wdata[7:6] == 2'd0));
    a_image : assert (!order_telegram || (order_kind == 2'd1) == (wdata[7:6] == 2'd3));
    a_to_all : assert (!order_telegram || wdata[7:6] != 2'd2 || order_kind == {1'b1, wdata[5]});
    a_listen : assert (listen_again == (g_write && g_address == 5'h14 && wdata[0]));
    a_stop : assert (listen_stop == (g_write && g_address == 5'h14 && !wdata[0]));
    a_kick : assert (watchdog_kick == (g_write && g_address == 5'h18 && wdata[7:0] == 8'hA5));
    a_pulses : assert (g_pulses == (g_write ? g_pulses_data : 32'd0));
    a_one_command : assert ({2'd0, order_reply} + {2'd0, order_telegram} + {2'd0, order_repeat} +
        {2'd0, listen_again} + {2'd0, listen_stop} + {2'd0, watchdog_kick} + {2'd0, |g_pulses} <= 3'd1);
    // What is written is kept until the next such write; a telegram's length while it is on the wire (FC-1).
    a_reply_length : assert (reply_length == g_reply_length);
    a_telegram_length : assert ({telegram_no_reply, telegram_length} == g_telegram);
    a_while_sending : assert (!g_telegram_kept || {telegram_no_reply, telegram_length} == g_telegram_was);
    a_lamps : assert (g_kept == g_lamps);
    a_options : assert ({break_tolerant, strict_t15} == g_options);
    // The fields of an order, in the clock of its write.
    a_fields : assert (!g_write || g_fields == g_fields_data);
    a_reply_empty : assert (!g_write || reply_empty == (wdata[4:0] == 5'd0));
  end
end

// ---- what induction needs to know
always @(posedge clk) if (g_past) i_events : assert (flags == g_events);

// ---- covers: the module does act
always @(posedge clk) begin
  if (g_past && !rst) begin
    c_with_clear : cover (g_read && rdata[0] && $past(word[0]) && $past(g_write && g_address == 5'h04 && wdata[0] && count_crc, 2));
    c_cleared : cover (g_read && !rdata[0] && $past(word[0]) && $past(g_events[0], 3));
    c_kick : cover (watchdog_kick);
  end
end
