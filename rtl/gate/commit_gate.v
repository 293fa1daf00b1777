// SPDX-License-Identifier: Apache-2.0
// The one place that lets anything leave the card: prepare early, commit late.
//
// The firmware queues a reply and a telegram for a ticket, the number of the request they
// answer. Both leave only after that request has committed; both are dropped when it is
// revoked (FRAME-6). Only wires in here:
//   request_fate   candidate, committed or revoked, spent; what an order may still do
//   reply_slot     the reply: once, on a silent line, never after another character
//   telegram_slot  the telegram: only with a licence, at most once more as a repeat
//   waiting_place  the licence of a committed write that waits for a running exchange
//   loopback_end   end of the loop-back test, in which orders need no request (LOOP-1)
//   master_loss    the licence of the stop that leaves when the master is lost (SAFE-7)
//
// keep_write moves the licence of the newest request to the place of its kind as soon as that
// request is committed. use_waiting orders a telegram with the licence of a place (FRAME-7).
// A licence stays until it is used, until a newer one of its kind takes its place, or until
// rst. PLACES: 2, one for a broadcast and one for a unicast write; 1, only the broadcast's,
// and keep_write for a unicast write is ignored.
//
// MASTER_LOSS_STOP = 1: use_waiting with waiting_stop orders a telegram under the licence of
// master_loss, and telegram_stop is 1 for it. 0: waiting_stop is ignored, telegram_stop is 0.
//
// Without a committed request no telegram starts. Without a committed write of coils none has
// telegram_control; fc_tx then sends bit 10 of its control word as 0 (SAFE-1).
// docs/hardening.md describes what one flipped bit can do (SAFE-4).
// fault: a half of a guarded bit of the gate has flipped; the supervisor then restarts the firmware
// (docs/hardening.md, Faults of guarded bits).
// rst comes from the supervisor whenever the firmware restarts. Clock domain: clk.
`default_nettype none

module commit_gate #(
    parameter [1:0] PLACES = 2'd2,
    parameter [0:0] MASTER_LOSS_STOP = 1'b0
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        beat,
    // network request
    input  wire        candidate,
    input  wire        commit,
    input  wire        revoke,
    input  wire        broadcast,
    input  wire        writes_coils,
    input  wire        modbus_start_seen,
    input  wire        modbus_silent,
    input  wire        modbus_quiet,
    // drive line
    input  wire        drive_good,
    input  wire        drive_bad,
    input  wire        drive_quiet,
    // firmware
    input  wire        queue_reply,
    input  wire        reply_empty,
    input  wire        reply_after_drive,
    input  wire        queue_telegram,
    input  wire        use_waiting,
    input  wire        waiting_to_all,
    input  wire        waiting_stop,
    input  wire        repeat_telegram,
    input  wire        keep_write,
    input  wire        telegram_touched,
    input  wire [ 3:0] queue_ticket,
    input  wire        watch,
    input  wire        running,
    input  wire [19:0] period,
    // configuration
    input  wire        loopback_open,
    // stream out
    output wire        reply_start,
    output wire        telegram_start,
    output wire        telegram_control,
    output wire        telegram_stop,
    // status
    output wire [ 3:0] ticket,
    output wire        is_candidate,
    output wire        is_committed,
    output wire        reply_queued,
    output wire        telegram_queued,
    output wire        telegram_started,
    output wire        stop_due,
    output wire        fault
);

  wire answerable;
  wire current;
  wire takes_reply;
  wire takes_telegram;
  wire licenses;
  wire commits;
  wire withdrawn;
  wire kept;
  wire own;
  wire command_left;
  wire broadcast_valid;
  wire broadcast_control;
  wire unicast_valid;
  wire unicast_control;
  wire closing;
  wire request_fault;
  wire telegram_fault;
  wire broadcast_fault;
  wire unicast_fault;
  wire loss_fault;

  assign fault = request_fault || telegram_fault || broadcast_fault || unicast_fault || loss_fault;

  wire for_stop = MASTER_LOSS_STOP && waiting_stop;
  wire waiting_valid = waiting_to_all ? broadcast_valid : unicast_valid;
  wire waiting_control = waiting_to_all ? broadcast_control : unicast_control;

  request_fate request_i (
      .clk(clk),
      .rst(rst),
      // network request
      .candidate(candidate),
      .commit(commit),
      .revoke(revoke),
      .broadcast(broadcast),
      .writes_coils(writes_coils),
      .start_seen(modbus_start_seen),
      .silent(modbus_silent),
      // firmware
      .queue_reply(queue_reply),
      .keep(keep_write && (PLACES == 2'd2 || broadcast)),
      .queue_ticket(queue_ticket),
      // departures
      .used(own),
      .reply_left(reply_start),
      .command_left(command_left),
      // status
      .ticket(ticket),
      .is_candidate(is_candidate),
      .is_committed(is_committed),
      .answerable(answerable),
      .current(current),
      .takes_reply(takes_reply),
      .takes_telegram(takes_telegram),
      .licenses(licenses),
      .commits(commits),
      .withdrawn(withdrawn),
      .kept(kept),
      .fault(request_fault)
  );

  reply_slot reply_i (
      .clk(clk),
      .rst(rst),
      // firmware
      .queue_reply(queue_reply),
      .empty(reply_empty),
      .after_drive(reply_after_drive),
      // newest request
      .takes_reply(takes_reply),
      .candidate(candidate),
      .withdrawn(withdrawn),
      .is_committed(is_committed),
      .answerable(answerable),
      // network line
      .start_seen(modbus_start_seen),
      .quiet(modbus_quiet),
      // drive's reply
      .drive_good(drive_good),
      .drive_bad(drive_bad),
      // loop-back test
      .loopback_open(loopback_open),
      .closing(closing),
      // stream out
      .start(reply_start),
      // status
      .queued(reply_queued)
  );

  telegram_slot telegram_i (
      .clk(clk),
      .rst(rst),
      // firmware
      .queue(queue_telegram),
      .use_place(use_waiting),
      .again(repeat_telegram),
      .touched(telegram_touched),
      // newest request
      .current(current),
      .takes_telegram(takes_telegram),
      .licenses(licenses),
      .broadcast(broadcast),
      .writes_coils(writes_coils),
      .candidate(candidate),
      .commits(commits),
      .withdrawn(withdrawn),
      .reply_left(reply_start),
      // waiting writes
      .place_valid(for_stop ? stop_due : waiting_valid),
      .place_control(for_stop || waiting_control),
      .place_to_all(!for_stop && (waiting_to_all || PLACES == 2'd1)),
      .place_stop(for_stop),
      .others_wait(broadcast_valid || unicast_valid),
      // drive line
      .quiet(drive_quiet),
      // loop-back test
      .loopback_open(loopback_open),
      .closing(closing),
      // stream out
      .start(telegram_start),
      .control(telegram_control),
      .stop(telegram_stop),
      // status
      .command_left(command_left),
      .own(own),
      .queued(telegram_queued),
      .started(telegram_started),
      .fault(telegram_fault)
  );

  waiting_place broadcast_i (
      .clk(clk),
      .rst(rst),
      // newest request
      .fill(kept && broadcast),
      .writes_coils(writes_coils),
      // firmware
      .take(use_waiting && waiting_to_all && !for_stop),
      // status
      .valid(broadcast_valid),
      .control(broadcast_control),
      .fault(broadcast_fault)
  );

  generate
    if (PLACES == 2'd2) begin : g_unicast
      waiting_place unicast_i (
          .clk(clk),
          .rst(rst),
          // newest request
          .fill(kept && !broadcast),
          .writes_coils(writes_coils),
          // firmware
          .take(use_waiting && !waiting_to_all && !for_stop),
          // status
          .valid(unicast_valid),
          .control(unicast_control),
          .fault(unicast_fault)
      );
    end else begin : g_no_unicast
      assign unicast_valid   = 1'b0;
      assign unicast_control = 1'b0;
      assign unicast_fault   = 1'b0;
    end
  endgenerate

  generate
    if (MASTER_LOSS_STOP) begin : g_loss
      master_loss loss_i (
          .clk(clk),
          .rst(rst),
          .beat(beat),
          // newest request
          .commits(commits),
          .rights(current && is_committed && !candidate),
          .writes_coils(writes_coils),
          // firmware
          .watch(watch),
          .running(running),
          .period(period),
          .take(use_waiting && waiting_stop),
          // status
          .due(stop_due),
          .fault(loss_fault)
      );
    end else begin : g_no_loss
      assign stop_due   = 1'b0;
      assign loss_fault = 1'b0;
      wire unused = &{1'b0, beat, watch, running, period, waiting_stop};
    end
  endgenerate

  loopback_end loopback_i (
      .clk(clk),
      // configuration
      .loopback_open(loopback_open),
      // status
      .closing(closing)
  );

endmodule

`default_nettype wire
