// SPDX-License-Identifier: Apache-2.0
// DE of the network line rises only for a reply and only after 3.5 characters of silence, at every rate and in every
// format. It falls with the reply and stays for 34 characters and one bit at most (SAFE-2, FRAME-1, FRAME-8, LINE-6).
// Filter, UART, silence timer, sender and direction are proved as wired.
//
// LINE-5: pulses on an idle line cost no request. On a line that is calm since the last character no character begins.
// t3.5 comes within a bound there. The commit of a candidate comes on a silent line. docs/guide/proofs.md, The whole way.
//
// Silent: the pin is high and no character is being received, counted in ticks since the end of the last character of
// either side. A low that is too short for a start bit stops the count and does not restart it.
//
// BREAKS, with break_tolerant = 1: a break is a character of zeros without a stop bit, low from its start bit's vote to that
// of its stop bit. Only breaks may stand between it and a good frame or a reply (FRAME-3). The low that it leaves is silent,
// too. No commit comes after any other character, nor while a low may be one.
//
// Assumed: a reply starts on a quiet line only (proved for mailbox), the memory answers within two clocks (bus_arbiter:
// within one), switches do not move. The reply's length may have any value and may change at any time.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

// Registers inside the instances, by their hierarchical names. They lose their power-up values that way, so the
// first clock is a reset.
(* hierconn *) wire [8:0] \silence_i.ticks ;
(* hierconn *) wire [2:0] \silence_i.halves ;
(* hierconn *) wire [2:0] \rtu_tx_i.state ;
(* hierconn *) wire [4:0] \rtu_tx_i.index ;
(* hierconn *) wire [4:0] \uart_i.state ;
(* hierconn *) wire [3:0] \uart_i.phase ;
(* hierconn *) wire [2:0] \uart_i.bits_done ;
(* hierconn *) wire [1:0] \uart_i.votes ;
(* hierconn *) wire \uart_i.driving ;
(* hierconn *) wire \uart_i.loaded ;
(* hierconn *) wire [3:0] \dir_i.lead ;
(* hierconn *) wire [7:0] \filter_i.history ;
(* hierconn *) wire [3:0] \rtu_rx_i.state ;
(* hierconn *) wire [2:0] \rtu_rx_i.unit ;
(* hierconn *) wire \rtu_rx_i.begun_bank ;
(* hierconn *) wire \rtu_rx_i.candidate ;
(* hierconn *) wire \rtu_rx_i.commit ;
(* hierconn *) wire \rtu_rx_i.revoke ;
(* hierconn *) wire [7:0] \rtu_rx_i.frame_length ;
(* hierconn *) wire \rtu_rx_i.frame_broadcast ;
(* hierconn *) wire \rtu_rx_i.frame_writes_coils ;
(* hierconn *) wire \rtu_rx_i.frame_writes_parameter ;
(* hierconn *) wire \rtu_rx_i.frame_bank ;
(* hierconn *) wire \rtu_rx_i.bank_i.held ;
(* hierconn *) wire \rtu_rx_i.bank_i.opposite ;
(* hierconn *) wire \silence_i.long_over ;
(* hierconn *) wire \breaks_i.held ;
(* hierconn *) wire \breaks_i.after_frame ;
(* hierconn *) wire \breaks_i.break_i.held ;
(* hierconn *) wire \breaks_i.break_i.opposite ;
`ifdef BREAKS
always @* assume (break_tolerant);
(* hierconn *) wire \rtu_rx_i.may_break ;
(* hierconn *) wire [7:0] \uart_i.shift ;
(* hierconn *) wire \uart_i.parity ;
(* hierconn *) wire \uart_i.parity_wrong ;
(* hierconn *) wire \uart_i.stop_missing ;
wire [7:0] g_shift = \uart_i.shift ;
always @(posedge clk) if (g_past) assume ($stable(parity_odd));
reg g_follows = 1'b0;  // since a good frame, or while all is dropped, nothing but breaks began
reg g_undecided = 1'b0;  // so it was at the present start bit, and the line was low since: it may be a break
wire g_is_break = rx_valid && g_undecided;
reg g_in_break = 1'b0;  // the low that a break has left
always @(posedge clk) begin
  if (start_seen) g_follows <= 1'b0;
  else if (\rtu_rx_i.may_break ) g_follows <= 1'b1;
  if (line || rx_valid || de) g_undecided <= 1'b0;
  else if (uart_start) g_undecided <= g_follows;
  if (line) g_in_break <= 1'b0;
  else if (g_is_break) g_in_break <= 1'b1;
  if (rst) {g_follows, g_undecided, g_in_break} <= 3'd0;
end
`else
wire g_is_break = 1'b0;
wire g_in_break = 1'b0;
wire g_undecided = 1'b0;
`endif
wire g_byte = rx_valid && !g_is_break;  // the last clock of a character that is no break
wire g_on_line = rx_busy && !g_in_break;  // a character, or what may be one
wire [8:0] g_ticks = \silence_i.ticks ;
wire [2:0] g_halves = \silence_i.halves ;
wire [2:0] g_sender = \rtu_tx_i.state ;
wire [4:0] g_index = \rtu_tx_i.index ;
wire [4:0] g_uart = \uart_i.state ;
wire [3:0] g_phase = \uart_i.phase ;
wire [2:0] g_bits = \uart_i.bits_done ;
wire [1:0] g_votes = \uart_i.votes ;
wire g_driving = \uart_i.driving ;
wire g_loaded = \uart_i.loaded ;
wire [3:0] g_lead = \dir_i.lead ;
// The outputs of rtu_rx about a frame.
wire [14:0] g_reported = {\rtu_rx_i.candidate , \rtu_rx_i.commit , \rtu_rx_i.revoke , \rtu_rx_i.frame_length ,
    \rtu_rx_i.frame_broadcast , \rtu_rx_i.frame_writes_coils , \rtu_rx_i.frame_writes_parameter , \rtu_rx_i.frame_bank };
localparam [2:0] G_IDLE = 3'd0, G_FETCH = 3'd1, G_SEND = 3'd2, G_CRC_LOW = 3'd3, G_CRC_HIGH = 3'd4, G_DRAIN = 3'd5;
// Ticks: 11 bits of 16, or 10 bits.
wire [15:0] g_character = parity_enable || two_stop ? 16'd176 : 16'd160;

reg [1:0] g_unanswered = 2'd0;
always @(posedge clk) g_unanswered <= read_valid && !read_ready && !rst ? g_unanswered + 2'd1 : 2'd0;

// The rates and formats of card_tables, and a silence that is short enough for the cover to see a reply leave.
always @* begin
`ifdef SHORT_SILENCE
  assume (half_end == 9'd18 && !half_uneven && tick16 && rx);
`else
  assume ((half_end == 9'd105 && !half_uneven) || (half_end == 9'd97 && !half_uneven) ||
          (half_end == 9'd171 && half_uneven) || (half_end == 9'd478 && half_uneven) ||
          (half_end == 9'd18 && !half_uneven));
`endif
  assume (!(parity_enable && two_stop));
  assume (!reply_start || (quiet && !sending));
  assume (!read_valid || read_ready || g_unanswered < 2'd2);
end
always @(posedge clk) begin
  if (g_past) begin
    assume ($stable(half_end));
    assume ($stable(half_uneven));
    assume ($stable(two_stop));
    assume ($stable(parity_enable));
    assume ($stable(strict_t15) || \rtu_rx_i.state == 4'b0000);
  end
end

// ---- silence on the pin
reg [12:0] g_silent = 13'd0;
reg g_own = 1'b0;  // the last character was the card's own
reg g_de = 1'b0;
reg g_rst = 1'b1;
reg g_sending = 1'b0;
reg g_start = 1'b0;
reg g_start_before = 1'b0;
reg [12:0] g_silent_start = 13'd0;  // silence when the reply started
always @(posedge clk) begin
  if (tick16 && ((synced && !rx_busy) || g_in_break) && g_silent != 13'h1FFF) g_silent <= g_silent + 13'd1;
  if (g_byte || de || rst) begin
    g_silent <= 13'd0;
    g_own <= de;
  end
  g_de <= de;
  g_rst <= rst;
  g_sending <= sending;
  g_start <= reply_start && !rst;
  g_start_before <= g_start && !rst;
  if (reply_start) g_silent_start <= g_silent;
end

// ---- time of DE
reg [15:0] g_high = 16'd0;  // ticks since DE rose
reg [5:0] g_taken = 6'd0;  // bytes that the UART took
always @(posedge clk) begin
  if (!de || rst) g_high <= 16'd0;
  else if (tick16) g_high <= g_high + 16'd1;
  if (!sending || rst) g_taken <= 6'd0;
  else if (tx_valid && tx_ready) g_taken <= g_taken + 6'd1;
end

`ifdef BREAKS
// A reply starts in a break: the UART leaves it with the tick after DE has risen.
wire g_break_start = (g_uart == 5'b10000 || g_uart == 5'd0) && !g_driving && g_high <= 16'd1;
`else
wire g_break_start = 1'b0;
`endif

// Ticks of 3.5 characters: of 11 bits, with 8N1 of 10, from 38400 on 1750 us (FRAME-1). After the vote on a stop bit two ticks are
// added, the rest of that bit, and the second stop bit.
wire [12:0] g_limit = half_end == 9'd18 ? 13'd7 : half_end == 9'd105 ? 13'd616 : half_end == 9'd97 ? 13'd560 : half_end == 9'd171 ? 13'd1075 : 13'd3224;
wire [12:0] g_head = g_own ? 13'd0 : two_stop ? 13'd18 : 13'd2;
always @(posedge clk) begin
  if (g_past) begin
    // SAFE-2: a quiet line is silent and has been for 3.5 characters.
    a_silent : assert (!quiet || ((synced || g_in_break) && g_silent >= g_limit + g_head));
    // SAFE-3: t3.5 comes on each silent line, and the receiver is then ready for a frame (a_candidate of rtu_rx).
    a_t35_comes : assert (long_silent || rst || g_silent <= g_limit_most + g_head);
    // FRAME-6: and so is the line at a commit, whose pin may be low for a moment (LINE-5).
    a_commit_silent : assert (!silent || g_silent >= g_limit + g_head);
    // commit_gate relies on these.
    a_begun : assert (!(start_seen && silent));
    a_quiet : assert (quiet == (silent && (synced || g_in_break)));
    // DE rises only two clocks after a start, and that start was in such a silence.
    a_rises : assert (!de || g_de || (g_start_before && g_silent_start >= g_limit));
    // DE falls with the reply, and the receiver is deaf to the reply (LINE-6).
    a_falls : assert (!g_de || de || !sending);
    a_held : assert (!g_sending || !sending || g_start || de || g_rst);
    a_ends : assert (!de || sending);
    // SAFE-2: DE is at most one bit longer than the reply's characters, which are 34 at most.
    a_bounded : assert (!de || g_high <= {10'd0, g_taken} * g_character + 16'd16);
    a_longest : assert (!de || g_high <= 16'd6000);
    a_covers : assert (!tx_busy || de);
    a_at_rest : assert (de || tx);
    a_deaf : assert (!de || !(rx_valid || start_seen));
    a_not_quiet : assert (!(de || g_on_line || rx_valid) || !silent);
    // SAFE-1: the mailbox gets the outputs of rtu_rx (proved there) unchanged, frame_writes_coils above all.
    a_reported : assert ({candidate, commit, revoke, frame_length, frame_broadcast, frame_writes_coils,
        frame_writes_parameter, frame_bank} == g_reported);
    a_reset : assert (!g_rst || !(de || sending || silent || candidate || commit || revoke));
  end
end

// ---- pulses on an idle line (LINE-5)
// Calm: since a character with a good stop bit, the last nine samples of the pin have always been those of a high line
// with pulses below a quarter bit (at most four samples) that are at least 5/16 bit apart (five samples).
function g_pulses(input [8:0] w);
  integer i;
  begin
    g_pulses = 1'b1;
    for (i = 0; i < 5; i = i + 1) if (w[i+:5] == 5'b00000) g_pulses = 1'b0;
    for (i = 0; i < 7; i = i + 1) if (w[i+:3] == 3'b010) g_pulses = 1'b0;
    for (i = 0; i < 6; i = i + 1) if (w[i+:4] == 4'b0110) g_pulses = 1'b0;
    for (i = 0; i < 5; i = i + 1) if (w[i+:5] == 5'b01110) g_pulses = 1'b0;
    for (i = 0; i < 4; i = i + 1) if (w[i+:6] == 6'b011110) g_pulses = 1'b0;
  end
endfunction

reg [8:0] g_samples = 9'h1FF;  // of the pin, the newest is bit 0
wire [8:0] g_samples_next = tick16 ? {g_samples[7:0], synced} : g_samples;
reg g_calm = 1'b0;
reg [12:0] g_highs = 13'd0;  // ticks since then with the pin high
reg [12:0] g_lows = 13'd0;
reg g_awaits = 1'b0;  // a candidate is neither committed nor revoked
reg g_long = 1'b0;  // t3.5 was over in the clock before
always @(posedge clk) begin
  g_samples <= rst || de ? 9'h1FF : g_samples_next;
  if (tick16 && g_calm) begin
    if (synced) g_highs <= g_highs + 13'd1;
    else g_lows <= g_lows + 13'd1;
  end
  if (!g_pulses(g_samples_next) || reply_start || sending || de) g_calm <= 1'b0;
  else if (rx_valid) g_calm <= !rx_framing_error && g_pulses(g_samples);
  if (rx_valid) {g_highs, g_lows} <= 26'd0;
  g_awaits <= (candidate || g_awaits) && !commit && !revoke && !start_seen && !g_byte;
  g_long <= long_silent && !g_byte;
  if (de) g_awaits <= 1'b0;  // no reply starts then (commit_gate)
  if (rst) {g_calm, g_awaits, g_long} <= 3'd0;
  if (g_highs[12] || g_lows[12]) g_calm <= 1'b0;
end

// The samples end with so many lows, or so many highs up to five.
wire [3:0] g_run = g_samples[0] ? 4'd0 : g_samples[1] ? 4'd1 : g_samples[2] ? 4'd2 : g_samples[3] ? 4'd3 : 4'd4;
wire [3:0] g_gap = !g_samples[0] ? 4'd0 : !g_samples[1] ? 4'd1 : !g_samples[2] ? 4'd2 : !g_samples[3] ? 4'd3 :
    !g_samples[4] ? 4'd4 : 4'd5;
wire [15:0] g_lows_5 = {3'd0, g_lows} * 16'd5;
wire [15:0] g_highs_4 = {3'd0, g_highs} * 16'd4;
wire [15:0] g_ticks_5 = ({3'd0, g_highs} + {3'd0, g_lows}) * 16'd5;
wire [15:0] g_most_5 = ({3'd0, g_limit_most} + {3'd0, g_head}) * 16'd9 + 16'd20;
wire [12:0] g_limit_most = 13'd7 * g_half - (half_uneven ? 13'd3 : 13'd0);
wire [3:0] g_ones = {3'd0, g_samples[0]} + {3'd0, g_samples[1]} + {3'd0, g_samples[2]} + {3'd0, g_samples[3]} +
    {3'd0, g_samples[4]} + {3'd0, g_samples[5]} + {3'd0, g_samples[6]} + {3'd0, g_samples[7]} + {3'd0, g_samples[8]};
wire g_rtu_receive = \rtu_rx_i.state == 4'b0101;
wire g_rtu_early = \rtu_rx_i.state == 4'b1010;
wire g_rtu_hold = \rtu_rx_i.state == 4'b0110;
always @(posedge clk) begin
  if (g_past && g_calm) begin
    // No pulse begins a character, ends the silence, or keeps the port from being quiet once its pin is high.
    a_calm : assert (line && !rx_busy && !rx_valid && !start_seen);
    a_calm_quiet : assert (!long_silent || quiet == synced);
    // t3.5 is over after at most 9/5 of its ticks and four more.
    a_calm_bound : assert (long_silent || g_ticks_5 <= g_most_5);
    // The commit comes on a silent line, two clocks after t3.5 at the latest.
    a_calm_commit : assert (!commit || silent);
    a_calm_in_time : assert (!(g_awaits && !commit) || !g_long);
    i_calm_state : assert (g_uart == 5'd0 && !g_driving && !sending && g_pulses(g_samples));
    i_calm_highs : assert (long_silent || g_silent == g_highs);
    i_calm_lows : assert (g_lows_5 <= g_highs_4 + (g_run != 4'd0 ? {12'd0, g_run} * 16'd5 : 16'd20 - {12'd0, g_gap} * 16'd4));
  end
  if (g_past) begin
    i_history : assert (\filter_i.history == g_samples[7:0]);
    i_clean : assert (line == (g_ones >= 4'd5));
    i_valid : assert (!rx_valid || rx_framing_error || (g_uart == 5'd0 && !g_driving));
    i_own : assert (!(g_calm && !long_silent) || !g_own);
    i_long : assert (!\silence_i.long_over || long_silent);
    i_bank_halves : assert (\rtu_rx_i.bank_i.opposite == !\rtu_rx_i.bank_i.held );
    i_driving_deaf : assert (!g_driving || line);
    i_short : assert (!short_reached || (g_halves == 3'd3 && !long_silent));
    i_commit : assert (!(g_calm && commit) || long_silent);
    i_hold : assert (!(g_calm && g_rtu_hold) || !long_silent || long_reached);
    i_early : assert (!((g_rtu_receive && strict_t15) || g_rtu_early) || (g_halves < 3'd3 && !long_silent) || short_reached);
    i_awaits : assert (!(g_awaits || candidate) || de || commit || revoke || start_seen || ((g_rtu_hold || g_rtu_early) &&
        (\rtu_rx_i.unit == 3'b011 || \rtu_rx_i.unit == 3'b101) && \rtu_rx_i.begun_bank != frame_bank));
  end
end

// ---- breaks
`ifdef BREAKS
reg [7:0] g_low = 8'd0;  // ticks since the vote on the start bit of what may be a break
wire [3:0] g_turn = g_phase - 4'd8;
wire [7:0] g_received = (g_uart[1] ? {1'b0, g_bits, 4'd0} : g_uart[3] && parity_enable ? 8'd144 : 8'd128) + {4'd0, g_turn};
always @(posedge clk)
  if (uart_start) g_low <= {7'd0, tick16};
  else if (tick16 && g_undecided) g_low <= g_low + 8'd1;
reg g_since = 1'b0;  // since the newest candidate there was no character, in the UART's view, but breaks
always @(posedge clk) begin
  g_since <= (candidate || g_since) && !g_byte && !rst;
end
wire g_rtu_ours = \rtu_rx_i.unit == 3'b011 || \rtu_rx_i.unit == 3'b101;
wire g_voted = g_uart[1] || g_uart[2] || g_uart[3];
wire g_first_bit = g_uart[1] && g_bits == 3'd0;
always @(posedge clk) begin
  if (g_past) begin
    // FRAME-3: only a character of zeros without a stop bit is a break.
    a_break : assert (!g_is_break || (rx_data == 8'd0 && rx_framing_error && rx_parity_error == (parity_enable && parity_odd)));
    // FRAME-3, FRAME-6: no commit after any other character, and none while the line may be in one.
    a_no_character : assert (!commit || ((candidate || g_since) && !g_undecided));
    a_undecided : assert (!g_undecided || (!silent && !quiet && !half_reached && !short_reached && !long_reached));
    // SAFE-3: a line that falls while all is dropped, and stays low, is silent within a character.
    a_break_comes : assert (!g_undecided || {8'd0, g_low} <= g_character);
    i_break_place : assert (!g_undecided || rx_valid || g_low == g_received);
    i_break_held : assert (\breaks_i.held == g_undecided);
    i_break_after : assert (\breaks_i.after_frame == g_follows);
    i_break_low : assert (\breaks_i.break_i.held == g_in_break && \breaks_i.break_i.opposite == !g_in_break);
    i_break_uart : assert (!g_in_break || (g_uart == 5'b10000 && !g_driving));
    i_voted : assert (!g_undecided || ((g_voted || rx_valid) && !g_driving));
    i_begins_low : assert (!uart_start || (!g_undecided && g_first_bit && g_phase == 4'd8 && !rx_valid && (g_driving || g_votes != 2'b11)));
    i_start_phase : assert (!(g_uart[0] && !g_driving) || g_phase <= 4'd7);
    i_limit_idle : assert (!(half_reached || short_reached || \silence_i.long_over ) ||
        (!rx_valid && !g_undecided && !uart_start && !g_driving && (g_uart == 5'd0 || g_uart == 5'b10000 || (g_uart[0] && g_phase == 4'd0))));
    i_in_place : assert (!g_rtu_receive || \rtu_rx_i.begun_bank == frame_bank);
    i_in_hold : assert (!g_rtu_hold || (\rtu_rx_i.begun_bank == frame_bank) == !g_rtu_ours);
    i_in_early : assert (!g_rtu_early || (g_rtu_ours && \rtu_rx_i.begun_bank != frame_bank));
    i_zero_votes : assert (!g_undecided || g_votes == 2'b00 || (g_first_bit && g_phase == 4'd8 && g_votes != 2'b11) ||
        (g_first_bit && g_phase == 4'd9 && !g_votes[0]));
    i_zero_bits : assert (!(g_undecided && g_uart[1]) || g_shift >> (4'd8 - {1'b0, g_bits}) == 8'd0);
    i_zero_shift : assert (!(g_undecided && !g_uart[1]) || g_shift == 8'd0);
    i_zero_parity : assert (!g_undecided || \uart_i.parity == parity_odd);
    i_zero_wrong : assert (!(g_undecided && (g_uart[3] || rx_valid)) || \uart_i.parity_wrong == (parity_enable && parity_odd));
    i_zero_stop : assert (!(g_undecided && rx_valid) || (\uart_i.stop_missing && g_uart == 5'b10000));
    i_zero_format : assert (!(g_undecided && g_uart[2]) || parity_enable);
    i_since : assert (!(g_rtu_hold || g_rtu_early) || !g_rtu_ours || \rtu_rx_i.begun_bank == frame_bank || g_since || candidate);
  end
end
`else
always @* assume (!break_tolerant);
always @(posedge clk)
  if (g_past) begin
    i_no_break : assert (!\breaks_i.held && !\breaks_i.after_frame && !\breaks_i.break_i.held && \breaks_i.break_i.opposite );
  end
`endif

// ---- helpers for induction
wire [12:0] g_half = half_end - 13'd17;
wire [12:0] g_over = g_halves * g_half - (half_uneven ? {10'd0, g_halves} >> 1 : 13'd0);
wire [12:0] g_first = 13'd18 + (half_uneven && g_halves[0]);
always @(posedge clk) begin
  if (g_past) begin
    i_limit : assert (!long_silent || g_silent >= 13'd7 * g_half - (half_uneven ? 13'd3 : 13'd0) + g_head);
    if (!long_silent) begin
      i_halves : assert (g_halves < 3'd7 && g_ticks <= half_end);
      i_first : assert (g_halves != 3'd0 || g_ticks + g_head == 13'd18 + g_silent);
      i_later : assert (g_halves == 3'd0 || (g_ticks + g_head + g_over == g_first + g_silent && g_ticks >= g_first));
      i_low : assert (g_halves != 3'd0 || g_ticks + g_head >= 13'd18);
    end
  end
end

// ---- sending
wire g_before = g_sender != G_IDLE && g_sender != G_DRAIN && !g_driving;  // the first start bit
wire g_waits = g_loaded && !(g_driving && g_uart[0]);  // a byte is taken and its start bit has not begun
wire [5:0] g_begun = g_taken - {5'd0, g_waits};
reg [15:0] g_place;  // ticks into the character
always @* begin
  g_place = (parity_enable ? 16'd160 : 16'd144) + g_phase;
  if (g_uart[0]) g_place = g_phase;
  if (g_uart[1]) g_place = 16'd16 + {9'd0, g_bits, 4'd0} + g_phase;
  if (g_uart[2]) g_place = 16'd144 + g_phase;
  if (g_uart[4]) g_place = 16'd160 + g_phase;
end
wire [2:0] g_states = {2'd0, g_uart[0]} + {2'd0, g_uart[1]} + {2'd0, g_uart[2]} + {2'd0, g_uart[3]} + {2'd0, g_uart[4]};
always @(posedge clk) begin
  if (g_past) begin
    i_states : assert (g_states <= 3'd1);
    i_sender : assert (g_sender <= G_DRAIN);
    i_idle : assert (g_sender != G_IDLE || (!de && !g_driving && !g_loaded && !tx_busy));
    i_fetch : assert (g_sender == G_IDLE || de || (g_start && g_sender == G_FETCH));
    i_start : assert (!g_start || (g_sender == G_FETCH && !de && !g_de && g_silent_start >= g_limit && g_taken == 6'd0 &&
        g_high == 16'd0 && g_lead == 4'd0 && !g_driving && !g_loaded && !tx_busy && g_index == 5'd0 &&
        (g_uart[4:1] == 4'd0 || g_break_start) && (g_phase <= 4'd1 || g_break_start) && g_unanswered == 2'd0));
    i_lead : assert (g_lead <= 4'd9 && (!de || (g_lead == 4'd9 && g_high >= 16'd9) || g_high == {12'd0, g_lead}));
    // Bytes that the UART took.
    i_fetched : assert (g_sender != G_FETCH || g_taken == {1'b0, g_index});
    i_send : assert (g_sender != G_SEND || (g_taken == {g_index == 5'd0, g_index} - 6'd1 && tx_ready));
    i_crc : assert ((g_sender != G_CRC_LOW || (g_taken <= 6'd32 && g_taken != 6'd0)) &&
        (g_sender != G_CRC_HIGH || (g_taken <= 6'd33 && g_taken > 6'd1)) &&
        (g_sender != G_DRAIN || (g_taken <= 6'd34 && g_taken > 6'd2)));
    // Before the first start bit a false start may be in progress, which the filter ends.
    i_first_byte : assert (!g_before || (g_taken <= 6'd1 && g_loaded == (g_taken == 6'd1)));
    i_none : assert (!(g_before && !g_loaded && de) || g_high <= (g_sender == G_SEND ? 16'd3 : {14'd0, g_unanswered}));
    i_waiting : assert (!g_before || g_break_start || (g_uart[4:1] == 4'd0 && g_high <= (g_uart[0] ? 16'd2 + g_phase : 16'd12)));
    i_line : assert (!(de && g_high > 16'd1) || line);
    i_votes : assert (!de || ((g_high < 16'd3 || g_votes[0]) && (g_high < 16'd4 || g_votes[1])));
    i_phase : assert (!(g_before && g_uart[0]) || (g_phase <= 4'd7 && g_phase <= g_high + 16'd2));
    // While characters leave.
    i_busy : assert (!(g_sender == G_CRC_HIGH) || g_driving);
    i_drain : assert (!(g_sender == G_DRAIN && g_driving) || tx_busy);
    i_begins : assert (!(g_driving && !tx_busy) || (g_taken == 6'd1 && g_uart[0] && g_phase == 4'd0));
    i_rest : assert (g_driving || tx || tx_busy);
    i_last : assert (g_sender != G_DRAIN || g_driving || (!g_loaded && g_uart == 5'd0));
    if (g_driving) begin
      i_driving : assert (g_sender != G_IDLE && g_begun != 6'd0 && g_begun <= g_taken && g_states == 3'd1 && g_lead == 4'd9 && (!g_uart[4] || two_stop) && (!g_uart[2] || parity_enable));
      i_time : assert (g_high <= ({10'd0, g_begun} - 16'd1) * g_character + g_place + 16'd14);
      i_loaded : assert (!(g_uart[1] && g_loaded) && !(g_uart[0] && g_loaded && g_phase > 4'd1));
      // The next byte is loaded before it is needed.
      i_in_time : assert (g_loaded || g_sender == G_DRAIN || g_place < 16'd160);
      i_ready : assert (!tx_ready || g_sender == G_DRAIN ||
          g_place <= 16'd144 + (g_sender == G_SEND ? 16'd3 : {14'd0, g_unanswered}));
    end
    i_over : assert (!(g_sender == G_DRAIN && !g_driving) ||
        g_high <= {10'd0, g_taken} * g_character + (tx_busy ? 16'd15 : 16'd16));
  end
end

// ---- covers: a start, DE, the first start bit
always @(posedge clk) c_leaves : cover (g_past && de && !tx && g_taken == 6'd1);
