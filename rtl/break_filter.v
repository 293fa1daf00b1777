// SPDX-License-Identifier: Apache-2.0
// Takes breaks after a good frame out of the characters: they count as silence (FRAME-3).
//
// A bus without bias falls low when nobody drives it. It then stays low from the end of a
// request to the reply. For the UART such a low is a character of zeros without a stop bit.
//
// A start bit is held back after a good frame or the card's own reply, as long as only silence and
// breaks have followed. It is also held back while the receiver drops everything up to the next
// t3.5. Such a start bit may begin a character or a break. The first high of the line decides for a
// character: its start bit is passed on then, late, and its byte at its end. If the line has been
// low up to the vote on the stop bit, it is a break: neither start bit nor byte is passed on.
// busy: level, a character or an undecided low is on the line; no silence is counted then. After
// the decision for a break the silence goes on, though the line is low. So each break costs one
// character of time, and no limit of silence is reached in a low that may become a character.
// in_break: level, the line is low and the low is a break. A reply may start then.
//
// line_start: the start bit as the UART sees it, in the clock of a start bit that is held back too.
// may_break: level, the frame up to the last character is good, or the receiver drops everything,
// as after the card's own reply and after a character without a stop bit. Otherwise a bus that is
// low most of the time would never be silent again. sending: level, DE.
// fault: the halves of in_break disagree. A flipped bit ends a break then, and never makes one
// (docs/hardening.md, Break filter, SAFE-4).
// Clock domain: clk. Rules: FRAME-3, FRAME-6, SAFE-2, SAFE-4.
`default_nettype none

module break_filter (
    input  wire clk,
    input  wire rst,
    // line activity
    input  wire line,
    input  wire receiving,
    input  wire line_start,
    input  wire line_byte,
    // frame
    input  wire may_break,
    input  wire sending,
    // status
    output wire start_seen,
    output wire byte_valid,
    output wire busy,
    output wire in_break,
    output wire fault
);

  reg  after_frame = 1'b0;  // since may_break there were only silence and breaks
  reg  held = 1'b0;  // a start bit is held back

  wire released = held && line && !line_byte;
  wire is_break = held && line_byte;

  assign start_seen = released || (line_start && (line || !after_frame));
  assign byte_valid = line_byte && !held;
  assign busy = receiving && !in_break;

  guarded_bit break_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (is_break || line),
      .data (is_break && !line),
      // status
      .value(in_break),
      .fault(fault)
  );

  always @(posedge clk) begin
    after_frame <= !start_seen && (after_frame || may_break);

    if (line || line_byte || sending) held <= 1'b0;
    else if (line_start && after_frame) held <= 1'b1;

    if (rst) begin
      after_frame <= 1'b0;
      held <= 1'b0;
    end
  end

endmodule

`default_nettype wire
