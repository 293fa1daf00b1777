// SPDX-License-Identifier: Apache-2.0
// The fate of the newest request: candidate, then committed or revoked, then spent.
//
// A candidate gets the next ticket, modulo 16. It ends with a revoke, or with the start
// bit of any character, whatever rtu_rx makes of it (FRAME-6). A commit needs a candidate
// and a silent line (docs/hardening.md, Commit needs a candidate). Candidate and commit come
// in one clock with PREPARE_EARLY = 0. A commit on a line that is not silent withdraws the
// candidate, which would otherwise wait for ever. Only a flipped bit or a low of more than a
// quarter bit causes such a commit. A committed request stays committed until the next
// candidate. The firmware reads is_committed, too, so it is a guarded bit (SAFE-4).
// answerable: committed, and since then no character has begun and no reply has left.
// spent: the request licenses no further telegram. Its reply spends it, so does its write
// of coils when that leaves, and for a broadcast the firmware's answer, which sends nothing.
// takes_reply, takes_telegram, licenses: rights of an order with queue_ticket. An order
// with the ticket of an older request has none. A broadcast takes no reply (MAP-9).
// keep: the firmware orders that the request's licence moves to its place. The licence moves
// with the commit, or at once if the request is committed (kept). That spends a write of coils;
// its reply may still leave (FRAME-7). Another write is not spent: it may need a second telegram
// while it is the newest request (MAP-8). keep for a candidate is remembered until the candidate
// ends. keep has no effect while the request licenses the telegram in telegram_slot (used).
// rst ends the request but leaves the ticket, which the firmware reads after its start.
// fault: a half of a guarded bit has flipped (docs/hardening.md, Faults of guarded bits).
// commits, withdrawn, kept, reply_left, command_left: strobes.
// Clock domain: clk. Rules: FRAME-6, FRAME-7, MAP-9, FC-9, SAFE-4.
`default_nettype none

module request_fate (
    input  wire       clk,
    input  wire       rst,
    // network request
    input  wire       candidate,
    input  wire       commit,
    input  wire       revoke,
    input  wire       broadcast,
    input  wire       writes_coils,
    input  wire       start_seen,
    input  wire       silent,
    // firmware
    input  wire       queue_reply,
    input  wire       keep,
    input  wire [3:0] queue_ticket,
    // departures
    input  wire       used,
    input  wire       reply_left,
    input  wire       command_left,
    // status
    output reg  [3:0] ticket,
    output reg        is_candidate,
    output wire       is_committed,
    output reg        answerable,
    output wire       current,
    output wire       takes_reply,
    output wire       takes_telegram,
    output wire       licenses,
    output wire       commits,
    output wire       withdrawn,
    output wire       kept,
    output wire       fault
);

  reg spent = 1'b0;
  reg to_keep = 1'b0;  // ordered for the candidate

  assign current = queue_ticket == ticket;
  assign takes_reply = current && !broadcast && (is_candidate || (is_committed && answerable));
  assign takes_telegram = current && (is_candidate || (is_committed && !spent));
  assign licenses = current && is_committed && !spent;
  assign commits = commit && silent && (is_candidate || candidate);
  assign withdrawn = is_candidate && (revoke || start_seen || (commit && !silent));

  // In the clock of a candidate, broadcast and writes_coils are those of the candidate.
  assign kept = !candidate && !used && (commits ? to_keep || (keep && current) : keep && licenses);

  initial begin
    ticket = 4'd0;
    is_candidate = 1'b0;
    answerable = 1'b0;
  end

  guarded_bit committed_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (candidate || commits),
      .data (commits),
      // status
      .value(is_committed),
      .fault(fault)
  );

  always @(posedge clk) begin
    if (candidate) ticket <= ticket + 4'd1;

    if (rst || commits) is_candidate <= 1'b0;
    else if (candidate) is_candidate <= !commit;
    else if (withdrawn) is_candidate <= 1'b0;

    if (rst) answerable <= 1'b0;
    else if (commits) answerable <= 1'b1;
    else if (candidate || reply_left || (start_seen && is_committed)) answerable <= 1'b0;

    if (rst || candidate || withdrawn || commits) to_keep <= 1'b0;
    else if (keep && current && is_candidate) to_keep <= 1'b1;

    if (rst || commits) spent <= kept && writes_coils && !rst;
    else if ((kept && writes_coils) || reply_left || command_left ||
             (queue_reply && current && broadcast))
      spent <= 1'b1;
  end

endmodule

`default_nettype wire
