// SPDX-License-Identifier: Apache-2.0
// Half a character and both limits are reached after exactly their number of silent ticks, in whatever way the line falls silent. Neither
// is reached again before the next restart (FRAME-1, FC-8).
//
// The ghost counts silent ticks in one number, without the module's halves.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

// The settings of the ports: every rate and format of card_tables, or the drive's rate.
`ifdef DRIVE
always @* assume (half_end == 9'd106 && !half_uneven && !two_stop);
`else
always @* assume ((half_end == 9'd105 && !half_uneven) || (half_end == 9'd97 && !half_uneven) ||
                  (half_end == 9'd171 && half_uneven) || (half_end == 9'd478 && half_uneven));
`endif
always @(posedge clk) begin
  if (g_past) begin
    assume ($stable(half_end));
    assume ($stable(half_uneven));
    assume ($stable(two_stop));
  end
end

wire [12:0] g_half = half_end - START + 13'd1;
reg g_own = 1'b0;  // the last character was the card's own, which ends when sending falls
// Otherwise restart comes two ticks before the end of the filtered first stop bit.
wire [12:0] g_head = g_own ? 13'd0 : two_stop ? 13'd18 : 13'd2;
wire [12:0] g_short = SHORT_HALVES * g_half - (half_uneven ? SHORT_HALVES / 2 : 0);
wire [12:0] g_long = LONG_HALVES * g_half - (half_uneven ? LONG_HALVES / 2 : 0);

reg [12:0] g_silent = 13'd0;
wire g_end_half = tick16 && !busy && g_silent + 13'd1 == g_head + g_half;
wire g_end_short = tick16 && !busy && g_silent + 13'd1 == g_head + g_short;
wire g_end_long = tick16 && !busy && g_silent + 13'd1 == g_head + g_long;
reg g_was_half = 1'b0;
reg g_was_short = 1'b0;
reg g_was_long = 1'b0;
always @(posedge clk) begin
  g_was_half <= g_end_half;
  g_was_short <= g_end_short;
  g_was_long <= g_end_long;
  if (tick16 && !busy && g_silent != 13'h1FFF) g_silent <= g_silent + 13'd1;
  if (restart || sending || rst) begin
    g_silent <= 13'd0;
    g_was_half <= 1'b0;
    g_was_short <= 1'b0;
    g_was_long <= 1'b0;
    g_own <= sending;
  end
end

always @(posedge clk) begin
  if (g_past) begin
    a_half : assert (half_reached == g_was_half);
    a_short : assert (short_reached == g_was_short);
    a_long : assert (long_reached == g_was_long);
    a_silent : assert (long_silent == (g_silent >= g_head + g_long));
    a_order : assert (!long_reached || !short_reached || SHORT_HALVES == LONG_HALVES);
  end
end

// ---- helpers for induction
wire [12:0] g_over = halves * g_half - (half_uneven ? {10'd0, halves} >> 1 : 13'd0);
wire [12:0] g_first = START + (half_uneven && halves[0]);
always @(posedge clk) begin
  if (g_past && !long_silent) begin
    i_halves : assert (halves < LONG_HALVES);
    i_range : assert (ticks <= half_end);
    if (halves == 3'd0) i_first : assert (ticks + g_head == START + g_silent);
    else begin
      i_later : assert (ticks + g_head + g_over == g_first + g_silent);
      i_begun : assert (ticks >= g_first);
    end
  end
  if (g_past) begin
    i_own : assert (ticks >= START - 18);
  end
end

// ---- covers
always @(posedge clk) c_busy : cover (g_past && $past(restart) && halves == 3'd0 && !long_silent);
