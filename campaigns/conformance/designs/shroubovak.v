// SPDX-License-Identifier: Apache-2.0
// Around Shroubovak/FPGA_Modbus_RTU: eight registers, and a memory in place of the vendor's megafunction.
`default_nettype none

module rxBuffer (
    input wire clock,
    input wire [7:0] data,
    input wire [7:0] rdaddress,
    input wire [7:0] wraddress,
    input wire wren,
    output reg [7:0] q
);
  reg [7:0] memory[0:255];
  always @(posedge clock) begin
    if (wren) memory[wraddress] <= data;
    q <= memory[rdaddress];
  end
endmodule

module shroubovak (
    input  wire clk,
    input  wire rst,
    input  wire rx,
    output wire tx,
    output wire de
);
  reg [15:0] registers[0:7];
  wire [15:0] read_address, write_address, written;
  wire write;
  integer n;
  initial for (n = 0; n < 8; n = n + 1) registers[n] = 0;

  always @(posedge clk) if (write && write_address < 8) registers[write_address[2:0]] <= written;

  modbus_slave #(
      .FCLK(2_000),
      .BAUDE(19_200),
      .RESPONSE_DELAY(2_000),
      .CRC_ENABLE(1)
  ) slave_i (
      .clk(clk),
      .rst(rst),
      .iRxd(rx),
      .oTxd(tx),
      .oTxEn(de),
      .iNodeID(8'd17),
      .oAddrRd(read_address),
      .iDataRd(read_address < 8 ? registers[read_address[2:0]] : 16'd0),
      .oAddrWr(write_address),
      .oDataWr(written),
      .oWrEn(write)
  );
endmodule

`default_nettype wire
