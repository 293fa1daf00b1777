// SPDX-License-Identifier: Apache-2.0
// The card: a Modbus RTU slave on one EIA-485 line, master of a VLT drive's FC protocol on the
// other, a soft core with firmware between them.
//
// This module only wires; docs/guide/architecture.md follows a frame through the modules.
// clk: CLK_HZ, 2 to 100 MHz. rst_n: at any moment. It clears both DE at once, all else by the clock.
// Switches: index = number on the card, 1 = ON, read once after reset. LEDs: 1 = lit; red and
// green together are orange. Serial lines idle at 1, DE drives at 1.
// Rules: TOP-1, TOP-2.
`default_nettype none

// The configuration standard (configs.toml), unless the file of another one was read before.
`ifndef CONFIG_CLK_HZ
`define CONFIG_CLK_HZ 12000000
`define CONFIG_SOFT_CORE 2'd0  // picorv32
`define CONFIG_MEMORY_BYTES 8192
`endif

module rtu2fc #(
    parameter CLK_HZ = `CONFIG_CLK_HZ,  // of clk
    parameter FIRMWARE_HEX = "firmware.hex",  // the image of `make firmware`, see firmware_ram
    parameter SOFT_CORE = `CONFIG_SOFT_CORE,  // 0: PicoRV32, 1: SERV
    parameter LOCKSTEP = SOFT_CORE == 0,  // 1: PicoRV32 twice, restart if they differ (SAFE-4)
    parameter MEMORY_BYTES = `CONFIG_MEMORY_BYTES,  // program, data and frames, see bus_arbiter
    parameter MASTER_LOSS_STOP = 0,  // 1: firmware with that option may stop the drive (SAFE-7)
    parameter EXTENDED_SWITCHES = 0  // 1: 38400, 115200 bit/s and 8N1 (LINE-2, LINE-3)
) (
    input  wire       clk,
    input  wire       rst_n,
    // switches
    input  wire [9:1] sw_baud,
    input  wire [8:1] sw_addr,
    // network line
    input  wire       modbus_rx,
    output wire       modbus_tx,
    output wire       modbus_de,
    // drive line
    input  wire       drive_rx,
    output wire       drive_tx,
    output wire       drive_de,
    // LEDs
    output wire       led_modbus_red,
    output wire       led_modbus_green,
    output wire       led_drive_red,
    output wire       led_drive_green
);

  localparam [6:0] DRIVE_MASK = 7'd3;  // 9600 bit/s, see baud_divider

  // Ports, supervisor and soft core wait in reset for the switches (LINE-8).
  wire rst_asked;
  wire rst_pin;
  wire sw_ready;
  wire rst = rst_pin || !sw_ready;

  wire tick_base;
  wire tick16_modbus;
  wire tick16_drive;
  wire [7:0] ticks;
  wire baud_undivided;
  wire [6:0] baud_mask;
  wire parity_enable;
  wire parity_odd;
  wire two_stop;
  wire [8:0] half_end;
  wire half_uneven;
  wire [9:1] baud;
  wire [8:1] addr;
  wire addr_valid;

  wire core_valid;
  wire core_ready;
  wire [31:0] core_addr;
  wire [31:0] core_wdata;
  wire [3:0] core_wstrb;
  wire [31:0] core_rdata;
  wire core_trap;
  wire core_rst;
  wire ram_enable;
  wire [$clog2(MEMORY_BYTES/4)-1:0] ram_word;
  wire [31:0] ram_wdata;
  wire [3:0] ram_wstrb;
  wire [31:0] ram_rdata;
  wire ram_damaged;

  wire modbus_write_valid;
  wire modbus_write_ready;
  wire [5:0] modbus_write_addr;
  wire [7:0] modbus_write_data;
  wire modbus_read_valid;
  wire modbus_read_ready;
  wire [4:0] modbus_read_addr;
  wire reply_start;
  wire [4:0] reply_length;
  wire modbus_sending;
  wire modbus_quiet;
  wire modbus_start_seen;
  wire modbus_silent;
  wire candidate;
  wire commit;
  wire revoke;
  wire [7:0] frame_length;
  wire frame_broadcast;
  wire frame_writes_coils;
  wire frame_writes_parameter;
  wire frame_bank;
  wire count_crc;
  wire count_parity;
  wire count_framing;
  wire count_t15;
  wire count_overrun;
  wire count_foreign;

  wire drive_write_valid;
  wire drive_write_ready;
  wire [4:0] drive_write_addr;
  wire [7:0] drive_write_data;
  wire drive_read_valid;
  wire drive_read_ready;
  wire [4:0] drive_read_addr;
  wire telegram_start;
  wire [4:0] telegram_length;
  wire telegram_no_reply;
  wire telegram_control;
  wire telegram_stop;
  wire listen_again;
  wire listen_stop;
  wire drive_listening;
  wire drive_sending;
  wire drive_quiet;
  wire drive_start_seen;
  wire drive_candidate;
  wire drive_good;
  wire drive_bad;

  wire [7:0] frame_read_data;
  wire regs_valid;
  wire regs_write;
  wire [2:0] regs_word;
  wire [31:0] regs_rdata;
  wire telegram_touched;

  wire watchdog_kick;
  wire halt;
  wire loopback_close;
  wire gate_fault;
  wire network_fault;
  wire loopback_open;
  wire loopback_heard;
  wire [7:0] restarts;
  wire fault;
  wire modbus_driven;
  wire drive_driven;
  wire lit_modbus_red;
  wire lit_modbus_green;
  wire lit_drive_red;
  wire lit_drive_green;
  wire strict_t15;
  wire break_tolerant;

  // docs/hardening.md, Faults of guarded bits, Memory parity (SAFE-4)
  wire flipped = ram_damaged || network_fault || gate_fault;

  // On a fault both LEDs are red, whatever the firmware has set (LED-5).
  assign led_modbus_red = lit_modbus_red || fault;
  assign led_modbus_green = lit_modbus_green && !fault;
  assign led_drive_red = lit_drive_red || fault;
  assign led_drive_green = lit_drive_green && !fault;

  reset_sync reset_i (
      .clk  (clk),
      .rst_n(rst_n),
      // status
      .asked(rst_asked),
      .rst  (rst_pin)
  );

  baud_base #(
      .CLK_HZ(CLK_HZ)
  ) baud_i (
      .clk(clk),
      .rst(rst_pin),
      // stream out
      .tick_base(tick_base)
  );

  card_tables #(
      .EXTENDED_SWITCHES(EXTENDED_SWITCHES == 1)
  ) tables_i (
      .sw_baud(baud[5:1]),
      .baud_undivided(baud_undivided),
      .baud_mask(baud_mask),
      .parity_enable(parity_enable),
      .parity_odd(parity_odd),
      .two_stop(two_stop),
      .half_end(half_end),
      .half_uneven(half_uneven)
  );

  baud_divider divider_i (
      .clk(clk),
      // stream in
      .tick_base(tick_base),
      // stream out
      .tick16_modbus(tick16_modbus),
      .tick16_drive(tick16_drive),
      // configuration
      .modbus_undivided(baud_undivided),
      .modbus_mask(baud_mask)
  );

  switch_sampler switches_i (
      .clk(clk),
      .rst(rst_pin),
      .settled(ticks[0]),
      // pins
      .sw_baud(sw_baud),
      .sw_addr(sw_addr),
      // status
      .ready(sw_ready),
      .baud(baud),
      .addr(addr),
      .addr_valid(addr_valid)
  );

  card_time time_i (
      .clk(clk),
      .rst(rst_pin),
      .tick16(tick16_drive),
      // status
      .ticks(ticks)
  );

  network_port network_i (
      .clk(clk),
      .rst(rst || fault),
      .tick16(tick16_modbus),
      // frame memory
      .write_valid(modbus_write_valid),
      .write_ready(modbus_write_ready),
      .write_addr(modbus_write_addr),
      .write_data(modbus_write_data),
      .read_valid(modbus_read_valid),
      .read_ready(modbus_read_ready),
      .read_addr(modbus_read_addr),
      .read_data(frame_read_data),
      .read_damaged(ram_damaged),
      // stream in
      .reply_start(reply_start),
      .reply_length(reply_length),
      // pins
      .rx(modbus_rx),
      .tx(modbus_tx),
      .de(modbus_driven),
      // configuration
      .parity_enable(parity_enable),
      .parity_odd(parity_odd),
      .two_stop(two_stop),
      .half_end(half_end),
      .half_uneven(half_uneven),
      .strict_t15(strict_t15),
      .break_tolerant(break_tolerant),
      .own_address(addr),
      .loopback_open(loopback_open),
      // status
      .sending(modbus_sending),
      .quiet(modbus_quiet),
      .start_seen(modbus_start_seen),
      .silent(modbus_silent),
      .fault(network_fault),
      // newest frame
      .candidate(candidate),
      .commit(commit),
      .revoke(revoke),
      .frame_length(frame_length),
      .frame_broadcast(frame_broadcast),
      .frame_writes_coils(frame_writes_coils),
      .frame_writes_parameter(frame_writes_parameter),
      .frame_bank(frame_bank),
      // dropped frames
      .count_crc(count_crc),
      .count_parity(count_parity),
      .count_framing(count_framing),
      .count_t15(count_t15),
      .count_overrun(count_overrun),
      .count_foreign(count_foreign)
  );

  drive_port drive_i (
      .clk(clk),
      .rst(rst || fault),
      .tick16(tick16_drive),
      // frame memory
      .write_valid(drive_write_valid),
      .write_ready(drive_write_ready),
      .write_addr(drive_write_addr),
      .write_data(drive_write_data),
      .read_valid(drive_read_valid),
      .read_ready(drive_read_ready),
      .read_addr(drive_read_addr),
      .read_data(frame_read_data),
      // stream in
      .telegram_start(telegram_start),
      .telegram_length(telegram_length),
      .telegram_no_reply(telegram_no_reply),
      .telegram_control(telegram_control),
      .telegram_stop(telegram_stop),
      // pins
      .rx(drive_rx),
      .tx(drive_tx),
      .de(drive_driven),
      // configuration
      .listen_again(listen_again),
      .listen_stop(listen_stop),
      // status
      .listening(drive_listening),
      .sending(drive_sending),
      .quiet(drive_quiet),
      .start_seen(drive_start_seen),
      .candidate(drive_candidate),
      .good(drive_good),
      .bad(drive_bad)
  );

  driver_limit modbus_limit_i (
      .clk(clk),
      .rst_n(rst_n),
      .rst(rst_asked),
      // time, in 1/1200 s
      .ticks(ticks[6:0]),
      // configuration
      .mask(baud_mask),
      // direction
      .driven(modbus_driven),
      // pin
      .de(modbus_de)
  );

  driver_limit drive_limit_i (
      .clk(clk),
      .rst_n(rst_n),
      .rst(rst_asked),
      // time, in 1/1200 s
      .ticks(ticks[6:0]),
      // configuration
      .mask(DRIVE_MASK),
      // direction
      .driven(drive_driven),
      // pin
      .de(drive_de)
  );

  mailbox #(
      .MASTER_LOSS_STOP(MASTER_LOSS_STOP == 1),
      // The memory of the small card holds only the dialect that never sends a second telegram.
      .SECOND_TELEGRAM (SOFT_CORE == 0)
  ) mailbox_i (
      .clk(clk),
      .core_rst(core_rst),
      // registers
      .regs_valid(regs_valid),
      .regs_write(regs_write),
      .regs_word(regs_word),
      .regs_wdata(core_wdata),
      .regs_rdata(regs_rdata),
      .telegram_touched(telegram_touched),
      // network port
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
      // drive port
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
      // supervisor
      .watchdog_kick(watchdog_kick),
      .halt(halt),
      .loopback_close(loopback_close),
      .fault(gate_fault),
      .loopback_open(loopback_open),
      .loopback_heard(loopback_heard),
      // Only the diagnostic functions tell the restarts, and they do not fit the small card.
      .restarts(SOFT_CORE == 0 ? restarts : 8'd0),
      // status
      .ticks(ticks),
      // LEDs
      .lit_modbus_red(lit_modbus_red),
      .lit_modbus_green(lit_modbus_green),
      .lit_drive_red(lit_drive_red),
      .lit_drive_green(lit_drive_green),
      // options of the network line
      .strict_t15(strict_t15),
      .break_tolerant(break_tolerant)
  );

  supervisor supervisor_i (
      .clk(clk),
      .rst(rst),
      .beat(ticks[5]),
      // firmware
      .kick(watchdog_kick),
      .halt(halt),
      .loopback_close(loopback_close),
      .core_trap(core_trap || flipped),
      // line activity
      .start_seen(modbus_start_seen || drive_start_seen),
      .driven(modbus_driven || drive_driven),
      // configuration
      .sw_baud(baud),
      .address_valid(addr_valid),
      // status
      .reply_start(reply_start),
      .drive_good(drive_good),
      .core_rst(core_rst),
      .fault(fault),
      .loopback_open(loopback_open),
      .loopback_heard(loopback_heard),
      .restarts(restarts)
  );

  soft_core #(
      .SOFT_CORE(SOFT_CORE),
      .LOCKSTEP (LOCKSTEP)
  ) core_i (
      .clk(clk),
      .rst(core_rst),
      // bus
      .bus_valid(core_valid),
      .bus_ready(core_ready),
      .bus_addr(core_addr),
      .bus_wdata(core_wdata),
      .bus_wstrb(core_wstrb),
      .bus_rdata(core_rdata),
      // status
      .trap(core_trap)
  );

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
      .read_data(frame_read_data),
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

  firmware_ram #(
      .BYTES(MEMORY_BYTES),
      .FIRMWARE_HEX(FIRMWARE_HEX)
  ) ram_i (
      .clk(clk),
      // bus
      .enable(ram_enable),
      .word(ram_word),
      .wdata(ram_wdata),
      .wstrb(ram_wstrb),
      .rdata(ram_rdata),
      // status
      .damaged(ram_damaged)
  );

  // A module that does not exist stops every tool and names the mistake.
  generate
    if (MASTER_LOSS_STOP != 0 && MASTER_LOSS_STOP != 1) begin : g_loss_mistake
      MASTER_LOSS_STOP_is_neither_0_nor_1 mistake_i ();
    end
    if (EXTENDED_SWITCHES != 0 && EXTENDED_SWITCHES != 1) begin : g_switches_mistake
      EXTENDED_SWITCHES_is_neither_0_nor_1 mistake_i ();
    end
  endgenerate

  // For waveforms and benches only.
  wire unused = &{1'b0, modbus_sending, drive_listening};

endmodule

`default_nettype wire
