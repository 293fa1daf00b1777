// SPDX-License-Identifier: Apache-2.0
// Each direction of the UART is proved against an independent model of the other side.
//
// RECEIVE: the sender's clock is up to 4 % slow or fast and may wander within that range (LINE-5). A bit is 1600 units
// long. At each tick of the receiver the sender advances by any number of 96 to 104 units. A character begins at any
// moment between two ticks, immediately after the last stop bit or later. It has any byte, every format, a correct or
// wrong parity bit, and its first stop bit or none. Without a stop bit the line is high for a bit before the next
// character. Each character arrives once and unchanged, with parity error and framing error if and only if it had them. Nothing else
// arrives. Noise is left out: that is the glitch filter's task.
//
// CHECKED: whatever is on the line, a received character without a parity error is the eight bits that the check unit
// got. So a byte that changes after the check unit saw it has a parity error (SAFE-4). Assumed: the port does not send.
//
// SEND: every character is well-formed in every format (LINE-1, LINE-3, FC-1). The ghost keeps the byte that was taken
// and counts ticks since its start bit. Both together give the level of the line.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
always @* assume (rst == !g_past);

always @(posedge clk) begin
  if (g_past) begin
    assume ($stable(parity_enable));
    assume ($stable(parity_odd));
    assume ($stable(two_stop));
  end
end
// No format of card_tables has both.
always @* assume (!(parity_enable && two_stop));

