// SPDX-License-Identifier: Apache-2.0
// Shares the one memory between both lines and the soft core, and routes the soft core's
// register accesses.
//
// The lines have priority: each asks once a character, hundreds of clocks apart, for one clock.
// The network line never waits. The drive line waits for one clock at most. The soft core waits
// while a line asks. Only a write to a register never waits: with a wait, the path from the lines
// through the arbiter to the commit gate was the longest of the small card.
// Each line has its own byte lane in the 64 words of the frame memory (regs/mailbox.rdl): the
// network line writes lane 1, the drive line writes lane 2, both read lane 0.
// A soft core access takes at least two clocks: valid, then ready with the data. rst is the soft
// core's reset: with it high the soft core reaches neither memory nor registers. The lines do,
// because a restart of the soft core does not stop them (WDG-1).
// Addresses from 80000000h on are registers, unless bit 10 is set. All other addresses are
// memory, repeated over the address space. MEMORY_BYTES is a power of two or three quarters of
// one; in the latter case the last quarter appears twice, so that the last address is always
// the last byte.
// The frame memory is the last 256 bytes of the memory. A write by the soft core to the telegram
// is dropped while that telegram is on the wire. At any other time telegram_touched reports it
// from the first clock on, by whatever address it comes, because it ends the licence (SAFE-1).
// Clock domain: clk. Rules: FRAME-5, SAFE-1, SAFE-5.
`default_nettype none

module bus_arbiter #(
    parameter MEMORY_BYTES = 8192
) (
    input  wire                              clk,
    input  wire                              rst,
    // soft core
    input  wire                              core_valid,
    output reg                               core_ready,
    input  wire [                      31:0] core_addr,
    input  wire [                      31:0] core_wdata,
    input  wire [                       3:0] core_wstrb,
    output wire [                      31:0] core_rdata,
    // network line
    input  wire                              modbus_write_valid,
    output wire                              modbus_write_ready,
    input  wire [                       5:0] modbus_write_addr,
    input  wire [                       7:0] modbus_write_data,
    input  wire                              modbus_read_valid,
    output wire                              modbus_read_ready,
    input  wire [                       4:0] modbus_read_addr,
    // drive line
    input  wire                              drive_write_valid,
    output wire                              drive_write_ready,
    input  wire [                       4:0] drive_write_addr,
    input  wire [                       7:0] drive_write_data,
    input  wire                              drive_read_valid,
    output wire                              drive_read_ready,
    input  wire [                       4:0] drive_read_addr,
    // both lines
    output wire [                       7:0] read_data,
    // memory
    output wire                              ram_enable,
    output wire [$clog2(MEMORY_BYTES/4)-1:0] ram_word,
    output wire [                      31:0] ram_wdata,
    output wire [                       3:0] ram_wstrb,
    input  wire [                      31:0] ram_rdata,
    // registers
    output wire                              regs_valid,
    output wire                              regs_write,
    output wire [                       2:0] regs_word,
    input  wire [                      31:0] regs_rdata,
    // status
    input  wire                              telegram_sending,
    output wire                              telegram_touched
);

  localparam WORD_BITS = $clog2(MEMORY_BYTES / 4);
  localparam [31:0] LAST = MEMORY_BYTES / 4 - 1;
  // First words of the frames (regs/mailbox.rdl).
  localparam [5:0] TELEGRAM = 6'h20;
  localparam [5:0] REPLY = 6'h00;
  localparam [5:0] DRIVE = 6'h00;

  // A module that does not exist stops every tool and names the mistake.
  localparam THIRD = MEMORY_BYTES % 3 == 0 ? MEMORY_BYTES / 3 : MEMORY_BYTES;
  generate
    if (MEMORY_BYTES < 1024 || (THIRD & (THIRD - 1)) != 0) begin : g_mistake
      MEMORY_BYTES_is_neither_a_power_of_two_nor_three_quarters_of_one mistake_i ();
    end
  endgenerate

  wire modbus_valid = modbus_write_valid || modbus_read_valid;
  wire drive_valid = drive_write_valid || drive_read_valid;
  wire line_valid = modbus_valid || drive_valid;

  wire [5:0] modbus_slot = modbus_write_valid ? modbus_write_addr : {REPLY[5], modbus_read_addr};
  wire [5:0] drive_slot =
      drive_write_valid ? {DRIVE[5], drive_write_addr} : {TELEGRAM[5], drive_read_addr};
  wire [5:0] line_slot = modbus_valid ? modbus_slot : drive_slot;

  // In reset the soft core's bus may show a write, whatever its registers hold (SAFE-5).
  wire core_asks = core_valid && !core_ready && !rst;
  wire to_regs = core_addr[31] && !core_addr[10];
  wire to_ram = core_asks && !to_regs && !line_valid;
  // With three quarters of a power of two, the fourth quarter is mapped to the third.
  wire [WORD_BITS-1:0] core_word = {
    core_addr[WORD_BITS+1],
    core_addr[WORD_BITS] && (LAST[WORD_BITS-2] || !core_addr[WORD_BITS+1]),
    core_addr[WORD_BITS-1:2]
  };
  wire is_telegram = core_word[WORD_BITS-1:5] == {LAST[WORD_BITS-1:6], TELEGRAM[5]};
  wire telegram_write = core_asks && !to_regs && is_telegram && core_wstrb[0];
  wire drive_turn = !modbus_valid;

  assign modbus_write_ready = modbus_write_valid;
  assign modbus_read_ready = modbus_read_valid;
  assign drive_write_ready = drive_write_valid && drive_turn;
  assign drive_read_ready = drive_read_valid && drive_turn;

  assign ram_enable = line_valid || to_ram;
  assign ram_word = line_valid ? {LAST[WORD_BITS-1:6], line_slot} : core_word;
  assign ram_wdata = {
    core_wdata[31:24],
    drive_write_valid ? drive_write_data : core_wdata[23:16],
    modbus_write_valid ? modbus_write_data : core_wdata[15:8],
    core_wdata[7:0]
  };
  assign ram_wstrb = {
    to_ram && core_wstrb[3],
    drive_write_ready || (to_ram && core_wstrb[2]),
    modbus_write_ready || (to_ram && core_wstrb[1]),
    to_ram && core_wstrb[0] && !(is_telegram && telegram_sending)
  };
  assign telegram_touched = telegram_write && !telegram_sending;

  assign regs_valid = core_asks && to_regs && (regs_write || !line_valid);
  assign regs_write = core_wstrb != 4'd0;
  assign regs_word = core_addr[4:2];

  // Both inputs are 0 unless they were read in the clock before.
  assign core_rdata = ram_rdata | regs_rdata;
  assign read_data = core_rdata[7:0];

  initial core_ready = 1'b0;

  always @(posedge clk) core_ready <= to_ram || regs_valid;

  wire unused = &{1'b0, core_addr[30:WORD_BITS+2], core_addr[1:0]};

endmodule

`default_nettype wire
