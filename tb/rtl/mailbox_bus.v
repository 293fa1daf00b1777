// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: the mailbox with the arbiter, wired as on the card; the memory's pins come out.
`default_nettype none

module mailbox_bus #(
    parameter MEMORY_BYTES = 8192,
    parameter [0:0] MASTER_LOSS_STOP = 1'b0
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
    input  wire                              modbus_silent,
    input  wire                              candidate,
    input  wire                              commit,
    input  wire                              revoke,
    input  wire [                       7:0] frame_length,
    input  wire                              frame_broadcast,
    input  wire                              frame_writes_coils,
    input  wire                              frame_writes_parameter,
    input  wire                              frame_bank,
    input  wire                              count_crc,
    input  wire                              count_parity,
    input  wire                              count_framing,
    input  wire                              count_t15,
    input  wire                              count_overrun,
    input  wire                              count_foreign,
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
    output wire                              telegram_stop,
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
    output wire                              fault,
    input  wire                              loopback_open,
    input  wire                              loopback_heard,
    input  wire [                       7:0] restarts,
    // status
    input  wire [                       7:0] ticks,
    // LEDs
    output wire                              lit_modbus_red,
    output wire                              lit_modbus_green,
    output wire                              lit_drive_red,
    output wire                              lit_drive_green
);

  wire regs_valid;
  wire regs_write;
  wire [2:0] regs_word;
  wire [31:0] regs_rdata;
  wire telegram_touched;

  bus_arbiter #(
      .MEMORY_BYTES(MEMORY_BYTES)
  ) arbiter_i (
      .clk(clk),
      .rst(core_rst),
      .core_valid(core_valid),
      .core_ready(core_ready),
      .core_addr(core_addr),
      .core_wdata(core_wdata),
      .core_wstrb(core_wstrb),
      .core_rdata(core_rdata),
      .modbus_write_valid(modbus_write_valid),
      .modbus_write_ready(modbus_write_ready),
      .modbus_write_addr(modbus_write_addr),
      .modbus_write_data(modbus_write_data),
      .modbus_read_valid(modbus_read_valid),
      .modbus_read_ready(modbus_read_ready),
      .modbus_read_addr(modbus_read_addr),
      .drive_write_valid(drive_write_valid),
      .drive_write_ready(drive_write_ready),
      .drive_write_addr(drive_write_addr),
      .drive_write_data(drive_write_data),
      .drive_read_valid(drive_read_valid),
      .drive_read_ready(drive_read_ready),
      .drive_read_addr(drive_read_addr),
      .read_data(read_data),
      .ram_enable(ram_enable),
      .ram_word(ram_word),
      .ram_wdata(ram_wdata),
      .ram_wstrb(ram_wstrb),
      .ram_rdata(ram_rdata),
      .regs_valid(regs_valid),
      .regs_write(regs_write),
      .regs_word(regs_word),
      .regs_rdata(regs_rdata),
      .telegram_sending(drive_sending),
      .telegram_touched(telegram_touched)
  );

  mailbox #(
      .MASTER_LOSS_STOP(MASTER_LOSS_STOP)
  ) mailbox_i (
      .clk(clk),
      .core_rst(core_rst),
      .regs_valid(regs_valid),
      .regs_write(regs_write),
      .regs_word(regs_word),
      .regs_wdata(core_wdata),
      .regs_rdata(regs_rdata),
      .telegram_touched(telegram_touched),
      .reply_start(reply_start),
      .reply_length(reply_length),
      .modbus_quiet(modbus_quiet),
      .modbus_start_seen(modbus_start_seen),
      .modbus_silent(modbus_silent),
      .candidate(candidate),
      .commit(commit),
      .revoke(revoke),
      .frame_length(frame_length),
      .frame_broadcast(frame_broadcast),
      .frame_writes_coils(frame_writes_coils),
      .frame_writes_parameter(frame_writes_parameter),
      .frame_bank(frame_bank),
      .count_crc(count_crc),
      .count_parity(count_parity),
      .count_framing(count_framing),
      .count_t15(count_t15),
      .count_overrun(count_overrun),
      .count_foreign(count_foreign),
      .telegram_start(telegram_start),
      .telegram_length(telegram_length),
      .telegram_no_reply(telegram_no_reply),
      .telegram_control(telegram_control),
      .telegram_stop(telegram_stop),
      .listen_again(listen_again),
      .listen_stop(listen_stop),
      .drive_sending(drive_sending),
      .drive_quiet(drive_quiet),
      .drive_candidate(drive_candidate),
      .drive_good(drive_good),
      .drive_bad(drive_bad),
      .watchdog_kick(watchdog_kick),
      .halt(halt),
      .loopback_close(loopback_close),
      .fault(fault),
      .loopback_open(loopback_open),
      .loopback_heard(loopback_heard),
      .restarts(restarts),
      .ticks(ticks),
      .lit_modbus_red(lit_modbus_red),
      .lit_modbus_green(lit_modbus_green),
      .lit_drive_red(lit_drive_red),
      .lit_drive_green(lit_drive_green)
  );

endmodule

`default_nettype wire
