// SPDX-License-Identifier: Apache-2.0
// The mailbox: registers, commit gate, frame memory and counters, wired together.
//
// The network port writes requests and reads replies, the drive port reads telegrams
// and writes the drive's replies, the firmware sees all of it through one bus, and
// the commit gate decides what leaves. Only wires in here. Clock domain: clk.
// Rules: FRAME-5, FRAME-6, FRAME-7, SAFE-1.
`default_nettype none

module mailbox #(
    parameter [0:0] STRICT_T15 = 1'b1,
    parameter [0:0] PREPARE_EARLY = 1'b1,
    parameter [1:0] SOFT_CORE_ID = 2'd0,
    parameter [31:0] CLK_HZ = 12_000_000
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        core_rst,
    // firmware bus
    input  wire        bus_valid,
    output wire        bus_ready,
    input  wire        bus_write,
    input  wire [ 8:0] bus_word,
    input  wire [15:0] bus_wdata,
    output wire [15:0] bus_rdata,
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
    input  wire        modbus_sending,
    input  wire        modbus_quiet,
    input  wire        modbus_start_seen,
    input  wire        candidate,
    input  wire        commit,
    input  wire        revoke,
    input  wire [ 8:0] frame_length,
    input  wire        frame_broadcast,
    input  wire        frame_bank,
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
    output wire        listen_again,
    output wire        listen_stop,
    input  wire        drive_sending,
    input  wire        drive_quiet,
    input  wire        drive_listening,
    input  wire        drive_candidate,
    input  wire        drive_good,
    input  wire        drive_bad,
    input  wire [ 7:0] drive_lge,
    // both ports
    output wire [ 7:0] read_data,
    // supervisor
    output wire        watchdog_kick,
    output wire        halt,
    output wire        loopback_close,
    input  wire        loopback_open,
    input  wire [ 1:0] watchdog_bites,
    // status
    input  wire [ 9:1] sw_baud,
    input  wire [ 8:1] sw_addr,
    input  wire [15:0] ms,
    input  wire        count_crc,
    input  wire        count_parity,
    input  wire        count_framing,
    input  wire        count_t15,
    input  wire        count_overrun,
    output wire        led_modbus_red,
    output wire        led_modbus_green,
    output wire        led_drive_red,
    output wire        led_drive_green
);

  localparam [7:0] REQUEST_AREA = `MBX_REQUEST_FRAME_0_INDEX;
  localparam [7:0] REPLY_AREA = `MBX_REPLY_FRAME_INDEX;
  localparam [7:0] TELEGRAM_AREA = `MBX_TELEGRAM_FRAME_INDEX;
  localparam [7:0] DRIVE_AREA = `MBX_DRIVE_FRAME_INDEX;
  localparam [7:0] COUNT_AREA = `MBX_COUNT_CRC_INDEX;

  wire cpu_write_valid;
  wire cpu_write_ready;
  wire cpu_read_valid;
  wire cpu_read_ready;
  wire [7:0] cpu_addr;
  wire [7:0] cpu_write_data;
  wire count_write_valid;
  wire count_write_ready;
  wire count_read_valid;
  wire count_read_ready;
  wire [4:0] count_addr;
  wire [7:0] count_write_data;
  wire ram_write_enable;
  wire [7:0] ram_write_addr;
  wire [7:0] ram_write_data;
  wire [7:0] ram_read_addr;
  wire queue_reply;
  wire queue_telegram;
  wire telegram_touched;
  wire [3:0] ticket;
  wire is_candidate;
  wire is_committed;
  wire reply_queued;
  wire telegram_queued;
  wire telegram_started;

  mailbox_regs #(
      .STRICT_T15(STRICT_T15),
      .PREPARE_EARLY(PREPARE_EARLY),
      .SOFT_CORE_ID(SOFT_CORE_ID),
      .CLK_HZ(CLK_HZ)
  ) regs_i (
      .clk(clk),
      .rst(core_rst),
      // firmware bus
      .bus_valid(bus_valid),
      .bus_ready(bus_ready),
      .bus_write(bus_write),
      .bus_word(bus_word),
      .bus_wdata(bus_wdata),
      .bus_rdata(bus_rdata),
      // frame memory
      .write_valid(cpu_write_valid),
      .write_ready(cpu_write_ready),
      .read_valid(cpu_read_valid),
      .read_ready(cpu_read_ready),
      .frame_addr(cpu_addr),
      .write_data(cpu_write_data),
      .read_data(read_data),
      // commands
      .queue_reply(queue_reply),
      .queue_telegram(queue_telegram),
      .telegram_touched(telegram_touched),
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
      .sw_baud(sw_baud),
      .sw_addr(sw_addr),
      .ms(ms),
      .request_ticket(ticket),
      .request_candidate(is_candidate),
      .request_committed(is_committed),
      .request_broadcast(frame_broadcast),
      .request_bank(frame_bank),
      .request_length(frame_length),
      .reply_queued(reply_queued),
      .reply_sending(modbus_sending),
      .telegram_queued(telegram_queued),
      .telegram_sending(drive_sending),
      .telegram_started(telegram_started),
      .drive_listening(drive_listening),
      .drive_candidate(drive_candidate),
      .drive_good(drive_good),
      .drive_lge(drive_lge),
      .loopback_open(loopback_open),
      .watchdog_bites(watchdog_bites)
  );

  commit_gate gate_i (
      .clk(clk),
      .rst(core_rst),
      // network request
      .candidate(candidate),
      .commit(commit),
      .revoke(revoke),
      .broadcast(frame_broadcast),
      .modbus_start_seen(modbus_start_seen),
      .modbus_quiet(modbus_quiet),
      // drive line
      .drive_good(drive_good),
      .drive_bad(drive_bad),
      .drive_quiet(drive_quiet && !drive_sending),
      // firmware
      .queue_reply(queue_reply),
      .reply_empty(bus_wdata[`MBX_REPLY_LENGTH_BITS] == 5'd0),
      .reply_after_drive(bus_wdata[`MBX_REPLY_AFTER_DRIVE_BITS]),
      .queue_telegram(queue_telegram),
      .telegram_repeat(bus_wdata[`MBX_TELEGRAM_REPEAT_BITS]),
      .telegram_touched(telegram_touched),
      .queue_ticket(bus_wdata[`MBX_REPLY_TICKET_BITS]),
      // configuration
      .loopback_open(loopback_open),
      // stream out
      .reply_start(reply_start),
      .telegram_start(telegram_start),
      // status
      .ticket(ticket),
      .is_candidate(is_candidate),
      .is_committed(is_committed),
      .reply_queued(reply_queued),
      .telegram_queued(telegram_queued),
      .telegram_started(telegram_started)
  );

  event_counters #(
      .EVENTS(7)
  ) counters_i (
      .clk(clk),
      .rst(rst),
      // stream in
      .events({
        drive_bad, revoke, count_overrun, count_t15, count_framing, count_parity, count_crc
      }),
      // frame memory, 32 bytes
      .read_valid(count_read_valid),
      .read_ready(count_read_ready),
      .read_data(read_data),
      .write_valid(count_write_valid),
      .write_ready(count_write_ready),
      .addr(count_addr),
      .write_data(count_write_data)
  );

  frame_arbiter arbiter_i (
      // network line
      .modbus_write_valid(modbus_write_valid),
      .modbus_write_ready(modbus_write_ready),
      .modbus_write_addr({REQUEST_AREA[7:6], modbus_write_addr}),
      .modbus_write_data(modbus_write_data),
      .modbus_read_valid(modbus_read_valid),
      .modbus_read_ready(modbus_read_ready),
      .modbus_read_addr({REPLY_AREA[7:5], modbus_read_addr}),
      // drive line
      .drive_write_valid(drive_write_valid),
      .drive_write_ready(drive_write_ready),
      .drive_write_addr({DRIVE_AREA[7:5], drive_write_addr}),
      .drive_write_data(drive_write_data),
      .drive_read_valid(drive_read_valid),
      .drive_read_ready(drive_read_ready),
      .drive_read_addr({TELEGRAM_AREA[7:5], drive_read_addr}),
      // counters
      .count_write_valid(count_write_valid),
      .count_write_ready(count_write_ready),
      .count_addr({COUNT_AREA[7:5], count_addr}),
      .count_write_data(count_write_data),
      .count_read_valid(count_read_valid),
      .count_read_ready(count_read_ready),
      // firmware
      .cpu_write_valid(cpu_write_valid),
      .cpu_write_ready(cpu_write_ready),
      .cpu_addr(cpu_addr),
      .cpu_write_data(cpu_write_data),
      .cpu_read_valid(cpu_read_valid),
      .cpu_read_ready(cpu_read_ready),
      // memory
      .write_enable(ram_write_enable),
      .write_addr(ram_write_addr),
      .write_data(ram_write_data),
      .read_addr(ram_read_addr)
  );

  frame_ram ram_i (
      .clk(clk),
      // write port
      .write_enable(ram_write_enable),
      .write_addr(ram_write_addr),
      .write_data(ram_write_data),
      // read port
      .read_addr(ram_read_addr),
      .read_data(read_data)
  );

endmodule

`default_nettype wire
