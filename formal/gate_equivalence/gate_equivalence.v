// SPDX-License-Identifier: Apache-2.0
// Two gates on the same inputs: commit_gate_before, one block, and commit_gate, three machines.
//
// All inputs are free, rst included; outputs as *_before and *_now. Clock domain: clk.
`default_nettype none

module gate_equivalence (
    input wire clk,
    input wire rst,
    input wire candidate,
    input wire commit,
    input wire revoke,
    input wire broadcast,
    input wire writes_coils,
    input wire modbus_start_seen,
    input wire modbus_quiet,
    input wire drive_good,
    input wire drive_bad,
    input wire drive_quiet,
    input wire queue_reply,
    input wire reply_empty,
    input wire reply_after_drive,
    input wire queue_telegram,
    input wire telegram_repeat,
    input wire telegram_touched,
    input wire [3:0] queue_ticket,
    input wire loopback_open
);

  wire reply_start_before;
  wire reply_start_now;
  wire telegram_start_before;
  wire telegram_start_now;
  wire telegram_control_before;
  wire telegram_control_now;
  wire [3:0] ticket_before;
  wire [3:0] ticket_now;
  wire is_candidate_before;
  wire is_candidate_now;
  wire is_committed_before;
  wire is_committed_now;
  wire reply_queued_before;
  wire reply_queued_now;
  wire telegram_queued_before;
  wire telegram_queued_now;
  wire telegram_started_before;
  wire telegram_started_now;

  commit_gate_before before_i (
      .clk(clk),
      .rst(rst),
      .candidate(candidate),
      .commit(commit),
      .revoke(revoke),
      .broadcast(broadcast),
      .writes_coils(writes_coils),
      .modbus_start_seen(modbus_start_seen),
      .modbus_quiet(modbus_quiet),
      .drive_good(drive_good),
      .drive_bad(drive_bad),
      .drive_quiet(drive_quiet),
      .queue_reply(queue_reply),
      .reply_empty(reply_empty),
      .reply_after_drive(reply_after_drive),
      .queue_telegram(queue_telegram),
      .telegram_repeat(telegram_repeat),
      .telegram_touched(telegram_touched),
      .queue_ticket(queue_ticket),
      .loopback_open(loopback_open),
      .reply_start(reply_start_before),
      .telegram_start(telegram_start_before),
      .telegram_control(telegram_control_before),
      .ticket(ticket_before),
      .is_candidate(is_candidate_before),
      .is_committed(is_committed_before),
      .reply_queued(reply_queued_before),
      .telegram_queued(telegram_queued_before),
      .telegram_started(telegram_started_before)
  );

  commit_gate now_i (
      .clk(clk),
      .rst(rst),
      .candidate(candidate),
      .commit(commit),
      .revoke(revoke),
      .broadcast(broadcast),
      .writes_coils(writes_coils),
      .modbus_start_seen(modbus_start_seen),
      .modbus_quiet(modbus_quiet),
      .drive_good(drive_good),
      .drive_bad(drive_bad),
      .drive_quiet(drive_quiet),
      .queue_reply(queue_reply),
      .reply_empty(reply_empty),
      .reply_after_drive(reply_after_drive),
      .queue_telegram(queue_telegram),
      .telegram_repeat(telegram_repeat),
      .telegram_touched(telegram_touched),
      .queue_ticket(queue_ticket),
      .loopback_open(loopback_open),
      .reply_start(reply_start_now),
      .telegram_start(telegram_start_now),
      .telegram_control(telegram_control_now),
      .ticket(ticket_now),
      .is_candidate(is_candidate_now),
      .is_committed(is_committed_now),
      .reply_queued(reply_queued_now),
      .telegram_queued(telegram_queued_now),
      .telegram_started(telegram_started_now)
  );

endmodule

`default_nettype wire
