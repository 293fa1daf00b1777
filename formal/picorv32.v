// SPDX-License-Identifier: Apache-2.0
// Stands for the soft core in the proof of soft_core.v: a core that does anything in any clock.
`default_nettype none

module picorv32 #(
    parameter ENABLE_COUNTERS = 1,
    parameter ENABLE_COUNTERS64 = 1,
    parameter TWO_STAGE_SHIFT = 1,
    parameter BARREL_SHIFTER = 0,
    parameter CATCH_MISALIGN = 1,
    parameter CATCH_ILLINSN = 1,
    parameter ENABLE_IRQ = 0,
    parameter REGS_INIT_ZERO = 0,
    parameter [31:0] PROGADDR_RESET = 32'd0
) (
    input clk,
    input resetn,
    input mem_ready,
    input [31:0] mem_rdata,
    input pcpi_wr,
    input [31:0] pcpi_rd,
    input pcpi_wait,
    input pcpi_ready,
    input [31:0] irq,
    output trap,
    output mem_valid,
    output [31:0] mem_addr,
    output [31:0] mem_wdata,
    output [3:0] mem_wstrb
);
  (* anyseq *) wire [69:0] any;
  assign {trap, mem_valid, mem_addr, mem_wdata, mem_wstrb} = any;
  // Kept, for the proof looks at them.
  (* keep *) wire seen_reset = resetn;
  (* keep *) wire seen_ready = mem_ready;
  (* keep *) wire [31:0] seen_data = mem_rdata;
endmodule

`default_nettype wire
