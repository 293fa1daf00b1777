// SPDX-License-Identifier: Apache-2.0
// The newest request, from candidate to answer (FRAME-6).
//
//   NONE        no request, or its candidate was revoked
//   CANDIDATE   a good frame that may go on; a commit needs this state and a silent line
//   ANSWERABLE  committed; its reply may leave
//   HEARD       committed, but a character began before its reply, which never leaves then (FRAME-7)
//   ANSWERED    committed, and its reply has left
//
// Each candidate gets the next ticket, modulo 16. It ends with a revoke, with the start bit of any
// character, and with a commit on a line that is not silent (withdrawn). is_committed is a guarded
// bit, since licences depend on it. rst ends the request but leaves the ticket, which the firmware
// reads after its start. fault: a half of that bit or a bit of the ticket is flipped, for with
// another ticket the firmware would serve the request twice. commits and withdrawn are strobes. Clock domain: clk.
`default_nettype none

module request_state (
    input  wire       clk,
    input  wire       rst,
    // network request
    input  wire       candidate,
    input  wire       commit,
    input  wire       revoke,
    input  wire       start_seen,
    input  wire       silent,
    // departures
    input  wire       reply_left,
    // status
    output reg  [3:0] ticket,
    output wire       is_candidate,
    output wire       is_committed,
    output wire       answerable,
    output wire       unanswered,
    output wire       commits,
    output wire       withdrawn,
    output wire       fault
);

  localparam [2:0] S_NONE = 3'd0;
  localparam [2:0] S_CANDIDATE = 3'd1;
  localparam [2:0] S_ANSWERABLE = 3'd2;
  localparam [2:0] S_HEARD = 3'd3;
  localparam [2:0] S_ANSWERED = 3'd4;

  reg [2:0] state = S_NONE;
  reg ticket_is_odd = 1'b0;

  wire committed_fault;
  wire [3:0] next_ticket = ticket + 4'd1;

  assign is_candidate = state == S_CANDIDATE;
  assign answerable = is_committed && state == S_ANSWERABLE;
  assign unanswered = is_committed && (state == S_ANSWERABLE || state == S_HEARD);
  assign commits = commit && silent && is_candidate;
  assign fault = committed_fault || ^ticket != ticket_is_odd;
  assign withdrawn = is_candidate && (revoke || start_seen || (commit && !silent));

  initial ticket = 4'd0;

  guarded_bit committed_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (candidate || commits),
      .data (commits),
      // status
      .value(is_committed),
      .fault(committed_fault)
  );

  always @(posedge clk) begin
    if (candidate) ticket <= next_ticket;
    if (rst) ticket_is_odd <= ^ticket;
    if (candidate) ticket_is_odd <= ^next_ticket;
    case (state)
      S_CANDIDATE:
      if (commits) state <= S_ANSWERABLE;
      else if (withdrawn) state <= S_NONE;
      S_ANSWERABLE:
      if (reply_left) state <= S_ANSWERED;
      else if (start_seen) state <= S_HEARD;
      S_HEARD, S_ANSWERED: state <= state;
      default: state <= S_NONE;
    endcase
    if (candidate) state <= S_CANDIDATE;
    if (rst) state <= S_NONE;
  end

endmodule

`default_nettype wire
