// SPDX-License-Identifier: Apache-2.0
// The soft core: the only file that knows which processor runs the firmware.
//
// PicoRV32, RV32I, no interrupts: starts at address 0, data after code, the stack
// grows down from STACK_TOP. bus_valid holds address, data and strobes until
// bus_ready; bus_wstrb = 0 is a read. trap: it met an instruction that it does not
// know, or a misaligned access, and stopped. Clock domain: clk. Rule: TOP-2.
`default_nettype none

module soft_core #(
    parameter [31:0] STACK_TOP = 32'd8192
) (
    input  wire        clk,
    input  wire        rst,
    // bus
    output wire        bus_valid,
    input  wire        bus_ready,
    output wire [31:0] bus_addr,
    output wire [31:0] bus_wdata,
    output wire [ 3:0] bus_wstrb,
    input  wire [31:0] bus_rdata,
    // status
    output wire        trap
);

  // verilator lint_off PINMISSING
  picorv32 #(
      .ENABLE_COUNTERS(0),
      .ENABLE_COUNTERS64(0),
      .TWO_STAGE_SHIFT(1),
      .BARREL_SHIFTER(0),
      .CATCH_MISALIGN(1),
      .CATCH_ILLINSN(1),
      .ENABLE_IRQ(0),
      .REGS_INIT_ZERO(1),
      .PROGADDR_RESET(32'd0),
      .STACKADDR(STACK_TOP)
  ) core_i (
      .clk(clk),
      .resetn(!rst),
      .trap(trap),
      .mem_valid(bus_valid),
      .mem_ready(bus_ready),
      .mem_addr(bus_addr),
      .mem_wdata(bus_wdata),
      .mem_wstrb(bus_wstrb),
      .mem_rdata(bus_rdata),
      .pcpi_wr(1'b0),
      .pcpi_rd(32'd0),
      .pcpi_wait(1'b0),
      .pcpi_ready(1'b0),
      .irq(32'd0)
  );
  // verilator lint_on PINMISSING

endmodule

`default_nettype wire