wire [2:0] g_state_count = {2'd0, state[0]} + {2'd0, state[1]} + {2'd0, state[2]} + {2'd0, state[3]} + {2'd0, state[4]};
integer g_i;

`ifdef RECEIVE

always @* assume (!send_valid);

localparam [14:0] G_BIT = 15'd1600;
localparam [6:0] G_SLOWEST = 7'd96;
localparam [6:0] G_FASTEST = 7'd104;

// ---- the sender
(* anyseq *) reg [6:0] g_pace;
(* anyseq *) reg [6:0] g_offset;
(* anyseq *) reg g_begin;
(* anyseq *) reg [7:0] g_new_byte;
(* anyseq *) reg g_new_flaw;  // its parity bit is wrong
(* anyseq *) reg g_new_gone;  // its first stop bit is missing
always @* assume (g_pace >= G_SLOWEST && g_pace <= G_FASTEST);

reg g_active = 1'b0;
reg [14:0] g_unit = 15'd0;  // units since the start edge
reg [7:0] g_byte = 8'd0;
reg g_flaw = 1'b0;
reg g_gone = 1'b0;
// End of the first stop bit, and end of the character.
wire [14:0] g_stop_end = parity_enable ? 15'd11 * G_BIT : 15'd10 * G_BIT;
wire [14:0] g_end = g_stop_end + (two_stop || g_gone ? G_BIT : 15'd0);
wire [14:0] g_next = g_unit + {8'd0, g_pace};
wire g_over = g_active && g_next >= g_end;
// A new start edge comes after the last tick and after the end of the last stop bit.
wire g_starts = tick16 && g_begin && (!g_active || g_over);
always @* assume (!g_starts || {8'd0, g_offset} < (g_active ? g_next - g_end + 15'd1 : {8'd0, G_FASTEST}));

always @(posedge clk) begin
  if (tick16) begin
    if (g_active) g_unit <= g_next;
    if (g_over) g_active <= 1'b0;
  end
  if (g_starts) begin
    g_active <= 1'b1;
    g_unit   <= {8'd0, g_offset};
    g_byte   <= g_new_byte;
    g_flaw   <= g_new_flaw && parity_enable;
    g_gone   <= g_new_gone;
  end
  if (rst) {g_active, g_flaw, g_gone} <= 3'b000;
end

// The bit on the line, by comparisons instead of a division.
reg [3:0] g_bit;
always @* begin
  g_bit = 4'd0;
  for (g_i = 1; g_i < 12; g_i = g_i + 1) if (g_unit >= g_i * G_BIT) g_bit = g_i[3:0];
end
wire [11:0] g_frame = {1'b1, !(parity_enable && g_gone), parity_enable ? ^{g_byte, parity_odd, g_flaw} : !g_gone, g_byte, 1'b0};
always @* assume (line == (!g_active || g_frame[g_bit]));

// ---- expected outputs
reg g_due = 1'b0;  // a character was sent and is not received yet
reg [7:0] g_count = 8'd0;  // ticks since its start was first sampled, that tick included
reg [7:0] g_expect = 8'd0;
reg g_expect_flaw = 1'b0;
reg g_expect_gone = 1'b0;
wire g_first = tick16 && g_active && g_count == 8'd0;
always @(posedge clk) begin
  if (tick16 && g_active) g_count <= g_count + 8'd1;
  if (g_starts || (tick16 && g_over)) g_count <= 8'd0;
  if (byte_valid) g_due <= 1'b0;
  if (g_first) begin
    g_due <= 1'b1;
    g_expect <= g_byte;
    g_expect_flaw <= g_flaw;
    g_expect_gone <= g_gone;
  end
  if (rst) begin
    g_due <= 1'b0;
    g_count <= 8'd0;
    g_expect_flaw <= 1'b0;
    g_expect_gone <= 1'b0;
  end
end

wire [7:0] g_decided = parity_enable ? 8'd169 : 8'd153;  // ticks at the vote on the first stop bit
always @(posedge clk) begin
  if (g_past) begin
    a_due : assert (!byte_valid || g_due);
    a_data : assert (!byte_valid || byte_data == g_expect);
    a_parity : assert (!byte_valid || byte_parity_error == g_expect_flaw);
    a_framing : assert (!byte_valid || byte_framing_error == g_expect_gone);
    // No character is lost: each is received before it ends and before the next one begins.
    a_received : assert (!(g_due && g_first && !byte_valid));
    a_ended : assert (!(g_due && !g_active && !byte_valid));
    a_silent : assert (txd && !sending && !driving);
  end
end

// ---- helpers for induction
reg [3:0] g_now;  // the bit that the receiver samples
always @* begin
  g_now = parity_enable ? 4'd10 : 4'd9;
  if (state[S_START]) g_now = 4'd0;
  if (state[S_DATA]) g_now = bits_done + 4'd1;
  if (state[S_PARITY]) g_now = 4'd9;
end
wire [7:0] g_rx_count = {g_now, 4'd0} + {4'd0, phase} + (phase <= 4'd7 ? 8'd1 : -8'd15);
wire g_receiving = state != 5'd0 && !state[S_REST];
always @(posedge clk) begin
  if (g_past) begin
    i_states : assert (g_state_count <= 3'd1 && !loaded);
    i_states_2 : assert (!state[S_PARITY] || parity_enable);
    i_flaw : assert (parity_enable || !(g_flaw || g_expect_flaw));
    i_unit_low : assert (!g_active || g_unit >= g_count * 15'd96);
    i_unit_high : assert (!g_active || g_count == 8'd0 || g_unit < (g_count + 15'd1) * 15'd104);
    i_unit_start : assert (!g_active || g_count != 8'd0 || g_unit < 15'd104);
    i_end : assert (!g_active || g_unit < g_end);
    // A break: the receiver waits while the line is low or has risen since the last tick.
    i_rest : assert (!state[S_REST] || (g_active && g_gone && g_count >= g_decided && g_unit < g_stop_end + 15'd104 && (!g_due || byte_valid)));
    i_gone : assert (!byte_valid || g_expect_gone == state[S_REST]);
    i_low : assert (!(g_active && g_gone && g_count >= g_decided && g_unit < g_stop_end && !state[S_REST] && !g_receiving));
    i_active : assert (!g_receiving || (g_active && g_due && g_count == g_rx_count));
    i_start : assert (!state[S_START] || phase <= 4'd7);
    i_due : assert (!g_due || byte_valid || (g_active && g_count != 8'd0 && g_expect == g_byte && g_expect_flaw == g_flaw && g_expect_gone == g_gone));
    i_range : assert (g_count <= 8'd205 && (g_active || g_count == 8'd0));
    i_waiting : assert (!(g_active && g_count == 8'd0 && g_receiving));
    i_late : assert (!(g_due && !g_receiving && !byte_valid));
    i_valid : assert (!byte_valid || (!g_receiving && (g_count == 8'd0 || g_count == g_decided)));
    i_done : assert (!(g_active && g_count != 8'd0 && !g_due && g_count < g_decided));
    i_parity_data : assert (!state[S_DATA] || parity == ^{g_expect & ~(8'hFF << bits_done), parity_odd});
    i_parity : assert (!state[S_PARITY] || parity == ^{g_expect, parity_odd});
    i_parity_end : assert (!(state[S_STOP] || byte_valid) || (parity == ^{g_expect, parity_odd} && parity_wrong == g_expect_flaw));
    i_vote_7 : assert (!g_receiving || phase != 4'd7 || votes[0] == g_frame[g_now]);
    i_vote_6 : assert (!g_receiving || phase != 4'd7 || g_now == 4'd10 || votes[1] == g_frame[g_now]);
    i_vote_6_now : assert (!g_receiving || phase != 4'd6 || g_now == 4'd10 || votes[0] == g_frame[g_now]);
    if (state[S_DATA]) begin
      for (g_i = 0; g_i < 7; g_i = g_i + 1)
        if (g_i < bits_done) assert (shift[8-bits_done+g_i] == g_expect[g_i]);
    end
    if (state[S_PARITY] || state[S_STOP] || byte_valid) assert (shift == g_expect);
  end
end

`ifdef COVER
// A fast sender sends two characters without a gap; a character without its stop bit is received.
always @* begin
  assume (tick16);
  assume (parity_enable && parity_odd);
  assume (g_begin && g_pace == G_FASTEST && g_offset == 7'd0);
end
always @(posedge clk) begin
  c_received : cover (byte_valid && g_expect == 8'hA5 && g_starts && g_new_byte == 8'h3C);
  c_broken : cover (byte_valid && byte_framing_error && g_expect == 8'hA5);
end
`endif

`else
`ifdef CHECKED

always @* assume (!send_valid);

reg [7:0] g_bits = 8'd0;  // the last bits of the check unit
reg [3:0] g_count = 4'd0;  // of them, those of this character
reg g_sum = 1'b0;  // their parity
always @(posedge clk) begin
  if (bit_valid) begin
    g_bits  <= {bit_data, g_bits[7:1]};
    g_count <= g_count + 4'd1;
    g_sum   <= g_sum ^ bit_data;
  end
  if (state[S_START] || rst) begin
    g_count <= 4'd0;
    g_sum   <= 1'b0;
  end
end

always @(posedge clk) begin
  if (g_past) begin
    a_same : assert (!byte_valid || byte_parity_error || byte_data == g_bits);
    a_eight : assert (!byte_valid || g_count == 4'd8);
    c_sound : cover (byte_valid && !byte_parity_error && !byte_framing_error);
  end
end

// ---- helpers for induction
always @(posedge clk) begin
  if (g_past) begin
    i_states : assert (g_state_count <= 3'd1 && !loaded && !driving);
    i_shift : assert (((shift ^ g_bits) & ~(8'hFF >> g_count)) == 8'd0);
    i_count : assert (!state[S_DATA] || g_count == {1'b0, bits_done});
    i_sum : assert (!state[S_DATA] || parity == (g_sum ^ parity_odd));
    i_late : assert (!(state[S_PARITY] || state[S_STOP] || byte_valid) || g_count == 4'd8);
    i_range : assert (g_count <= 4'd8);
    i_top : assert (g_sum == ^(g_bits & ~(8'hFF >> g_count)));
    i_parity : assert (!(state[S_PARITY] || state[S_STOP] || byte_valid) || parity == ^{g_bits, parity_odd});
    i_start : assert (!state[S_START] || phase <= 4'd7);
    i_valid : assert (!byte_valid || !(state[S_DATA] || state[S_PARITY] || state[S_STOP]));
  end
end

`ifdef COVER
// A low until the start bit has passed, then the line stays high: FF, in a format without parity.
always @* assume (tick16 && !parity_enable && !parity_odd && !two_stop && line == !(idle || state[S_START]));
`endif

`ifdef FLIPPED
// ---- one flipped bit of the receiver (formal/flips.py): a tick a clock, so that the last bits of a character fit
always @* assume (tick16);
`endif

`else

// The port holds the line high while it sends (glitch_filter).
always @* begin
  assume (line);
  assume (!send_check);
end

reg g_loaded = 1'b0;
reg [7:0] g_waiting = 8'd0;  // a byte that was taken and is not on the line yet
reg g_sending = 1'b0;
reg [7:0] g_byte = 8'd0;
reg [7:0] g_tick = 8'd0;  // ticks since its start bit began

wire [3:0] g_bit = g_tick[7:4];
wire [3:0] g_bits = (parity_enable || two_stop) ? 4'd11 : 4'd10;
wire g_load = send_valid && send_ready;
wire g_last = g_bit == g_bits - 4'd1 && g_tick[3:0] == 4'd15;
wire g_go = tick16 && g_loaded && line_ready && (!g_sending || g_last);

reg g_level;
always @* begin
  if (!g_sending) g_level = 1'b1;
  else if (g_bit == 4'd0) g_level = 1'b0;
  else if (g_bit <= 4'd8) g_level = g_byte[g_bit[2:0]-3'd1];
  else if (g_bit == 4'd9 && parity_enable) g_level = ^{g_byte, parity_odd};
  else g_level = 1'b1;
end
reg g_was_level = 1'b1;  // txd and sending follow one clock later
reg g_was_sending = 1'b0;

always @(posedge clk) begin
  g_was_level <= g_level;
  g_was_sending <= g_sending;
  if (tick16 && g_sending) begin
    g_tick <= g_tick + 8'd1;
    if (g_last) g_sending <= 1'b0;
  end
  if (g_go) begin
    g_sending <= 1'b1;
    g_byte <= g_waiting;
    g_tick <= 8'd0;
    g_loaded <= 1'b0;
  end
  if (g_load) begin
    g_loaded  <= 1'b1;
    g_waiting <= send_data;
  end
  if (rst) begin
    g_sending <= 1'b0;
    g_loaded <= 1'b0;
    g_was_level <= 1'b1;
    g_was_sending <= 1'b0;
  end
end

always @(posedge clk) begin
  if (g_past) begin
    a_level : assert (txd == g_was_level);
    a_sending : assert (sending == g_was_sending);
    // No byte overwrites another.
    a_taken : assert (!g_load || !g_loaded);
    a_deaf : assert (!byte_valid && !start_seen);
  end
end

// ---- helpers for induction: the module's state follows from the ghost's
always @(posedge clk) begin
  if (g_past) begin
    i_driving : assert (driving == g_sending);
    i_votes : assert (!(driving && state[S_START]) || ((phase < 4'd1 || votes[0]) && (phase < 4'd2 || votes[1])));
    i_states : assert (g_state_count == (g_sending ? 3'd1 : 3'd0));
    i_loaded : assert (loaded == g_loaded || (g_sending && state[S_START] && loaded && !g_loaded));
    i_waiting : assert (!g_loaded || shift == g_waiting);
    i_not_early : assert (!g_loaded || !g_sending || g_bit >= 4'd9);
    if (g_sending) begin
      i_phase : assert (phase == g_tick[3:0]);
      i_range : assert (g_bit < g_bits);
      i_start : assert (state[S_START] == (g_bit == 4'd0));
      i_data : assert (state[S_DATA] == (g_bit >= 4'd1 && g_bit <= 4'd8));
      i_parity : assert (state[S_PARITY] == (parity_enable && g_bit == 4'd9));
      i_stop : assert (state[S_STOP] == (g_bit == (parity_enable ? 4'd10 : 4'd9)));
      i_rest : assert (state[S_REST] == (two_stop && g_bit == 4'd10));
      i_first : assert (!state[S_START] || shift == g_byte);
      if (state[S_DATA]) begin
        i_bits : assert ({1'b0, bits_done} == g_bit - 4'd1);
        i_sum : assert (parity == ^{g_byte & ~(8'hFF << bits_done), parity_odd});
        for (g_i = 0; g_i < 8; g_i = g_i + 1)
          if (g_i + bits_done < 8) assert (shift[g_i] == g_byte[g_i+bits_done]);
      end
      i_whole : assert (!state[S_PARITY] || parity == ^{g_byte, parity_odd});
    end
  end
end

`ifdef COVER
// Two characters without a gap. All other inputs are constant, because a character is 176 ticks long.
always @* begin
  assume (tick16 && send_valid && line_ready);
  assume (parity_enable && parity_odd);
end
always @(posedge clk)
  c_no_gap : cover (g_sending && g_last && g_go && g_byte == 8'h5A && g_waiting == 8'h7C);
`endif

`endif
`endif
