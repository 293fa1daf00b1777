// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: the soft core with its memory; the mailbox's side of the bus is open.
`default_nettype none

module core_and_memory #(
    parameter [1:0] SOFT_CORE = 2'd0,
    parameter BYTES = 1024,
    parameter FIRMWARE_HEX = "firmware.hex"
) (
    input  wire        clk,
    input  wire        rst,
    // mailbox
    output wire        mailbox_valid,
    input  wire        mailbox_ready,
    output wire        mailbox_write,
    output wire [ 8:0] mailbox_word,
    output wire [31:0] mailbox_wdata,
    input  wire [15:0] mailbox_rdata,
    // status
    output wire        core_valid,
    output wire [31:0] core_addr,
    output wire        trap
);

  wire core_ready;
  wire [3:0] core_wstrb;
  wire [31:0] core_rdata;
  wire [31:0] ram_rdata;

  soft_core #(
      .SOFT_CORE(SOFT_CORE)
  ) core_i (
      .clk(clk),
      .rst(rst),
      .bus_valid(core_valid),
      .bus_ready(core_ready),
      .bus_addr(core_addr),
      .bus_wdata(mailbox_wdata),
      .bus_wstrb(core_wstrb),
      .bus_rdata(core_rdata),
      .trap(trap)
  );

  // As in bus_arbiter while no line asks, but the mailbox may delay its answer.
  wire to_mailbox = core_addr[31];
  reg  ram_ready = 1'b0;
  wire ram_valid = core_valid && !to_mailbox && !ram_ready;

  assign mailbox_valid = core_valid && to_mailbox;
  assign mailbox_write = core_wstrb != 4'd0;
  assign mailbox_word  = core_addr[10:2];
  assign core_ready    = to_mailbox ? mailbox_ready : ram_ready;
  assign core_rdata    = to_mailbox ? {16'd0, mailbox_rdata} : ram_rdata;

  always @(posedge clk) ram_ready <= ram_valid && !rst;

  firmware_ram #(
      .BYTES(BYTES),
      .FIRMWARE_HEX(FIRMWARE_HEX)
  ) ram_i (
      .clk(clk),
      .enable(ram_valid),
      .word(core_addr[$clog2(BYTES/4)+1:2]),
      .wdata(mailbox_wdata),
      .wstrb(core_wstrb & {4{ram_valid}}),
      .rdata(ram_rdata),
      // status
      .damaged()
  );

endmodule

`default_nettype wire
