// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: the mailbox with the memory that holds its frames, and its vectors field by field.
`default_nettype none

module mailbox_memory #(
    parameter MEMORY_BYTES = 6144,
    parameter FIRMWARE_HEX = "firmware.hex"
) (
    input  wire        clk,
    input  wire        core_rst,
    // soft core
    input  wire        core_valid,
    output wire        core_ready,
    input  wire [31:0] core_addr,
    input  wire [31:0] core_wdata,
    input  wire [ 3:0] core_wstrb,
    output wire [31:0] core_rdata,
    // network port
    input  wire        modbus_write_valid,
    output wire        modbus_write_ready,
    input  wire [ 5:0] modbus_write_addr,
    input  wire [ 7:0] modbus_write_data,
    input  wire        modbus_read_valid,
    output wire        modbus_read_ready,
    input  wire [ 4:0] modbus_read_addr,
    output wire        reply_start,
    output wire [ 4:0] reply_length,
    input  wire        modbus_quiet,
    input  wire        modbus_start_seen,
    input  wire        candidate,
    input  wire        commit,
    input  wire        revoke,
    input  wire [ 7:0] frame_length,
    input  wire        frame_broadcast,
    input  wire        frame_writes_coils,
    input  wire        frame_bank,
    input  wire        modbus_silent,
    // drive port
    input  wire        drive_write_valid,
    output wire        drive_write_ready,
    input  wire [ 4:0] drive_write_addr,
    input  wire [ 7:0] drive_write_data,
    input  wire        drive_read_valid,
    output wire        drive_read_ready,
    input  wire [ 4:0] drive_read_addr,
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
    // both ports
    output wire [ 7:0] read_data,
    // supervisor
    output wire        watchdog_kick,
    output wire        halt,
    output wire        loopback_close,
    output wire        fault,
    input  wire        loopback_open,
    // status
    input  wire [ 7:0] ticks,
    input  wire        count_crc,
    input  wire        count_parity,
    input  wire        count_framing,
    input  wire        count_t15,
    input  wire        count_overrun,
    input  wire        count_foreign,
    output wire [ 3:0] leds
);

  wire ram_enable;
  wire [$clog2(MEMORY_BYTES/4)-1:0] ram_word;
  wire [31:0] ram_wdata;
  wire [3:0] ram_wstrb;
  wire [31:0] ram_rdata;

  mailbox #(
      .MEMORY_BYTES(MEMORY_BYTES)
  ) mailbox_i (
      .clk(clk),
      .core_rst(core_rst),
      .core_valid(core_valid),
      .core_ready(core_ready),
      .core_addr(core_addr),
      .core_wdata(core_wdata),
      .core_wstrb(core_wstrb),
      .core_rdata(core_rdata),
      .ram_enable(ram_enable),
      .ram_word(ram_word),
      .ram_wdata(ram_wdata),
      .ram_wstrb(ram_wstrb),
      .ram_rdata(ram_rdata),
      .modbus_write_valid(modbus_write_valid),
      .modbus_write_ready(modbus_write_ready),
      .modbus_write_addr(modbus_write_addr),
      .modbus_write_data(modbus_write_data),
      .modbus_read_valid(modbus_read_valid),
      .modbus_read_ready(modbus_read_ready),
      .modbus_read_addr(modbus_read_addr),
      .reply_start(reply_start),
      .reply_length(reply_length),
      .modbus_quiet(modbus_quiet),
      .modbus_start_seen(modbus_start_seen),
      .request({
        modbus_silent,
        frame_length,
        frame_bank,
        frame_writes_coils,
        frame_broadcast,
        commit,
        candidate
      }),
      .network_events({
        count_foreign, revoke, count_overrun, count_t15, count_framing, count_parity, count_crc
      }),
      .drive_write_valid(drive_write_valid),
      .drive_write_ready(drive_write_ready),
      .drive_write_addr(drive_write_addr),
      .drive_write_data(drive_write_data),
      .drive_read_valid(drive_read_valid),
      .drive_read_ready(drive_read_ready),
      .drive_read_addr(drive_read_addr),
      .telegram_start(telegram_start),
      .telegram({telegram_stop, telegram_control, telegram_no_reply, telegram_length}),
      .listen_again(listen_again),
      .listen_stop(listen_stop),
      .exchange({drive_bad, drive_good, drive_candidate, drive_quiet, drive_sending}),
      .read_data(read_data),
      .supervision({fault, loopback_close, halt, watchdog_kick}),
      .loopback_open(loopback_open),
      .ticks(ticks),
      .leds(leds)
  );

  firmware_ram #(
      .BYTES(MEMORY_BYTES),
      .FIRMWARE_HEX(FIRMWARE_HEX)
  ) ram_i (
      .clk(clk),
      .enable(ram_enable),
      .word(ram_word),
      .wdata(ram_wdata),
      .wstrb(ram_wstrb),
      .rdata(ram_rdata),
      // status
      .damaged()
  );

endmodule

`default_nettype wire
