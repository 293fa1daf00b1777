// SPDX-License-Identifier: Apache-2.0
// The soft core: the only file that depends on the processor in use.
//
// SOFT_CORE 0: PicoRV32, 5 to 6 clocks an instruction. 1: SERV, bit-serial, about 60 clocks an
// instruction. Both are RV32I without interrupts and start at address 0 with undefined
// registers. bus_valid holds address, data and strobes until bus_ready; bus_wstrb = 0 is a read.
// LOCKSTEP 1, for PicoRV32 alone: two cores run the same program with the same inputs. An access
// reaches the bus only while both ask for the same one, so neither core can write anything that the
// other does not write (SAFE-4). The start-up code loads every register before it reads one.
// trap: PicoRV32 met an illegal instruction or a misaligned access and stopped, or the two cores
// differ. SERV has no trap and continues with undefined results; the watchdog and the firmware
// image check detect that. docs/hardening.md, Two cores. Clock domain: clk. Rules: TOP-2, SAFE-4.
`default_nettype none

module soft_core #(
    parameter SOFT_CORE = 0,
    parameter LOCKSTEP  = 0
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

  localparam PICORV32 = 0;
  localparam SERV = 1;

  // verilator lint_off PINMISSING
  generate
    if (SOFT_CORE == SERV) begin : g_serv
      wire [31:0] fetch_addr;
      wire fetch_valid;
      wire [31:0] data_addr;
      wire [3:0] data_select;
      wire data_write;
      wire data_valid;

      // Never both at once: SERV fetches after the previous instruction has ended.
      assign bus_valid = fetch_valid || data_valid;
      assign bus_addr = data_valid ? data_addr : fetch_addr;
      assign bus_wstrb = data_select & {4{data_valid && data_write}};
      assign trap = 1'b0;

      serv_rf_top #(
          .RESET_PC(32'd0),
          .RESET_STRATEGY("MINI"),
          .WITH_CSR(0)
      ) core_i (
          .clk(clk),
          .i_rst(rst),
          .i_timer_irq(1'b0),
          .o_ibus_adr(fetch_addr),
          .o_ibus_cyc(fetch_valid),
          .i_ibus_rdt(bus_rdata),
          .i_ibus_ack(bus_ready && fetch_valid),
          .o_dbus_adr(data_addr),
          .o_dbus_dat(bus_wdata),
          .o_dbus_sel(data_select),
          .o_dbus_we(data_write),
          .o_dbus_cyc(data_valid),
          .i_dbus_rdt(bus_rdata),
          .i_dbus_ack(bus_ready && data_valid),
          .i_ext_rd(32'd0),
          .i_ext_ready(1'b0)
      );
    end else begin : g_picorv32
      wire first_trap;
      wire first_valid;
      wire [31:0] first_addr;
      wire [31:0] first_wdata;
      wire [3:0] first_wstrb;
      wire same;

      assign bus_valid = first_valid && same;
      assign bus_addr  = first_addr;
      assign bus_wdata = first_wdata;
      assign bus_wstrb = first_wstrb;
      assign trap      = first_trap || !same;

      picorv32 #(
          .ENABLE_COUNTERS(0),
          .ENABLE_COUNTERS64(0),
          .TWO_STAGE_SHIFT(1),
          .BARREL_SHIFTER(0),
          .CATCH_MISALIGN(1),
          .CATCH_ILLINSN(1),
          .ENABLE_IRQ(0),
          .REGS_INIT_ZERO(1),
          .PROGADDR_RESET(32'd0)
      ) core_i (
          .clk(clk),
          .resetn(!rst),
          .trap(first_trap),
          .mem_valid(first_valid),
          .mem_ready(bus_ready),
          .mem_addr(first_addr),
          .mem_wdata(first_wdata),
          .mem_wstrb(first_wstrb),
          .mem_rdata(bus_rdata),
          .pcpi_wr(1'b0),
          .pcpi_rd(32'd0),
          .pcpi_wait(1'b0),
          .pcpi_ready(1'b0),
          .irq(32'd0)
      );

      if (LOCKSTEP == 1) begin : g_lockstep
        wire second_trap;
        wire second_valid;
        wire [31:0] second_addr;
        wire [31:0] second_wdata;
        wire [3:0] second_wstrb;

        // The data of a reading is left over from an earlier access.
        wire same_data = first_wdata == second_wdata || first_wstrb == 4'd0;
        wire same_access = first_addr == second_addr && first_wstrb == second_wstrb && same_data;

        assign same = first_valid == second_valid && first_trap == second_trap &&
            (!first_valid || same_access);

        // No tool may take one core for both.
        (* keep_hierarchy *)
        picorv32 #(
            .ENABLE_COUNTERS(0),
            .ENABLE_COUNTERS64(0),
            .TWO_STAGE_SHIFT(1),
            .BARREL_SHIFTER(0),
            .CATCH_MISALIGN(1),
            .CATCH_ILLINSN(1),
            .ENABLE_IRQ(0),
            .REGS_INIT_ZERO(1),
            .PROGADDR_RESET(32'd0)
        ) second_i (
            .clk(clk),
            .resetn(!rst),
            .trap(second_trap),
            .mem_valid(second_valid),
            .mem_ready(bus_ready),
            .mem_addr(second_addr),
            .mem_wdata(second_wdata),
            .mem_wstrb(second_wstrb),
            .mem_rdata(bus_rdata),
            .pcpi_wr(1'b0),
            .pcpi_rd(32'd0),
            .pcpi_wait(1'b0),
            .pcpi_ready(1'b0),
            .irq(32'd0)
        );
      end else begin : g_single
        assign same = 1'b1;
      end
    end
    // A module that does not exist stops every tool and names the mistake.
    if (SOFT_CORE != PICORV32 && SOFT_CORE != SERV) begin : g_core_mistake
      SOFT_CORE_is_neither_0_nor_1 mistake_i ();
    end
    if (LOCKSTEP != 0 && LOCKSTEP != 1) begin : g_lockstep_mistake
      LOCKSTEP_is_neither_0_nor_1 mistake_i ();
    end
    if (LOCKSTEP == 1 && SOFT_CORE == SERV) begin : g_no_second_serv
      LOCKSTEP_needs_PicoRV32 mistake_i ();
    end
  endgenerate
  // verilator lint_on PINMISSING

endmodule

`default_nettype wire
