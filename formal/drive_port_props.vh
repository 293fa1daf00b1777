// SPDX-License-Identifier: Apache-2.0
// DE of the drive line rises only for a telegram and only after two characters of silence. It falls after that
// telegram (SAFE-2, FC-8, FC-10). After a broadcast the receiver does not listen. Filter, UART, silence timer, sender
// and direction are proved as wired.
//
// LINE-5: pulses on an idle line put a telegram off by a bounded time. docs/guide/proofs.md, The whole way.
//
// Silent: the pin is high and no character is being received, counted in ticks since the end of the last character of
// either side. A low that is too short for a start bit stops the count and does not restart it.
//
// Assumed: a telegram starts on a quiet line only and keeps its length while it is sent (proved for mailbox); the
// memory answers within two clocks (bus_arbiter: within one). The length may have any value.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;

// Registers inside the instances, by their hierarchical names. They lose their power-up values that way, so the
// first clock is a reset.
(* hierconn *) wire [4:0] \uart_i.state ;
(* hierconn *) wire [3:0] \uart_i.phase ;
(* hierconn *) wire [2:0] \uart_i.bits_done ;
(* hierconn *) wire [1:0] \uart_i.votes ;
(* hierconn *) wire \uart_i.driving ;
(* hierconn *) wire \uart_i.loaded ;
(* hierconn *) wire [6:0] \silence_i.ticks ;
(* hierconn *) wire [2:0] \silence_i.halves ;
(* hierconn *) wire [2:0] \fc_tx_i.state ;
(* hierconn *) wire [4:0] \fc_tx_i.index ;
(* hierconn *) wire \fc_tx_i.begun ;
(* hierconn *) wire [3:0] \dir_i.lead ;
(* hierconn *) wire [7:0] \filter_i.history ;
wire [4:0] g_uart = \uart_i.state ;
wire [3:0] g_phase = \uart_i.phase ;
wire [2:0] g_bits = \uart_i.bits_done ;
wire [1:0] g_votes = \uart_i.votes ;
wire g_driving = \uart_i.driving ;
wire g_loaded = \uart_i.loaded ;
wire [6:0] g_ticks = \silence_i.ticks ;
wire [2:0] g_halves = \silence_i.halves ;
wire [2:0] g_sender = \fc_tx_i.state ;
wire [4:0] g_index = \fc_tx_i.index ;
wire g_sender_begun = \fc_tx_i.begun ;
wire [3:0] g_lead = \dir_i.lead ;
localparam [2:0] G_IDLE = 3'd0, G_STX = 3'd1, G_LGE = 3'd2, G_FETCH = 3'd3, G_SEND = 3'd4, G_DRAIN = 3'd5;
localparam [15:0] G_CHARACTER = 16'd176;  // ticks: 11 bits of 16
`ifdef QUIET_LINE
// The cover begins at rest, in the last tick of the pause, which is longer than its clocks.
initial assume (!rst && g_ticks == HALF_END[6:0] && g_halves == 3'd3 && g_uart == 5'd0 && !g_driving && !g_loaded);
initial assume (g_sender == G_IDLE && g_lead == 4'd0 && \filter_i.history == 8'hFF);
`else
initial assume (rst);
`endif

// ---- assumptions
reg g_sending = 1'b0;
reg [4:0] g_length = 5'd0;
reg [1:0] g_unanswered = 2'd0;
always @(posedge clk) begin
  g_sending <= sending;
  g_length <= telegram_length;
  g_unanswered <= read_valid && !read_ready && !rst ? g_unanswered + 2'd1 : 2'd0;
end
always @* begin
  assume (!telegram_start || (quiet && !sending));
  assume (!(g_past && sending) || telegram_length == g_length);
  assume (!read_valid || read_ready || g_unanswered < 2'd2);
`ifdef QUIET_LINE
  assume (tick16 && rx);  // the shortest way to a start, for the cover
