// SPDX-License-Identifier: Apache-2.0
// A reply is good only if STX, LGE, ADR, all characters, gaps, total time and BCC are correct. A telegram that fails
// is bad, once. A good one stays until the card listens again (FC-1, FC-2, FC-7, FC-8).
//
// The ghosts count characters and ticks of the telegram as in FC-8, without the module's slots.
//
// Assumed of the neighbours:
// - A character begins with start_seen and ends with byte_valid. The pause does not end in between.
// - The memory takes a character before the next character or the pause.
// - Listening restarts after a good telegram or after sending, so never inside a character of a telegram.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

reg g_character = 1'b0;  // a character is on the line
reg g_inside = 1'b0;  // that character began inside a telegram
reg g_pending = 1'b0;  // a character is to be stored
reg [8:0] g_pos = 9'd0;  // characters of the telegram so far; 0: no telegram
always @* begin
  assume (!(start_seen && (byte_valid || g_character)));
  assume (!byte_valid || g_character);
  assume (!((g_character || start_seen) && long_reached));
  assume (!(g_pending && (byte_valid || long_reached)));
  assume (!(listen_start && ((g_character && g_inside) || (start_seen && g_pos != 9'd0))));
end

// ---- the telegram by the rules
localparam [16:0] G_CHARACTER = 17'd176;  // ticks: 11 bits of 16
localparam [16:0] G_ENDLESS = 17'd258 * 17'd264;  // longer than the longest may be

reg g_on = 1'b0;
reg g_done = 1'b0;
reg g_waiting = 1'b0;  // for the pause, after a bad telegram
reg [7:0] g_lge = 8'd0;
reg [16:0] g_elapsed = G_CHARACTER;  // ticks since the telegram began, up to G_ENDLESS
reg [8:0] g_summed = 9'd0;  // characters in the BCC unit, up to 257

wire g_damaged = byte_parity_error || byte_framing_error;
wire g_last = g_pos >= 9'd2 && g_pos == {1'b0, g_lge} + 9'd1;
wire g_late = g_elapsed >= ({9'd0, g_lge} + 17'd2) * 17'd264;  // 1.5 characters per character
wire g_wrong = g_damaged || (g_pos == 9'd1 && byte_data < 8'd6) || (g_pos == 9'd2 && byte_data != adr) ||
    (g_last && (!check_good || g_late));
wire g_refused = g_pos != 9'd0 && (long_reached || (byte_valid && g_wrong));
wire g_stored = byte_valid && (g_pos == 9'd1 || (g_pos >= 9'd3 && !g_last));
wire [8:0] g_data = g_pos - 9'd3;

reg g_bad = 1'b0;
reg [4:0] g_place = 5'd0;
reg [16:0] g_slots = 17'd0;  // of 264 ticks, for induction only

always @(posedge clk) begin
  g_bad <= g_refused;

  if (start_seen) begin
    g_character <= 1'b1;
    g_inside <= g_pos != 9'd0;
  end
  if (byte_valid) g_character <= 1'b0;
  if (check_clear) g_summed <= 9'd0;
  else if (byte_valid && g_summed != 9'd257) g_summed <= g_summed + 9'd1;

  if (g_pos == 9'd0) begin
    g_elapsed <= G_CHARACTER;
    g_slots <= 17'd0;
  end else if (tick16 && g_elapsed != G_ENDLESS) begin
    g_elapsed <= g_elapsed + 17'd1;
    if (slot_end) g_slots <= g_slots + 17'd1;
  end

  if (write_ready) g_pending <= 1'b0;
  if (g_stored) begin
    g_pending <= 1'b1;
    g_place <= g_pos == 9'd1 ? 5'd28 : g_data < 9'd24 ? g_data[4:0] : {3'b110, g_data[1:0]};
  end

  if (byte_valid && g_on && !g_done && !g_waiting) begin
    if (g_pos == 9'd0) begin
      if (!g_damaged && byte_data == 8'h02) g_pos <= 9'd1;
    end else begin
      g_pos <= g_pos + 9'd1;
      if (g_pos == 9'd1) g_lge <= byte_data;
      if (g_last) begin
        g_done <= 1'b1;
        g_pos  <= 9'd0;
      end
    end
  end
  if (g_refused) begin
    g_waiting <= 1'b1;
    g_done <= 1'b0;
    g_pos <= 9'd0;
  end
  if (long_reached) g_waiting <= 1'b0;
  if (listen_start || listen_stop || rst) begin
    g_on <= !(listen_stop || rst);
    g_done <= 1'b0;
    g_waiting <= 1'b0;
    g_pos <= 9'd0;
  end
  if (rst) begin
    g_pending   <= 1'b0;
    g_character <= 1'b0;
  end
end

reg g_candidate = 1'b0;  // in the clock before
reg g_good = 1'b0;
reg g_asked = 1'b1;  // listen_start, listen_stop or rst
always @(posedge clk) begin
  g_candidate <= candidate;
  g_good <= good;
  g_asked <= listen_start || listen_stop || rst;
end

always @(posedge clk) begin
  if (g_past) begin
    // FC-8: good if and only if everything was correct; bad if and only if a telegram began and failed.
    a_good : assert (good == g_done);
    a_bad : assert (bad == g_bad);
    a_candidate : assert (candidate == g_last);
    a_listening : assert (listening == g_on);
    // good follows candidate; good and bad are never together, and neither comes while the receiver is off.
    a_before : assert (!good || g_good || g_candidate);
    a_either : assert (!(good && bad) && !(good && candidate));
    a_once : assert (!bad || !$past(bad));
    a_off : assert (g_on || !(good || candidate));
    // A good telegram and its bytes stay until listen_start or listen_stop.
    a_stays : assert (!g_good || g_asked || good);
    a_kept : assert (!good || !write_valid);
    // The BCC covers exactly this telegram's characters (FC-1).
    a_summed : assert (g_pos == 9'd0 || g_summed == g_pos);
    // LGE and each data byte are written once, at their addresses; nothing else is written (FC-7).
    a_write : assert (write_valid == g_pending);
    a_place : assert (!write_valid || write_addr == g_place);
  end
end

// ---- helpers for induction
always @(posedge clk) begin
  if (g_past) begin
    i_off : assert ((state == S_OFF) == !g_on);
    i_hunt : assert ((state == S_HUNT) == (g_on && g_pos == 9'd0 && !g_done && !g_waiting));
    i_lge : assert ((state == S_LGE) == (g_pos == 9'd1));
    i_address : assert ((state == S_ADR) == (g_pos == 9'd2));
    i_data : assert ((state == S_DATA) == (g_pos >= 9'd3 && !g_last));
    i_bcc : assert ((state == S_BCC) == g_last);
    i_bad : assert ((state == S_BAD) == g_waiting);
    i_one : assert ({1'b0, g_pos != 9'd0} + {1'b0, g_done} + {1'b0, g_waiting} <= {1'b0, g_on});
    i_range : assert (g_pos < 9'd2 || (g_lge >= 8'd6 && g_pos <= {1'b0, g_lge} + 9'd1));
    i_left : assert (g_pos < 9'd2 || {1'b0, left} == {1'b0, g_lge} + 9'd2 - g_pos);
    i_pending : assert (!storing || index == g_place);
    i_next : assert (g_pos < 9'd3 || index == (g_pending ? g_last_place : g_next_place));
    i_adr : assert (g_pos != 9'd3 || !g_pending);
    i_summed : assert (g_pos != 9'd0 || !g_character || g_inside || g_summed == 9'd0);
    i_inside : assert (!(g_character && g_pos != 9'd0 && !g_inside));
    i_stale : assert (!(g_character && g_inside && g_pos == 9'd0 && g_on));
  end
end
wire [8:0] g_before = g_data - 9'd1;
wire [4:0] g_next_place = g_data < 9'd24 ? g_data[4:0] : {3'b110, g_data[1:0]};
wire [4:0] g_last_place = g_before < 9'd24 ? g_before[4:0] : {3'b110, g_before[1:0]};
// Relation of the module's slots to the ghost's ticks.
wire signed [9:0] g_ahead = {1'b0, g_pos} - g_slots[9:0];
always @(posedge clk) begin
  if (g_past) begin
    i_slot : assert (slot < SLOT_TICKS);
    if (g_pos != 9'd0 && g_elapsed != G_ENDLESS) begin
      i_slots : assert (g_elapsed == g_slots * 17'd264 + {8'd0, slot} && g_slots < 17'd258);
      i_ahead : assert (ahead == g_ahead);
    end
    if (g_pos != 9'd0 && g_elapsed == G_ENDLESS) begin
      i_endless : assert (ahead <= $signed({1'b0, g_pos}) - 10'sd258 && ahead >= -10'sd257);
    end
  end
end

// ---- covers
always @(posedge clk) begin
  if (g_past && !rst) begin
    c_good : cover (good && g_lge == 8'd6);
    c_slow : cover (bad && g_lge == 8'd6 && !$past(long_reached));
    c_gap : cover (bad && $past(long_reached));
  end
end

`ifdef FLIPPED
// ---- one flipped bit of the receiver (formal/flips.py): no telegram counts as good without its BCC
reg g_checked = 1'b0;  // a sound character came in the clock before, and the BCC was right
always @(posedge clk) begin
  g_checked <= byte_valid && check_good && !g_damaged;
  if (g_past) f_checked : assert (!good || g_good || g_checked);
  if (g_past) c_counts : cover (good && !g_good);
end
`endif
