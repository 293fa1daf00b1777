// SPDX-License-Identifier: Apache-2.0
// DE of the network line rises for a reply only, on a line that was silent for 3.5 characters, at every rate and
// in every format, and falls with the reply (SAFE-2, FRAME-1, FRAME-8, LINE-6). Filter, UART, silence timer, sender
// and direction, wired.
//
// Silent: the pin high and no character being received, counted in ticks since the end of the last character,
// whoever sent it. A low that is too short for a start bit stops the count and does not start it anew.
//
// Assumed: a reply starts on a quiet line only (mailbox: proved there). Switches do not move.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

// Registers inside the instances, by their hierarchical names. Such a name loses its power-up value, so the
// first clock is a reset.
(* hierconn *) wire [8:0] \silence_i.ticks ;
(* hierconn *) wire [2:0] \silence_i.halves ;
(* hierconn *) wire [2:0] \rtu_tx_i.state ;
wire [8:0] g_ticks = \silence_i.ticks ;
wire [2:0] g_halves = \silence_i.halves ;
wire [2:0] g_sender = \rtu_tx_i.state ;

// The rates and formats of card_tables.
always @* begin
  assume ((half_end == 9'd105 && !half_uneven) || (half_end == 9'd171 && half_uneven) ||
          (half_end == 9'd478 && half_uneven));
  assume (!(parity_enable && two_stop));
  assume (!reply_start || (quiet && !sending));
end
always @(posedge clk) begin
  if (g_past) begin
    assume ($stable(half_end));
    assume ($stable(half_uneven));
    assume ($stable(two_stop));
    assume ($stable(parity_enable));
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
reg [12:0] g_silent_start = 13'd0;  // as the reply started
always @(posedge clk) begin
  if (tick16 && synced && !rx_busy && g_silent != 13'h1FFF) g_silent <= g_silent + 13'd1;
  if (rx_valid || de || rst) begin
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

// Ticks of 3.5 characters: of 11 bits, from 38400 on 1750 us (FRAME-1). After the vote on a stop bit the rest of it
// comes on top, two ticks, and the second stop bit.
wire [12:0] g_limit = half_end == 9'd105 ? 13'd616 : half_end == 9'd171 ? 13'd1075 : 13'd3224;
wire [12:0] g_head = g_own ? 13'd0 : two_stop ? 13'd18 : 13'd2;
always @(posedge clk) begin
  if (g_past) begin
    // SAFE-2: a quiet line has been silent for 3.5 characters.
    a_silent : assert (!quiet || g_silent >= g_limit + g_head);
    // DE rises two clocks after a start, for nothing else, and that start fell into such a silence.
    a_rises : assert (!de || g_de || (g_start_before && g_silent_start >= g_limit));
    // It falls with the reply, and the receiver is deaf to it (LINE-6).
    a_falls : assert (!g_de || de || !sending);
    a_held : assert (!g_sending || !sending || g_start || de || g_rst);
    a_ends : assert (!de || sending);
    a_not_quiet : assert (!(de || rx_busy || rx_valid) || !quiet);
    a_reset : assert (!g_rst || !(de || sending || quiet || candidate || commit || revoke));
  end
end

// ---- what induction needs to know
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
    i_sender : assert (g_sender <= 3'd5);
    i_idle : assert (g_sender != 3'd0 || !de);
    i_fetch : assert (g_sender == 3'd0 || de || (g_start && g_sender == 3'd1));
    i_start : assert (!g_start || (g_sender == 3'd1 && !de && !g_de && g_silent_start >= g_limit));
  end
end
