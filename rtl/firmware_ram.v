// SPDX-License-Identifier: Apache-2.0
// The card's one memory: program, data and frames, loaded with the firmware image.
//
// BYTES is any multiple of 4. One 32-bit port, byte writes. rdata shows the word that
// was enabled a clock before and 0 after any other clock, so that it can be ORed with
// what else is read. A word that is written is not read. FIRMWARE_HEX: $readmemh
// image, one 32-bit word a line. Clock domain: clk. Rules: TOP-1, TOP-2.
`default_nettype none

module firmware_ram #(
    parameter BYTES = 8192,
    parameter FIRMWARE_HEX = "firmware.hex"
) (
    input  wire                       clk,
    // bus
    input  wire                       enable,
    input  wire [$clog2(BYTES/4)-1:0] word,
    input  wire [               31:0] wdata,
    input  wire [                3:0] wstrb,
    output reg  [               31:0] rdata
);

  localparam WORDS = BYTES / 4;

  (* no_rw_check *) reg [31:0] words[0:WORDS-1];

  initial $readmemh(FIRMWARE_HEX, words);
  initial rdata = 32'd0;

  always @(posedge clk) begin
    if (wstrb[0]) words[word][7:0] <= wdata[7:0];
    if (wstrb[1]) words[word][15:8] <= wdata[15:8];
    if (wstrb[2]) words[word][23:16] <= wdata[23:16];
    if (wstrb[3]) words[word][31:24] <= wdata[31:24];
    if (enable) rdata <= words[word];
    else rdata <= 32'd0;
  end

endmodule

`default_nettype wire
