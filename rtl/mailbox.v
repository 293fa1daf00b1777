// SPDX-License-Identifier: Apache-2.0
// The mailbox: registers, commit gate and the way into the memory, wired together.
//
// The network port writes requests and reads replies, the drive port reads telegrams
// and writes the drive's replies, the firmware sees all of it through one bus, and
// the commit gate decides what leaves. Only wires in here. Clock domain: clk.
// Rules: FRAME-5, FRAME-6, FRAME-7, SAFE-1.
`default_nettype none

module mailbox #(
    parameter MEMORY_BYTES = 8192
) (
    input  wire                              clk,
    input  wire                              core_rst,
    // soft core
    input  wire                              core_valid,
    output wire                              core_ready,
    input  wire [                      31:0] core_addr,
    input  wire [                      31:0] core_wdata,
    input  wire [                       3:0] core_wstrb,
    output wire [                      31:0] core_rdata,
    // memory
    output wire                              ram_enable,
    output wire [$clog2(MEMORY_BYTES/4)-1:0] ram_word,
    output wire [                      31:0] ram_wdata,
    output wire [                       3:0] ram_wstrb,
    input  wire [                      31:0] ram_rdata,
    // network port
    input  wire                              modbus_write_valid,
    output wire                              modbus_write_ready,
    input  wire [                       5:0] modbus_write_addr,
    input  wire [                       7:0] modbus_write_data,
    input  wire                              modbus_read_valid,
    output wire                              modbus_read_ready,
    input  wire [                       4:0] modbus_read_addr,
    output wire                              reply_start,
    output wire [                       4:0] reply_length,
    input  wire                              modbus_quiet,
    input  wire                              modbus_start_seen,
    input  wire                              candidate,
    input  wire                              commit,
    input  wire                              revoke,
    input  wire [                       7:0] frame_length,
    input  wire                              frame_broadcast,
    input  wire                              frame_writes_coils,
    input  wire                              frame_bank,
    // drive port
    input  wire                              drive_write_valid,
    output wire                              drive_write_ready,
    input  wire [                       4:0] drive_write_addr,
    input  wire [                       7:0] drive_write_data,
    input  wire                              drive_read_valid,
    output wire                              drive_read_ready,
    input  wire [                       4:0] drive_read_addr,
    output wire                              telegram_start,
    output wire [                       4:0] telegram_length,
    output wire                              telegram_no_reply,
    output wire                              telegram_control,
    output wire                              listen_again,
    output wire                              listen_stop,
    input  wire                              drive_sending,
    input  wire                              drive_quiet,
    input  wire                              drive_candidate,
    input  wire                              drive_good,
    input  wire                              drive_bad,
    // both ports
    output wire [                       7:0] read_data,
    // supervisor
    output wire                              watchdog_kick,
    output wire                              halt,
    output wire                              loopback_close,
    input  wire                              loopback_open,
    // status
    input  wire [                       7:0] ticks,
    input  wire                              count_crc,
    input  wire                              count_parity,
    input  wire                              count_framing,
    input  wire                              count_t15,
    input  wire                              count_overrun,
    output wire                              led_modbus_red,
    output wire                              led_modbus_green,
    output wire                              led_drive_red,
    output wire                              led_drive_green
);

  wire regs_valid;
  wire regs_write;
  wire [2:0] regs_word;
  wire [31:0] regs_rdata;
  wire queue_reply;
  wire queue_telegram;
  wire telegram_touched;
  wire [3:0] ticket;
  wire is_candidate;
  wire is_committed;
  wire reply_queued;
  wire telegram_queued;
  wire telegram_started;

  reg [6:0] events;

  always @* begin
    events = 7'd0;
    events[`MBX_EVENTS_CRC_BITS] = count_crc;
    events[`MBX_EVENTS_PARITY_BITS] = count_parity;
    events[`MBX_EVENTS_FRAMING_BITS] = count_framing;
    events[`MBX_EVENTS_T15_BITS] = count_t15;
    events[`MBX_EVENTS_OVERRUN_BITS] = count_overrun;
    events[`MBX_EVENTS_REVOKED_BITS] = revoke;
    events[`MBX_EVENTS_DRIVE_BAD_BITS] = drive_bad;
  end

  bus_arbiter #(
      .MEMORY_BYTES(MEMORY_BYTES)
  ) arbiter_i (
      .clk(clk),
      .rst(core_rst),
      // soft core
      .core_valid(core_valid),
      .core_ready(core_ready),
      .core_addr(core_addr),
      .core_wdata(core_wdata),
      .core_wstrb(core_wstrb),
      .core_rdata(core_rdata),
      // network line
      .modbus_write_valid(modbus_write_valid),
      .modbus_write_ready(modbus_write_ready),
      .modbus_write_addr(modbus_write_addr),
      .modbus_write_data(modbus_write_data),
      .modbus_read_valid(modbus_read_valid),
      .modbus_read_ready(modbus_read_ready),
      .modbus_read_addr(modbus_read_addr),
      // drive line
      .drive_write_valid(drive_write_valid),
      .drive_write_ready(drive_write_ready),
      .drive_write_addr(drive_write_addr),
      .drive_write_data(drive_write_data),
      .drive_read_valid(drive_read_valid),
      .drive_read_ready(drive_read_ready),
      .drive_read_addr(drive_read_addr),
      // both lines
      .read_data(read_data),
      // memory
      .ram_enable(ram_enable),
      .ram_word(ram_word),
      .ram_wdata(ram_wdata),
      .ram_wstrb(ram_wstrb),
      .ram_rdata(ram_rdata),
      // registers
      .regs_valid(regs_valid),
      .regs_write(regs_write),
      .regs_word(regs_word),
      .regs_rdata(regs_rdata),
      // status
      .telegram_sending(drive_sending),
      .telegram_touched(telegram_touched)
  );

  mailbox_regs regs_i (
      .clk(clk),
      .rst(core_rst),
      // firmware bus
      .valid(regs_valid),
      .write(regs_write),
      .word(regs_word),
      .wdata(core_wdata[7:0]),
      .rdata(regs_rdata),
      // commands
      .queue_reply(queue_reply),
      .queue_telegram(queue_telegram),
      .listen_again(listen_again),
      .listen_stop(listen_stop),
      .watchdog_kick(watchdog_kick),
      .halt(halt),
      .loopback_close(loopback_close),
      .reply_length(reply_length),
      .telegram_length(telegram_length),
      .telegram_no_reply(telegram_no_reply),
      .led_modbus_red(led_modbus_red),
      .led_modbus_green(led_modbus_green),
      .led_drive_red(led_drive_red),
      .led_drive_green(led_drive_green),
      // status
      .events(events),
      .ticks(ticks),
      .request_ticket(ticket),
      .request_candidate(is_candidate),
      .request_committed(is_committed),
      .request_broadcast(frame_broadcast),
      .request_bank(frame_bank),
      .request_length(frame_length),
      .telegram_queued(telegram_queued),
      .telegram_sending(drive_sending),
      .telegram_started(telegram_started),
      .drive_candidate(drive_candidate),
      .drive_good(drive_good),
      .loopback_open(loopback_open)
  );

  commit_gate gate_i (
      .clk(clk),
      .rst(core_rst),
      // network request
      .candidate(candidate),
      .commit(commit),
      .revoke(revoke),
      .broadcast(frame_broadcast),
      .writes_coils(frame_writes_coils),
      .modbus_start_seen(modbus_start_seen),
      .modbus_quiet(modbus_quiet),
      // drive line
      .drive_good(drive_good),
      .drive_bad(drive_bad),
      .drive_quiet(drive_quiet && !drive_sending),
      // firmware
      .queue_reply(queue_reply),
      .reply_empty(core_wdata[`MBX_REPLY_LENGTH_BITS] == 5'd0),
      .reply_after_drive(core_wdata[`MBX_REPLY_AFTER_DRIVE_BITS]),
      .queue_telegram(queue_telegram),
      .telegram_repeat(core_wdata[`MBX_TELEGRAM_REPEAT_BITS]),
      .telegram_touched(telegram_touched),
      .queue_ticket(core_wdata[`MBX_REPLY_TICKET_BITS]),
      // configuration
      .loopback_open(loopback_open),
      // stream out
      .reply_start(reply_start),
      .telegram_start(telegram_start),
      .telegram_control(telegram_control),
      // status
      .ticket(ticket),
      .is_candidate(is_candidate),
      .is_committed(is_committed),
      .reply_queued(reply_queued),
      .telegram_queued(telegram_queued),
      .telegram_started(telegram_started)
  );

  // For waveforms only.
  wire unused = &{1'b0, reply_queued};

endmodule

`default_nettype wire
