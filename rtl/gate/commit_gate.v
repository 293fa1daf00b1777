// SPDX-License-Identifier: Apache-2.0
// The one place that lets anything leave the card: prepare early, commit late (FRAME-6).
//
// Wires, and whether an order is for the newest request:
//   request_state  the newest request, from candidate to answer
//   licences       what commits allow the drive to be sent: control image, parameter writes
//   telegram_slot  the telegram: leaves under a licence, at most once more as a repeat
//   reply_slot     the reply: once, on a silent line, never after another character
//   master_loss    the licence of the stop when the master is lost (SAFE-7)
//
// The firmware orders a reply or a telegram for a ticket, the number of the newest request that it
// has seen. An order with an older ticket is refused, so no order is based on an older image.
// Without a committed write of coils, of any address, no telegram has telegram_control, which bit 10
// of its control word needs (SAFE-1). MASTER_LOSS_STOP = 0: there is no stop, and order_stop is ignored.
// fault: a half of a guarded bit has flipped (SAFE-4). rst comes from the supervisor whenever the
// firmware restarts. Clock domain: clk.
`default_nettype none

module commit_gate #(
    parameter [0:0] MASTER_LOSS_STOP = 1'b0,
    parameter [0:0] SECOND_TELEGRAM  = 1'b0
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
    input  wire        writes_parameter,
    input  wire        modbus_start_seen,
    input  wire        modbus_silent,
    input  wire        modbus_quiet,
    // drive line
    input  wire        drive_good,
    input  wire        drive_bad,
    input  wire        drive_quiet,
    // firmware
    input  wire        order_reply,
    input  wire        reply_empty,
    input  wire        reply_after_drive,
    input  wire        order_telegram,
    input  wire [ 1:0] order_kind,
    input  wire        order_no_reply,
    input  wire        order_early,
    input  wire        order_stop,
    input  wire        order_repeat,
    input  wire        telegram_touched,
    input  wire [ 3:0] order_ticket,
    input  wire        watch,
    input  wire        running,
    input  wire [19:0] period,
    // loop-back test
    input  wire        loopback_open,
    input  wire        loopback_close,
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

  localparam [1:0] K_IMAGE = 2'd1;

  wire answerable;
  wire unanswered;
  wire commits;
  wire withdrawn;
  wire [1:0] kind;
  wire valid;
  wire renewed;
  wire free;
  wire used;
  wire grants_stop;
  wire request_fault;
  wire licences_fault;
  wire telegram_fault;
  wire loss_fault;

  wire current = order_ticket == ticket;
  wire takes_reply = current && !broadcast && (is_candidate || answerable);
  wire decided = current && !candidate && !is_candidate;
  wire take_stop = order_telegram && order_stop && order_kind == K_IMAGE && decided && stop_due;

  assign fault = request_fault || licences_fault || telegram_fault || loss_fault;

  request_state request_i (
      .clk(clk),
      .rst(rst),
      // network request
      .candidate(candidate),
      .commit(commit),
      .revoke(revoke),
      .start_seen(modbus_start_seen),
      .silent(modbus_silent),
      // departures
      .reply_left(reply_start),
      // status
      .ticket(ticket),
      .is_candidate(is_candidate),
      .is_committed(is_committed),
      .answerable(answerable),
      .unanswered(unanswered),
      .commits(commits),
      .withdrawn(withdrawn),
      .fault(request_fault)
  );

  licences #(
      .MASTER_LOSS_STOP(MASTER_LOSS_STOP),
      .SECOND_TELEGRAM (SECOND_TELEGRAM)
  ) licences_i (
      .clk(clk),
      .rst(rst),
      // newest request
      .commits(commits),
      .broadcast(broadcast),
      .writes_coils(writes_coils),
      .writes_parameter(writes_parameter),
      .unanswered(unanswered),
      // loss of the master
      .take_stop(take_stop),
      // telegram
      .kind(kind),
      .used(used),
      // status
      .valid(valid),
      .renewed(renewed),
      .free(free),
      .fault(licences_fault)
  );

  telegram_slot telegram_i (
      .clk(clk),
      .rst(rst),
      // firmware
      .order(order_telegram),
      .again(order_repeat),
      .touched(telegram_touched),
      .order_kind(order_kind),
      .early(order_early),
      .no_reply(order_no_reply),
      .take_stop(take_stop),
      // newest request
      .current(current),
      .candidate(candidate),
      .is_candidate(is_candidate),
      .is_committed(is_committed),
      .withdrawn(withdrawn),
      // licences
      .valid(valid),
      .renewed(renewed),
      .free(free),
      .kind(kind),
      .used(used),
      // drive line
      .quiet(drive_quiet),
      // loop-back test
      .loopback_open(loopback_open),
      .loopback_close(loopback_close),
      // stream out
      .start(telegram_start),
      .control(telegram_control),
      .stop(telegram_stop),
      // status
      .queued(telegram_queued),
      .grants_stop(grants_stop),
      .started(telegram_started),
      .fault(telegram_fault)
  );

  reply_slot reply_i (
      .clk(clk),
      .rst(rst),
      // firmware
      .order(order_reply),
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
      .loopback_close(loopback_close),
      // stream out
      .start(reply_start),
      // status
      .queued(reply_queued)
  );

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
          .take(grants_stop),
          // status
          .due(stop_due),
          .fault(loss_fault)
      );
    end else begin : g_no_loss
      assign stop_due   = 1'b0;
      assign loss_fault = 1'b0;
      wire unused = &{1'b0, beat, watch, running, period, grants_stop};
    end
  endgenerate

endmodule

`default_nettype wire
