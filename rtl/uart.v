// SPDX-License-Identifier: Apache-2.0
// Receives and sends the characters of a half-duplex line: start bit, 8 data bits LSB first, parity
// or none, stop bits. One direction at a time, with one state, shift register and parity for both;
// the receiver ignores the line while the UART sends (driving).
//
//   state    receiving                           sending
//   idle     until a tick sees the line low      until a byte is loaded and line_ready
//   START    vote high: idle, it was noise       one bit
//   DATA     eight votes                         eight bits, of send_data or with send_check check_bit
//   PARITY   one vote, if parity_enable          one bit, if parity_enable
//   STOP     byte_valid; vote low: REST          one bit; a loaded byte follows without a gap (FC-8)
//   REST     a break, until the line rises       the second stop bit, if two_stop
//
// A received bit ends at its vote, the majority of the samples 6, 7 and 8 ticks after the first low
// tick of its start bit. That tick comes up to one tick late, so on average the samples are in the
// middle, with equal margin on both sides at +-4 %. A sent bit lasts exactly 16 ticks.
// Only the first stop bit is checked: 8N2, 8N1 and a sender without a second one are received alike.
//
// byte_valid: one clock, half a bit before the end of the stop bit. byte_framing_error: that bit was
// missing. byte_parity_error is also set if the stored byte does not match the parity of its bits,
// without a parity bit, too. receiving: level, to byte_valid or the end of the break. start_seen: one
// clock, a start bit passed its vote; never of a sent character, because the port holds the line high.
// send_ready: no byte waits, and the data bits of the last one are out. sending: level, from the first
// start bit to the end of the last stop bit on the pin. bit_valid, bit_data: each data bit of either
// direction, for the check unit. parity_enable and two_stop are never both set.
// Units: tick16 = 1/16 bit. Clock domain: clk. Rules: LINE-1, LINE-3 ... LINE-5, FC-1, SAFE-4.
`default_nettype none

module uart (
    input  wire       clk,
    input  wire       rst,
    input  wire       tick16,
    // pins, the input filtered
    input  wire       line,
    output reg        txd,
    // stream in
    input  wire       send_valid,
    output wire       send_ready,
    input  wire [7:0] send_data,
    input  wire       send_check,
    // stream out
    output reg        byte_valid,
    output wire [7:0] byte_data,
    output wire       byte_parity_error,
    output wire       byte_framing_error,
    // check
    output wire       bit_valid,
    output wire       bit_data,
    input  wire       check_bit,
    // direction
    input  wire       line_ready,
    // configuration
    input  wire       parity_enable,
    input  wire       parity_odd,
    input  wire       two_stop,
    // status
    output wire       receiving,
    output reg        sending,
    output reg        start_seen
);

  // One-hot, because each state is tested in many places; idle is 0.
  localparam S_START = 0;
  localparam S_DATA = 1;
  localparam S_PARITY = 2;
  localparam S_STOP = 3;
  localparam S_REST = 4;

  reg [4:0] state = 5'd0;
  reg [3:0] phase = 4'd0;  // ticks since the bit began
  reg [2:0] bits_done = 3'd0;
  reg [1:0] votes = 2'd0;  // the last two samples
  reg [7:0] shift = 8'd0;
  reg driving = 1'b0;  // a character is being sent; the pin follows one clock later
  reg loaded = 1'b0;  // shift holds a byte whose start bit has not begun
  reg parity = 1'b0;  // of parity_odd and the data bits so far
  reg parity_wrong = 1'b0;
  reg stop_missing = 1'b0;

  wire idle = state == 5'd0;
  wire vote = (votes[0] & votes[1]) | (line & (votes[0] | votes[1]));
  wire load = send_valid && send_ready;
  wire go = loaded && line_ready;
  // A received bit ends at its vote in the middle, a sent bit at its end.
  wire bit_over = phase == {driving, 3'd7};
  // Driving while idle ends the character. docs/hardening.md, Undefined states (SAFE-4)
  wire step = idle ? go || !line || driving : state[S_REST] && !driving ? line : bit_over;
  wire leave = tick16 && step;
  wire last_bit = state[S_DATA] && bits_done == 3'd7;
  wire no_start = vote && !driving;
  wire stop_over = driving ? !two_stop : vote;
  wire over = state[S_REST] || (state[S_STOP] && stop_over);

  assign send_ready = !loaded && !(driving && (state[S_START] || state[S_DATA]));
  assign byte_data = shift;
  // docs/hardening.md, Received byte parity (SAFE-4)
  assign byte_parity_error = parity_wrong || ^{shift, parity_odd} != parity;
  assign byte_framing_error = stop_missing;
  assign bit_valid = leave && state[S_DATA];
  assign bit_data = !driving ? vote : send_check ? check_bit : shift[0];
  assign receiving = !idle && !driving;

  initial begin
    txd = 1'b1;
    byte_valid = 1'b0;
    sending = 1'b0;
    start_seen = 1'b0;
  end

  always @(posedge clk) begin
    byte_valid <= leave && state[S_STOP] && !driving;
    // Neither driving nor phase[3] counts: a bit that flips in one of them must not hide a start
    // bit. The line is high while this port sends. docs/hardening.md, Revoke twice (SAFE-4)
    start_seen <= tick16 && state[S_START] && phase[2:0] == 3'd7 && !vote;

    if (tick16) votes <= {votes[0], line};
    if (idle) phase <= 4'd0;
    else if (tick16) phase <= phase + 4'd1;
    if (state[S_START]) bits_done <= 3'd0;
    else if (bit_valid) bits_done <= bits_done + 3'd1;

    if (leave) begin
      state[S_START]  <= idle || (over && go);
      state[S_DATA]   <= (state[S_START] && !no_start) || (state[S_DATA] && !last_bit);
      state[S_PARITY] <= last_bit && parity_enable;
      state[S_STOP]   <= (last_bit && !parity_enable) || state[S_PARITY];
      state[S_REST]   <= state[S_STOP] && !stop_over;
      if (idle || over) driving <= go;
      if (state[S_START]) parity <= parity_odd;
      else if (state[S_DATA]) parity <= parity ^ bit_data;
      parity_wrong <= state[S_PARITY] ? parity != vote : parity_wrong && state[S_STOP];
      stop_missing <= !vote;
    end

    if (load) shift <= send_data;
    else if (bit_valid) shift <= {vote, shift[7:1]};
    if (load) loaded <= 1'b1;
    else if (driving && state[S_START]) loaded <= 1'b0;

    sending <= driving;
    txd <= !driving || (state[S_DATA] ? bit_data : state[S_PARITY] ? parity : !state[S_START]);

    if (rst) begin
      state <= 5'd0;
      txd <= 1'b1;
      byte_valid <= 1'b0;
      loaded <= 1'b0;
      driving <= 1'b0;
      sending <= 1'b0;
      start_seen <= 1'b0;
    end
  end

endmodule

`default_nettype wire
