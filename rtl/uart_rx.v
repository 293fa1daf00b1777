// SPDX-License-Identifier: Apache-2.0
// Receives one character: start, 8 data bits LSB first, parity or none, stop.
//
// The line is sampled 16 times a bit. Three samples around the middle of each bit
// are put to the vote; the start bit is voted on too and forgotten if it fails.
// Only the first stop bit is looked at, so 8N2, 8N1 and a sender that leaves out
// its second stop bit are all the same here. The samples stand at ticks 6, 7 and
// 8 after the first low tick: the first low tick comes up to one tick late, so
// this is the middle on average and leaves the same room on both sides at +-4 %.
//
// byte_valid: one clock, at the vote on the first stop bit (half a bit before its
// end), with data and errors of that same character. A missing stop bit is a
// framing error; after it the receiver waits for the line to rise (break).
// busy: from the first low tick to byte_valid, or to the end of the break.
// start_seen: one clock, when the start bit passed its vote.
// Units: tick16 = 1/16 bit. Clock domain: clk. Rules: LINE-1, LINE-5.
`default_nettype none

module uart_rx (
    input  wire       clk,
    input  wire       rst,
    input  wire       tick16,
    // pin, filtered
    input  wire       line,
    // stream out
    output reg        byte_valid,
    output wire [7:0] byte_data,
    output wire       byte_parity_error,
    output wire       byte_framing_error,
    // configuration
    input  wire       parity_enable,
    input  wire       parity_odd,
    // status
    output wire       busy,
    output reg        start_seen
);

  localparam [2:0] S_IDLE = 3'd0;  // line high, or low since less than a tick
  localparam [2:0] S_START = 3'd1;  // a start bit, to be confirmed
  localparam [2:0] S_DATA = 3'd2;  // eight data bits
  localparam [2:0] S_PARITY = 3'd3;  // the parity bit, if there is one
  localparam [2:0] S_STOP = 3'd4;  // the first stop bit
  localparam [2:0] S_BREAK = 3'd5;  // no stop bit came: wait for the line to rise

  reg [2:0] state = S_IDLE;
  reg [3:0] phase = 4'd0;  // ticks since the bit began
  reg [2:0] bits_done = 3'd0;
  reg [1:0] votes = 2'd0;  // samples 6 and 7
  reg [7:0] shift = 8'd0;
  reg parity = 1'b0;  // over data, parity bit and parity_odd: 0 = right
  reg stop_missing = 1'b0;

  wire vote = (votes[0] & votes[1]) | (line & (votes[0] | votes[1]));
  wire decide = tick16 && phase == 4'd8;

  assign byte_data = shift;
  assign byte_parity_error = parity_enable && parity;
  assign byte_framing_error = stop_missing;
  assign busy = state != S_IDLE;

  always @(posedge clk) begin
    byte_valid <= 1'b0;
    start_seen <= 1'b0;
    if (tick16) begin
      phase <= phase + 4'd1;
      votes <= {votes[0], line};
    end
    case (state)
      S_IDLE: begin
        // The first low tick is tick 0 of the start bit.
        if (tick16) phase <= 4'd1;
        if (tick16 && !line) state <= S_START;
      end
      S_START:
      if (decide) begin
        state <= vote ? S_IDLE : S_DATA;
        start_seen <= !vote;
        bits_done <= 3'd0;
        parity <= parity_odd;
      end
      S_DATA:
      if (decide) begin
        shift <= {vote, shift[7:1]};
        parity <= parity ^ vote;
        bits_done <= bits_done + 3'd1;
        if (bits_done == 3'd7) state <= parity_enable ? S_PARITY : S_STOP;
      end
      S_PARITY:
      if (decide) begin
        parity <= parity ^ vote;
        state  <= S_STOP;
      end
      S_STOP:
      if (decide) begin
        byte_valid <= 1'b1;
        stop_missing <= !vote;
        state <= vote ? S_IDLE : S_BREAK;
      end
      default: if (tick16 && line) state <= S_IDLE;
    endcase
    if (rst) begin
      state <= S_IDLE;
      byte_valid <= 1'b0;
      start_seen <= 1'b0;
    end
  end

`ifndef SYNTHESIS
  reg [7:0] last_byte = 8'd0;
  always @(posedge clk) if (byte_valid) last_byte <= byte_data;

  reg [8*6-1:0] state_name;
  always @* begin
    case (state)
      S_IDLE:   state_name = "IDLE";
      S_START:  state_name = "START";
      S_DATA:   state_name = "DATA";
      S_PARITY: state_name = "PARITY";
      S_STOP:   state_name = "STOP";
      default:  state_name = "BREAK";
    endcase
  end
`endif

endmodule

`default_nettype wire
