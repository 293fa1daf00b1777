// SPDX-License-Identifier: Apache-2.0
// Program and data memory of the soft core, loaded with the firmware image.
//
// BYTES is a power of two times 4 or any multiple of 4; the address wraps at the next
// power of two. One 32-bit port, byte writes, an access takes two clocks: valid, then
// ready with the data. FIRMWARE_HEX: $readmemh image, one 32-bit word a line.
// Clock domain: clk. Rules: TOP-1, TOP-2.
`default_nettype none

module firmware_ram #(
    parameter BYTES = 8192,
    parameter FIRMWARE_HEX = "firmware.hex"
) (
    input  wire        clk,
    input  wire        rst,
    // soft core bus
    input  wire        bus_valid,
    output reg         bus_ready,
    input  wire [31:0] bus_addr,
    input  wire [31:0] bus_wdata,
    input  wire [ 3:0] bus_wstrb,
    output reg  [31:0] bus_rdata
);

  localparam WORDS = BYTES / 4;
  localparam ADDR_BITS = $clog2(WORDS);

  (* no_rw_check *) reg [31:0] words[0:WORDS-1];

  wire [ADDR_BITS-1:0] word = bus_addr[ADDR_BITS+1:2];
  wire [3:0] write = bus_wstrb & {4{bus_valid}};

  initial $readmemh(FIRMWARE_HEX, words);
  initial bus_ready = 1'b0;

  always @(posedge clk) begin
    if (write[0]) words[word][7:0] <= bus_wdata[7:0];
    if (write[1]) words[word][15:8] <= bus_wdata[15:8];
    if (write[2]) words[word][23:16] <= bus_wdata[23:16];
    if (write[3]) words[word][31:24] <= bus_wdata[31:24];
    bus_rdata <= words[word];
  end

  always @(posedge clk) bus_ready <= bus_valid && !bus_ready && !rst;

  // The other address bits choose the memory, or wrap round.
  wire unused = &{1'b0, bus_addr[31:ADDR_BITS+2], bus_addr[1:0]};

endmodule

`default_nettype wire
