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

// One event, whichever: how it stands follows from what happened to it last.
(* anyconst *) reg [2:0] g_kind;
reg g_due = 1'b0;  // it happened, and was not cleared since
wire [7:0] g_all = {drive_bad, count_foreign, revoke, count_overrun, count_t15, count_framing, count_parity, count_crc};
wire g_happens = g_all[g_kind];
wire g_cleared = g_write && g_address == 5'h04 && wdata[g_kind];

reg g_read = 1'b0;  // in the clock before
reg g_read_events = 1'b0;
reg g_was_due = 1'b0;
reg [31:0] g_seen = 32'd0;  // the status side then; byte 0 as address 0 shows it
reg [4:0] g_reply_length = 5'd0;  // by the last write that gave one
reg [5:0] g_telegram = 6'd0;
reg [3:0] g_lamps = 4'd0;
reg [1:0] g_options = 2'd0;
reg g_telegram_kept = 1'b0;
reg [5:0] g_telegram_was = 6'd0;

always @(posedge clk) begin
  if (g_happens) g_due <= 1'b1;
  else if (g_cleared) g_due <= 1'b0;

  g_read <= valid && !write;
  g_read_events <= word[0];
  g_was_due <= g_due;
  g_seen <= {
    ticks,
    frame_length,
    word[0] ? restarts : {stop_due, loopback_heard, loopback_open, drive_good, drive_candidate, telegram_started,
    drive_sending, telegram_queued},
    {frame_bank, frame_broadcast, is_committed, is_candidate, ticket}
  };
  if (g_write && g_address == 5'h08) g_reply_length <= wdata[4:0];
  if (g_order && wdata[7:6] != 2'd1) g_telegram <= wdata[5:0];
  if (g_write && g_address == 5'h10) g_lamps <= wdata[3:0];
  if (rst) g_lamps <= 4'd0;
  if (g_write && g_address == 5'h18 && wdata[7:0] == 8'hA5) g_options <= wdata[9:8];
  g_telegram_kept <= drive_sending || !g_write;
  g_telegram_was <= {telegram_no_reply, telegram_length};
end

always @(posedge clk) begin
  if (g_past) begin
    // An event is shown from the clock after it until a write clears it, whatever else is read or written, also
    // when it comes with that write; one that did not happen is not.
    a_event : assert (!(g_read && g_read_events) || rdata[g_kind] == g_was_due);
    // Status: every field in its place, all of them as they were in the clock of the reading.
    a_request : assert (!g_read || g_read_events || rdata[7:0] == g_seen[7:0]);
    a_status : assert (!g_read || rdata[31:8] == g_seen[31:8]);
    a_quiet : assert (g_read || rdata == 32'd0);
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
    a_halt : assert (halt == (g_write && g_address == 5'h1C && wdata[0]));
    a_close : assert (loopback_close == (g_write && g_address == 5'h1C && wdata[1]));
    a_watch : assert (watch_master == (g_write && g_address == 5'h1C && wdata[2]));
    a_one_command : assert ({2'd0, order_reply} + {2'd0, order_telegram} + {2'd0, order_repeat} +
        {2'd0, listen_again} + {2'd0, listen_stop} + {2'd0, watchdog_kick} + {2'd0, halt || loopback_close || watch_master} <= 3'd1);
    // What is written is kept until the next such write; a telegram's length while it is on the wire (FC-1).
    a_reply_length : assert (reply_length == g_reply_length);
    a_telegram_length : assert ({telegram_no_reply, telegram_length} == g_telegram);
    a_while_sending : assert (!g_telegram_kept || {telegram_no_reply, telegram_length} == g_telegram_was);
    a_lamps : assert ({lit_drive_green, lit_drive_red, lit_modbus_green, lit_modbus_red} == g_lamps);
    a_options : assert ({break_tolerant, strict_t15} == g_options);
    // The fields of an order, in the clock of its write.
    a_order_fields : assert (!g_write || ({order_no_reply, order_stop, order_early, order_ticket} ==
        {wdata[5], wdata[12], wdata[13], wdata[11:8]}));
    a_reply_fields : assert (!g_write || ({reply_empty, reply_after_drive} == {wdata[4:0] == 5'd0, wdata[5]}));
    a_watch_fields : assert (!g_write || ({period, running} == {wdata[31:12], wdata[3]}));
  end
end

// ---- what induction needs to know
always @(posedge clk) if (g_past) i_due : assert (flags[g_kind] == g_due);

// ---- covers: the module does act
always @(posedge clk) begin
  if (g_past && !rst) begin
    c_with_clear : cover (g_read && g_read_events && rdata[g_kind] && $past(g_cleared && g_happens, 2));
    c_cleared : cover (g_read && g_read_events && !rdata[g_kind] && $past(g_due, 3));
    c_kick : cover (watchdog_kick);
  end
end
