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
  wire ram_valid;
  wire ram_ready;
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

  bus_decode decode_i (
      .core_valid(core_valid),
      .core_ready(core_ready),
      .core_addr(core_addr),
      .core_wstrb(core_wstrb),
      .core_rdata(core_rdata),
      .ram_valid(ram_valid),
      .ram_ready(ram_ready),
      .ram_rdata(ram_rdata),
      .mailbox_valid(mailbox_valid),
      .mailbox_ready(mailbox_ready),
      .mailbox_write(mailbox_write),
      .mailbox_word(mailbox_word),
      .mailbox_rdata(mailbox_rdata)
  );

  firmware_ram #(
      .BYTES(BYTES),
      .FIRMWARE_HEX(FIRMWARE_HEX)
  ) ram_i (
      .clk(clk),
      .rst(rst),
      .bus_valid(ram_valid),
      .bus_ready(ram_ready),
      .bus_addr(core_addr),
      .bus_wdata(mailbox_wdata),
      .bus_wstrb(core_wstrb),
      .bus_rdata(ram_rdata)
  );

endmodule

`default_nettype wire