`endif
end

// ---- silence on the pin
localparam [9:0] G_PAUSE = 10'd352;  // two characters of 11 bits (FC-8)
reg [9:0] g_silent = 10'd0;
reg g_own = 1'b0;  // the last character was the card's own
always @(posedge clk) begin
  if (tick16 && synced && !rx_busy && g_silent != 10'h3FF) g_silent <= g_silent + 10'd1;
  if (rx_valid || de || rst) begin
    g_silent <= 10'd0;
    g_own <= de;
  end
end

// ---- bytes passed to the UART
reg [5:0] g_given = 6'd0;
always @(posedge clk) begin
  if (tx_valid && tx_ready) g_given <= g_given + 6'd1;
  if (rst || !sending) g_given <= 6'd0;
end

// ---- time of DE
reg [15:0] g_high = 16'd0;  // ticks since DE rose
reg g_de = 1'b0;
reg g_rst = 1'b1;
reg g_start = 1'b0;
reg g_start_before = 1'b0;
reg [9:0] g_silent_start = 10'd0;  // silence when the telegram started
always @(posedge clk) begin
  g_de <= de;
  g_rst <= rst;
  g_start <= telegram_start && !rst;
  g_start_before <= g_start && !rst;
  if (telegram_start) g_silent_start <= g_silent;
  if (!de || rst) g_high <= 16'd0;
  else if (tick16) g_high <= g_high + 16'd1;
end

// ---- listening is allowed: a reply is due, or the firmware asked for one
reg g_asked = 1'b0;
always @(posedge clk) begin
  if (sending && !telegram_no_reply) g_asked <= 1'b1;
  if (telegram_start) g_asked <= 1'b0;
  if (listen_again) g_asked <= 1'b1;
end

wire [5:0] g_bytes = telegram_length == 5'd0 ? 6'd34 : {1'b0, telegram_length} + 6'd2;  // STX and LGE included

always @(posedge clk) begin
  if (g_past) begin
    // SAFE-2, FC-8: a quiet line is silent and has been for two characters, 22 bits after DE fell. After the vote on
    // a stop bit two more ticks pass, the rest of that bit.
    a_silent : assert (!quiet || (synced && g_silent >= G_PAUSE + (g_own ? 10'd0 : 10'd2)));
    // DE rises only two clocks after a start, and that start was in such a silence.
    a_rises : assert (!de || g_de || (g_start_before && g_silent_start >= G_PAUSE));
    // SAFE-2: DE is at most one bit longer than the telegram's characters, which are 34 at most.
    a_bounded : assert (!de || g_high <= {10'd0, g_bytes} * G_CHARACTER + 16'd16);
    a_longest : assert (!de || g_high <= 16'd6000);
    // DE covers all that is sent; without DE the pin idles.
    a_covers : assert (!tx_busy || de);
    a_at_rest : assert (de || tx);
    a_falls : assert (!g_de || de || !sending);
    // FC-10: the receiver is deaf to the telegram, and also after it if no reply is due and the firmware asks for none.
    a_deaf : assert (!de || !(rx_valid || start_seen));
    a_listens : assert (!listening || g_asked);
    a_not_quiet : assert (!sending || g_start || !quiet);
    // SAFE-1: bit 10 of the control word, whose upper byte is the fifth byte from the end, is 1 only in a telegram
    // that may command the drive.
    a_control : assert (!(tx_valid && tx_ready && g_given + 6'd3 == {1'b0, telegram_length} && g_given > 6'd1) ||
        telegram_control || !tx_data[2]);
    // SAFE-7: bit 6, the start, in the byte after it, is never 1 in the stop.
    a_stop : assert (!(tx_valid && tx_ready && g_given + 6'd2 == {1'b0, telegram_length} && g_given > 6'd1) ||
        !telegram_stop || !tx_data[6]);
    a_reset : assert (!g_rst || !(de || sending || quiet || listening || good || candidate));
  end
end

// ---- helpers for induction: silence
wire [12:0] g_head = g_own ? 13'd0 : 13'd2;
localparam [12:0] G_HALF = G_PAUSE / 4 + 1;
always @(posedge clk) begin
  if (g_past) begin
    i_limit : assert (!long_silent || g_silent >= 13'd4 * G_HALF + g_head);
    i_halves : assert (long_silent || g_halves < 3'd4);
    i_first : assert (long_silent || g_halves != 3'd0 || g_ticks + g_head == 13'd18 + g_silent);
    i_later : assert (long_silent || g_halves == 3'd0 || g_ticks + g_head + G_HALF * g_halves == 13'd18 + g_silent);
    i_range : assert (long_silent || (g_ticks <= 13'd17 + G_HALF && g_ticks >= 7'd16));
  end
end

// ---- sending
wire g_waits = g_loaded && !(g_driving && g_uart[0]);  // a byte is taken and its start bit has not begun
reg [5:0] g_taken;  // bytes that the UART took
always @* begin
  case (g_sender)
    G_STX: g_taken = 6'd0;
    G_LGE: g_taken = 6'd1;
    G_FETCH: g_taken = {1'b0, g_index} + 6'd2;
    G_SEND: g_taken = {1'b0, g_index - 5'd1} + 6'd2;
    default: g_taken = g_bytes;
  endcase
end
always @(posedge clk) begin
  if (g_past) begin
    i_begun : assert (g_sender == G_IDLE || g_sender_begun);
    i_given : assert (g_sender == G_IDLE || g_sender == G_DRAIN || g_given == g_taken);
  end
end
wire [5:0] g_begun = g_taken - {5'd0, g_waits};
reg [15:0] g_place;  // ticks into the character
always @* begin
  g_place = 16'd160 + g_phase;
  if (g_uart[0]) g_place = g_phase;
  if (g_uart[1]) g_place = 16'd16 + {9'd0, g_bits, 4'd0} + g_phase;
  if (g_uart[2]) g_place = 16'd144 + g_phase;
end
wire [2:0] g_states = {2'd0, g_uart[0]} + {2'd0, g_uart[1]} + {2'd0, g_uart[2]} + {2'd0, g_uart[3]} + {2'd0, g_uart[4]};
always @(posedge clk) begin
  if (g_past) begin
    i_sender : assert (g_sender <= G_DRAIN);
    i_states : assert (g_states <= 3'd1);
    i_idle : assert (g_sender != G_IDLE || (!de && !g_driving && !g_loaded && !tx_busy));
    i_stx : assert (g_sender != G_STX || (g_start && !de && !g_de && g_high == 16'd0 && g_lead == 4'd0 && !g_driving && !g_loaded && !tx_busy));
    i_de : assert (g_sender == G_IDLE || g_sender == G_STX || de);
    i_lead : assert (g_lead <= 4'd4 && (!de || (g_lead == 4'd4 && g_high >= 16'd4) || g_high == {12'd0, g_lead}));
    i_lge : assert (g_sender != G_LGE || g_driving || g_loaded);
    i_fetch : assert (g_sender != G_FETCH || telegram_length == 5'd0 || g_index < telegram_length);
    i_index : assert (g_sender != G_LGE || g_index == 5'd0);
    i_send : assert (g_sender != G_SEND || (tx_ready && (telegram_length == 5'd0 || (g_index != 5'd0 && g_index <= telegram_length))));
    i_before : assert (!(de && !g_driving) || g_sender == G_LGE || g_sender == G_DRAIN);
    i_busy : assert (!(g_sender > G_LGE && g_sender != G_DRAIN) || (g_driving && tx_busy));
    i_drain : assert (!(g_sender == G_DRAIN && g_driving) || tx_busy);
    i_begins : assert (!(g_driving && !tx_busy) || (g_sender == G_LGE && g_uart[0] && g_phase == 4'd0));
    i_rest : assert (g_driving || tx || tx_busy);
    i_last : assert (g_sender != G_DRAIN || g_driving || (!g_loaded && g_uart == 5'd0));
    if (g_driving) begin
      i_driving : assert (g_sender >= G_LGE && g_begun != 6'd0 && g_states == 3'd1 && !g_uart[4] && g_lead == 4'd4);
      i_time : assert (g_high <= ({10'd0, g_begun} - 16'd1) * G_CHARACTER + g_place + 16'd12);
      i_loaded : assert (!(g_uart[1] && g_loaded) && !(g_uart[0] && g_loaded && g_phase > 4'd1));
      // The next byte is loaded before it is needed.
      i_in_time : assert (g_loaded || g_sender == G_DRAIN || g_place < 16'd160);
      i_ready : assert (!tx_ready || g_sender == G_DRAIN ||
          g_place <= 16'd144 + (g_sender == G_SEND ? 16'd3 : {14'd0, g_unanswered}));
    end
    i_over : assert (!(g_sender == G_DRAIN && !g_driving) || g_high <= {10'd0, g_bytes} * G_CHARACTER + (tx_busy ? 16'd13 : 16'd14));
    // Before the first start bit a false start may be in progress, which the filter ends.
    i_waiting : assert (!(g_sender == G_LGE && !g_driving) || (g_uart[4:1] == 4'd0 && g_high <= (g_uart[0] ? 16'd2 + g_phase : 16'd10)));
    i_line : assert (!(de && g_high > 16'd1) || line);
    i_votes : assert (!de || ((g_high < 16'd3 || g_votes[0]) && (g_high < 16'd4 || g_votes[1])));
    i_start : assert (!(g_start || g_start_before) || g_silent_start >= G_PAUSE);
    i_started : assert (!g_start || (g_uart[4:1] == 4'd0 && g_phase <= 4'd1));
    i_phase : assert (!(g_sender == G_LGE && !g_driving && g_uart[0]) || (g_phase <= 4'd7 && g_phase <= g_high + 16'd2));
  end
end

// ---- pulses on an idle line (LINE-5)
// Calm, as in network_port_props.vh: since a character with a good stop bit, or since DE fell, the last nine samples of
// the pin have always been those of a high line with pulses below a quarter bit that are at least 5/16 bit apart.
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
reg [9:0] g_highs = 10'd0;  // ticks since then with the pin high
reg [9:0] g_lows = 10'd0;
wire g_fell = g_de && !de;
always @(posedge clk) begin
  g_samples <= rst || de ? 9'h1FF : g_samples_next;
  if (tick16 && g_calm) begin
    if (synced) g_highs <= g_highs + 10'd1;
    else g_lows <= g_lows + 10'd1;
  end
  if (g_fell) {g_highs, g_lows} <= {9'd0, tick16 && synced, 9'd0, tick16 && !synced};
  if (!g_pulses(g_samples_next) || telegram_start || sending || de) g_calm <= 1'b0;
  else if (rx_valid) g_calm <= !rx_framing_error && g_pulses(g_samples);
  else if (g_fell) g_calm <= 1'b1;
  if (rx_valid) {g_highs, g_lows} <= 20'd0;
  if (rst || g_highs[9] || g_lows[9]) g_calm <= 1'b0;
end

// The samples end with so many lows, or so many highs up to five.
wire [3:0] g_run = g_samples[0] ? 4'd0 : g_samples[1] ? 4'd1 : g_samples[2] ? 4'd2 : g_samples[3] ? 4'd3 : 4'd4;
wire [3:0] g_gap = !g_samples[0] ? 4'd0 : !g_samples[1] ? 4'd1 : !g_samples[2] ? 4'd2 : !g_samples[3] ? 4'd3 :
    !g_samples[4] ? 4'd4 : 4'd5;
wire [15:0] g_lows_5 = {6'd0, g_lows} * 16'd5;
wire [15:0] g_highs_4 = {6'd0, g_highs} * 16'd4;
wire [15:0] g_ticks_5 = ({6'd0, g_highs} + {6'd0, g_lows}) * 16'd5;
wire [15:0] g_most_5 = ({6'd0, G_PAUSE} + 16'd4 + {3'd0, g_head}) * 16'd9 + 16'd20;
wire [3:0] g_ones = {3'd0, g_samples[0]} + {3'd0, g_samples[1]} + {3'd0, g_samples[2]} + {3'd0, g_samples[3]} +
    {3'd0, g_samples[4]} + {3'd0, g_samples[5]} + {3'd0, g_samples[6]} + {3'd0, g_samples[7]} + {3'd0, g_samples[8]};
always @(posedge clk) begin
  if (g_past && g_calm) begin
    // No pulse begins a character, ends the pause, or keeps the port from being quiet once its pin is high.
    a_calm : assert (line && !rx_busy && !rx_valid && !start_seen);
    a_calm_quiet : assert (!long_silent || quiet == synced);
    // The pause is over after at most 9/5 of its ticks and four more.
    a_calm_bound : assert (long_silent || g_ticks_5 <= g_most_5);
    i_calm_state : assert (g_uart == 5'd0 && !g_driving && !sending && g_pulses(g_samples));
    i_calm_highs : assert (long_silent || g_silent == g_highs);
    i_calm_lows : assert (g_lows_5 <= g_highs_4 + (g_run != 4'd0 ? {12'd0, g_run} * 16'd5 : 16'd20 - {12'd0, g_gap} * 16'd4));
  end
  if (g_past) begin
    i_history : assert (\filter_i.history == g_samples[7:0]);
    i_clean : assert (line == (g_ones >= 4'd5));
    i_valid : assert (!rx_valid || rx_framing_error || (g_uart == 5'd0 && !g_driving));
    // The port is idle when DE falls, so the line is calm from then on, too.
    a_calm_after : assert (!g_fell || g_rst || (g_uart == 5'd0 && !g_driving && !sending && !rx_valid));
  end
end

// ---- covers: a start, DE, the first start bit
always @(posedge clk) c_leaves : cover (g_past && de && !tx && g_taken == 6'd1);
