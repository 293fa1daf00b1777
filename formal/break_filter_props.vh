// SPDX-License-Identifier: Apache-2.0
// Only a low without any high from its start bit to its stop bit is taken out. It is taken out only as long as nothing
// but breaks has followed a good frame or a reply. Every other character passes, with one start bit (FRAME-3, FRAME-6).
//
// The ghosts follow the characters of the UART and the level of the line.
//
// Assumed of the neighbours: the UART is receiving from before its start bit to the end of the character, a start bit
// and a byte alternate, DE is low meanwhile. After a missing stop bit it waits for the line to rise, and the vote on the
// next start bit comes clocks later. No flipped bit is modelled.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

(* hierconn *) wire \break_i.held ;
(* hierconn *) wire \break_i.opposite ;

reg g_character = 1'b0;  // from the UART's start bit to its byte
always @(posedge clk) begin
  if (line_start) g_character <= 1'b1;
  else if (line_byte) g_character <= 1'b0;
  if (rst) g_character <= 1'b0;
end
always @* begin
  assume (!(line_start && (g_character || line_byte)));
  assume (!line_byte || g_character);
  assume (!(line_start || g_character) || (receiving && !sending));
end

// ---- the rule
reg g_follows = 1'b0;  // since a break was allowed no character began that is no break
reg g_follower = 1'b0;  // so it was when the present character began
reg g_zero = 1'b0;  // since that start bit the line was low in every clock
reg g_passed = 1'b0;  // the present character's start bit was passed on
wire g_is_break = line_byte && g_follower && g_zero;
always @(posedge clk) begin
  if (start_seen) g_follows <= 1'b0;
  else if (may_break) g_follows <= 1'b1;
  if (line_start) {g_follower, g_zero, g_passed} <= {g_follows, !line, start_seen};
  else begin
    if (line && !line_byte) g_zero <= 1'b0;
    if (start_seen) g_passed <= 1'b1;
  end
  if (rst) {g_follows, g_follower, g_zero, g_passed} <= 4'd0;
end

reg g_low = 1'b0;  // the low that a break has left, up to the first high
always @(posedge clk) begin
  if (line || rst) g_low <= 1'b0;
  else if (g_is_break) g_low <= 1'b1;
end

always @* assume (!(line_start && g_low));

always @(posedge clk) begin
  if (g_past) begin
    // FRAME-3: a break passes nothing; every other byte passes in its clock, with its start bit before it.
    a_byte : assert (byte_valid == (line_byte && !g_is_break));
    a_begun : assert (!byte_valid || g_passed);
    a_no_begin : assert (!g_is_break || !g_passed);
    // FRAME-6: the start bit passes with the first high at the latest; without a good frame before it at once.
    a_once : assert (!start_seen || line_start || (g_character && !g_passed));
    a_at_once : assert (!line_start || g_follows || start_seen);
    a_first_high : assert (!(g_character && !line_byte && line) || start_seen || g_passed);
    // No silence is counted while a character is on the line, nor while it may be one.
    a_busy : assert (!(g_character || line_start) || busy);
    a_receiving : assert (busy == (receiving && !in_break));
    // Only the low after a break lets the silence go on.
    a_break : assert (in_break == g_low);
    a_no_fault : assert (!fault);
  end
end

// ---- helpers for induction
always @(posedge clk) begin
  if (g_past) begin
    i_halves : assert (\break_i.opposite == !\break_i.held );
    i_held : assert (held == (g_character && !g_passed));
    i_after : assert (after_frame == g_follows);
    i_zero : assert (!held || (g_zero && g_follower));
    i_passed : assert (!(g_character && g_passed) || !(g_zero && g_follower));
    i_low : assert (!(g_low && g_character));
  end
end

// ---- covers
always @(posedge clk) begin
  if (g_past && !rst) begin
    c_break : cover (in_break && !line);
    c_second : cover (g_is_break && g_follows && $past(may_break, 4) && !$past(may_break));
    c_late : cover (start_seen && !line_start);
    c_passed : cover (byte_valid && g_follower);
  end
end
