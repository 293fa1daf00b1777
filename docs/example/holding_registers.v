// SPDX-License-Identifier: Apache-2.0
// Example: modbus_slave with eight holding registers. registers: register n is bits 16n to 16n+15.
//
// Clock domain: clk, CLK_HZ. rst is synchronous and clears the registers.
`default_nettype none

module holding_registers #(
    parameter CLK_HZ  = 12_000_000,
    parameter BAUD    = 19_200,
    parameter ADDRESS = 1
) (
    input  wire         clk,
    input  wire         rst,
    // pins of the transceiver
    input  wire         rx,
    output wire         tx,
    output wire         de,
    // status
    output reg  [127:0] registers
);

  wire [15:0] regs_addr;
  wire        regs_write;
  wire [15:0] regs_wdata;
  wire [ 6:0] bits = {regs_addr[2:0], 4'd0};

  always @(posedge clk) begin
    if (regs_write) registers[bits+:16] <= regs_wdata;
    if (rst) registers <= 128'd0;
  end

  modbus_slave #(
      .CLK_HZ(CLK_HZ),
      .BAUD(BAUD),
      .ADDRESS(ADDRESS),
      .REGISTERS(8)
  ) slave_i (
      .clk(clk),
      .rst(rst),
      // pins
      .rx(rx),
      .tx(tx),
      .de(de),
      // registers
      .regs_addr(regs_addr),
      .regs_rdata(registers[bits+:16]),
      .regs_write(regs_write),
      .regs_wdata(regs_wdata)
  );

endmodule

`default_nettype wire
