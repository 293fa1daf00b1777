// SPDX-License-Identifier: Apache-2.0
// The mailbox: registers and commit gate, wired together.
//
// The firmware sees both ports through the registers and orders replies and telegrams there; the
// commit gate decides what leaves. The frames themselves are in the memory, see bus_arbiter.
// MASTER_LOSS_STOP, SECOND_TELEGRAM: of commit_gate. core_rst: reset of the soft core; it also
// empties the commit gate. Only wires in here. Clock domain: clk. Rules: FRAME-5, FRAME-6, FRAME-7, SAFE-1, SAFE-7.
`default_nettype none

module mailbox #(
    parameter [0:0] MASTER_LOSS_STOP = 1'b0,
    parameter [0:0] SECOND_TELEGRAM  = 1'b0
) (
    input  wire        clk,
    input  wire        core_rst,
    // registers, by bus_arbiter
    input  wire        regs_valid,
    input  wire        regs_write,
    input  wire [ 2:0] regs_word,
    input  wire [31:0] regs_wdata,
    output wire [31:0] regs_rdata,
    input  wire        telegram_touched,
    // network port
    output wire        reply_start,
    output wire [ 4:0] reply_length,
    input  wire        modbus_quiet,
    input  wire        modbus_start_seen,
    input  wire        modbus_silent,
    input  wire        candidate,
    input  wire        commit,
    input  wire        revoke,
    input  wire [ 7:0] frame_length,
    input  wire        frame_broadcast,
    input  wire        frame_writes_coils,
    input  wire        frame_writes_parameter,
    input  wire        frame_bank,
    input  wire        count_crc,
    input  wire        count_parity,
    input  wire        count_framing,
    input  wire        count_t15,
    input  wire        count_overrun,
    input  wire        count_foreign,
    // drive port
    output wire        telegram_start,
    output wire [ 4:0] telegram_length,
    output wire        telegram_no_reply,
    output wire        telegram_control,
    output wire        telegram_stop,
    output wire        listen_again,
    output wire        listen_stop,
    input  wire        drive_sending,
    input  wire        drive_quiet,
    input  wire        drive_candidate,
    input  wire        drive_good,
    input  wire        drive_bad,
    // supervisor
    output wire        watchdog_kick,
    output wire        halt,
    output wire        loopback_close,
    output wire        fault,
    input  wire        loopback_open,
    input  wire        loopback_heard,
    input  wire [ 7:0] restarts,
    // status
    input  wire [ 7:0] ticks,
    // LEDs
    output wire        lit_modbus_red,
    output wire        lit_modbus_green,
    output wire        lit_drive_red,
    output wire        lit_drive_green,
    // options of the network line
    output wire        strict_t15,
    output wire        break_tolerant
);

  wire order_reply;
  wire order_telegram;
  wire order_repeat;
  wire [1:0] order_kind;
  wire watch_master;
  wire [3:0] order_ticket;
  wire reply_empty;
  wire reply_after_drive;
  wire order_no_reply;
  wire order_stop;
  wire order_early;
  wire running;
  wire [19:0] period;
  wire [3:0] ticket;
  wire is_candidate;
  wire is_committed;
  wire reply_queued;
  wire telegram_queued;
  wire telegram_started;
  wire stop_due;

  mailbox_regs regs_i (
      .clk(clk),
      .rst(core_rst),
      // firmware bus
      .valid(regs_valid),
      .write(regs_write),
      .word(regs_word),
      .wdata(regs_wdata),
      .rdata(regs_rdata),
      // orders
      .order_reply(order_reply),
      .order_telegram(order_telegram),
      .order_repeat(order_repeat),
      .listen_again(listen_again),
      .listen_stop(listen_stop),
      .watchdog_kick(watchdog_kick),
      .halt(halt),
      .loopback_close(loopback_close),
      .watch_master(watch_master),
      // fields of an order
      .order_ticket(order_ticket),
      .reply_empty(reply_empty),
      .reply_after_drive(reply_after_drive),
      .order_kind(order_kind),
      .order_no_reply(order_no_reply),
      .order_stop(order_stop),
      .order_early(order_early),
      .running(running),
      .period(period),
      // kept until the next order
      .reply_length(reply_length),
      .telegram_length(telegram_length),
      .telegram_no_reply(telegram_no_reply),
      .lit_modbus_red(lit_modbus_red),
      .lit_modbus_green(lit_modbus_green),
      .lit_drive_red(lit_drive_red),
      .lit_drive_green(lit_drive_green),
      // options of the network line
      .strict_t15(strict_t15),
      .break_tolerant(break_tolerant),
      // newest request
      .ticket(ticket),
      .is_candidate(is_candidate),
      .is_committed(is_committed),
      .frame_broadcast(frame_broadcast),
      .frame_bank(frame_bank),
      .frame_length(frame_length),
      // exchange with the drive
      .telegram_queued(telegram_queued),
      .telegram_started(telegram_started),
      .drive_sending(drive_sending),
      .drive_candidate(drive_candidate),
      .drive_good(drive_good),
      // supervision
      .loopback_open(loopback_open),
      .loopback_heard(loopback_heard),
      .stop_due(stop_due),
      .restarts(restarts),
      .ticks(ticks),
      // events
      .count_crc(count_crc),
      .count_parity(count_parity),
      .count_framing(count_framing),
      .count_t15(count_t15),
      .count_overrun(count_overrun),
      .revoke(revoke),
      .count_foreign(count_foreign),
      .drive_bad(drive_bad)
  );

  commit_gate #(
      .MASTER_LOSS_STOP(MASTER_LOSS_STOP),
      .SECOND_TELEGRAM (SECOND_TELEGRAM)
  ) gate_i (
      .clk(clk),
      .rst(core_rst),
      .beat(ticks[0]),
      // network request
      .candidate(candidate),
      .commit(commit),
      .revoke(revoke),
      .broadcast(frame_broadcast),
      .writes_coils(frame_writes_coils),
      .writes_parameter(frame_writes_parameter),
      .modbus_start_seen(modbus_start_seen),
      .modbus_silent(modbus_silent),
      .modbus_quiet(modbus_quiet),
      // drive line
      .drive_good(drive_good),
      .drive_bad(drive_bad),
      .drive_quiet(drive_quiet && !drive_sending),
      // firmware
      .order_reply(order_reply),
      .reply_empty(reply_empty),
      .reply_after_drive(reply_after_drive),
      .order_telegram(order_telegram),
      .order_kind(order_kind),
      .order_no_reply(order_no_reply),
      .order_stop(order_stop),
      .order_early(order_early),
      .order_repeat(order_repeat),
      .telegram_touched(telegram_touched),
      .order_ticket(order_ticket),
      .watch(watch_master),
      .running(running),
      .period(period),
      // loop-back test
      .loopback_open(loopback_open),
      .loopback_close(loopback_close),
      // stream out
      .reply_start(reply_start),
      .telegram_start(telegram_start),
      .telegram_control(telegram_control),
      .telegram_stop(telegram_stop),
      // status
      .ticket(ticket),
      .is_candidate(is_candidate),
      .is_committed(is_committed),
      .reply_queued(reply_queued),
      .telegram_queued(telegram_queued),
      .telegram_started(telegram_started),
      .stop_due(stop_due),
      .fault(fault)
  );

  // For waveforms.
  wire unused = &{1'b0, reply_queued};

endmodule

`default_nettype wire
