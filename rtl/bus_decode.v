// SPDX-License-Identifier: Apache-2.0
// Shares the soft core's bus out: memory from 0 on, the mailbox in the last 2 KiB.
//
// One address bit decides. The mailbox is 16 bits wide and wants whole words: any
// write strobe writes it. Combinational.
`default_nettype none

module bus_decode (
    // soft core
    input  wire        core_valid,
    output wire        core_ready,
    input  wire [31:0] core_addr,
    input  wire [ 3:0] core_wstrb,
    output wire [31:0] core_rdata,
    // memory
    output wire        ram_valid,
    input  wire        ram_ready,
    input  wire [31:0] ram_rdata,
    // mailbox
    output wire        mailbox_valid,
    input  wire        mailbox_ready,
    output wire        mailbox_write,
    output wire [ 8:0] mailbox_word,
    input  wire [15:0] mailbox_rdata
);

  wire to_mailbox = core_addr[31];

  assign ram_valid = core_valid && !to_mailbox;
  assign mailbox_valid = core_valid && to_mailbox;
  assign mailbox_write = core_wstrb != 4'd0;
  assign mailbox_word = core_addr[10:2];
  assign core_ready = to_mailbox ? mailbox_ready : ram_ready;
  assign core_rdata = to_mailbox ? {16'd0, mailbox_rdata} : ram_rdata;

  wire unused = &{1'b0, core_addr[30:11], core_addr[1:0]};

endmodule

`default_nettype wire
