// SPDX-License-Identifier: Apache-2.0
// The one place that lets anything leave the card: prepare early, commit late.
//
// The firmware queues a reply and a telegram for a ticket, the number of the
// request they answer. A stale ticket is ignored. What is queued leaves only after
// the request was committed, and is dropped when it is revoked, or any character begins
// before (FRAME-6).
//
// Reply: once for each request, on a line silent for t3.5; dropped by any
// character after the commit (FRAME-7); with after_drive it also waits until the
// drive's reply is good, and is dropped if that turns out bad. Never for a
// broadcast (MAP-9).
// Telegram: committed means licensed. The licence outlives newer requests until the
// telegram has left; then it is good for one repeat (FC-9), which ends with the reply,
// with a newer committed request, with any write to the telegram's memory, and at once
// for a broadcast. A request that has its reply, or has sent its write of coils, is
// spent and licenses nothing more; a broadcast is spent, too, when the firmware answers
// it, which sends nothing. It starts after 2 characters of silence.
//
// Without a committed request no telegram starts, and without a committed write of coils
// none may have bit 10 of its control word set: telegram_control stays as long as the
// licence, fc_tx does the rest (SAFE-1). The one exception is the
// loop-back test, while loopback_open: there is no master on the line then (LOOP-1);
// its end takes back what is queued.
//
// Against one flipped bit (SAFE-4): a licence is two opposite bits, and so is what tells
// a committed request, from the firmware, too. A commit needs its candidate and a line
// that is silent; a candidate ends with a start bit, whatever rtu_rx makes of it.
// What a commit licenses is queued and has never left (begun). telegram_queued alone
// can only bring forward the one repeat that is still licensed.
// rst comes from the supervisor whenever the firmware restarts. Clock domain: clk.
`default_nettype none

module commit_gate_before (
    input  wire       clk,
    input  wire       rst,
    // network request
    input  wire       candidate,
    input  wire       commit,
    input  wire       revoke,
    input  wire       broadcast,
    input  wire       writes_coils,
    input  wire       modbus_start_seen,
    input  wire       modbus_quiet,
    // drive line
    input  wire       drive_good,
    input  wire       drive_bad,
    input  wire       drive_quiet,
    // firmware
    input  wire       queue_reply,
    input  wire       reply_empty,
    input  wire       reply_after_drive,
    input  wire       queue_telegram,
    input  wire       telegram_repeat,
    input  wire       telegram_touched,
    input  wire [3:0] queue_ticket,
    // configuration
    input  wire       loopback_open,
    // stream out
    output wire       reply_start,
    output wire       telegram_start,
    output reg        telegram_control,
    // status
    output reg  [3:0] ticket,
    output reg        is_candidate,
    output wire       is_committed,
    output reg        reply_queued,
    output reg        telegram_queued,
    output reg        telegram_started
);

  reg  committed = 1'b0;
  reg  uncommitted = 1'b1;  // the opposite
  reg  answerable = 1'b0;  // committed, and nothing heard or answered since
  reg  wait_drive = 1'b0;
  reg  licensed = 1'b0;
  reg  unlicensed = 1'b1;  // the opposite
  reg  newest = 1'b0;  // no other request was committed since the telegram was queued
  reg  repeatable = 1'b0;  // that, and it is no broadcast
  reg  begun = 1'b0;  // it has left once, or there is none
  reg  spent = 1'b0;  // the request licenses nothing more
  reg  was_open = 1'b0;

  wire current = queue_ticket == ticket;
  wire new_telegram = queue_telegram && !telegram_repeat;
  wire commits = commit && modbus_quiet && (is_candidate || candidate);
  wire owed = is_committed && !spent;
  wire told = reply_start && newest && !loopback_open;  // the telegram's request has its reply
  wire closing = was_open && !loopback_open;

  assign is_committed = committed && !uncommitted;
  assign reply_start = reply_queued && (answerable || loopback_open) && modbus_quiet &&
      (!wait_drive || drive_good) && !closing;
  // What the firmware does to the telegram in this very clock comes first.
  assign telegram_start = telegram_queued && licensed && !unlicensed && drive_quiet &&
      !telegram_touched && !queue_telegram && !closing;

  initial begin
    ticket = 4'd0;
    is_candidate = 1'b0;
    reply_queued = 1'b0;
    telegram_queued = 1'b0;
    telegram_started = 1'b0;
    telegram_control = 1'b0;
  end

  always @(posedge clk) begin
    was_open <= loopback_open;

    if (telegram_start) begin
      telegram_queued <= 1'b0;
      telegram_started <= 1'b1;
      begun <= 1'b1;
      if (newest && telegram_control) spent <= 1'b1;
    end
    if (reply_start) begin
      reply_queued <= 1'b0;
      answerable <= 1'b0;
      spent <= 1'b1;
    end
    // It has left for the last time.
    if ((telegram_start && (begun || !repeatable)) || told) begin
      licensed   <= 1'b0;
      unlicensed <= 1'b1;
    end
    if (told) telegram_queued <= 1'b0;

    // Nothing waits, nothing may leave again: no telegram is fresh any more.
    if (!telegram_queued && !licensed) begun <= 1'b1;

    // What the firmware queues.
    if (queue_reply) begin
      reply_queued <= !reply_empty && (loopback_open ||
          (current && !broadcast && (is_candidate || (is_committed && answerable))));
      wait_drive <= reply_after_drive;
      if (current && broadcast) spent <= 1'b1;
    end
    if (queue_telegram) begin
      telegram_started <= 1'b0;
      if (telegram_repeat) telegram_queued <= licensed && begun && repeatable && !told;
      else begin
        telegram_queued <= loopback_open || (current && (is_candidate || owed));
        licensed <= loopback_open || (current && owed);
        unlicensed <= !(loopback_open || (current && owed));
        telegram_control <= writes_coils && current && owed;
        newest <= 1'b1;
        repeatable <= !broadcast;
        begun <= 1'b0;
      end
    end
    // What the two lines take back.
    if (modbus_start_seen && is_committed) begin
      reply_queued <= 1'b0;
      answerable   <= 1'b0;
    end
    if (is_candidate && (revoke || modbus_start_seen)) begin
      is_candidate <= 1'b0;
      reply_queued <= 1'b0;
      if (!licensed || new_telegram) telegram_queued <= 1'b0;
    end
    if (drive_bad && wait_drive) reply_queued <= 1'b0;

    // The request's own fate. Both at once: PREPARE_EARLY = 0. A telegram queued in the same
    // clock was meant for the request as it was, and goes with it.
    if (candidate) begin
      ticket <= ticket + 4'd1;
      is_candidate <= 1'b1;
      committed <= 1'b0;
      uncommitted <= 1'b1;
      answerable <= 1'b0;
      reply_queued <= 1'b0;
      if (!licensed || new_telegram) telegram_queued <= 1'b0;
      if (new_telegram) begin
        licensed   <= 1'b0;
        unlicensed <= 1'b1;
      end
    end
    if (commits) begin
      is_candidate <= 1'b0;
      committed <= 1'b1;
      uncommitted <= 1'b0;
      answerable <= 1'b1;
      spent <= 1'b0;
      if (licensed && !new_telegram) begin
        newest <= 1'b0;
        repeatable <= 1'b0;
        if (begun) begin
          telegram_queued <= 1'b0;
          licensed <= 1'b0;
          unlicensed <= 1'b1;
        end
      end else if (!candidate && (new_telegram ? current : telegram_queued && !begun)) begin
        licensed <= 1'b1;
        unlicensed <= 1'b0;
        telegram_control <= writes_coils;
      end
    end

    // Last, so that nothing above can license what is being changed.
    if (telegram_touched || closing) begin
      telegram_queued <= 1'b0;
      licensed <= 1'b0;
      unlicensed <= 1'b1;
    end
    if (closing) reply_queued <= 1'b0;

    if (rst) begin
      is_candidate <= 1'b0;
      committed <= 1'b0;
      uncommitted <= 1'b1;
      answerable <= 1'b0;
      reply_queued <= 1'b0;
      telegram_queued <= 1'b0;
      telegram_started <= 1'b0;
      licensed <= 1'b0;
      unlicensed <= 1'b1;
      spent <= 1'b0;
    end
  end

endmodule

`default_nettype wire
