// SPDX-License-Identifier: Apache-2.0
// One bank of the card's memory: the words FIRST to FIRST + WORDS - 1 of the firmware image.
//
// word: within the bank. rdata is the word that was enabled in the clock before, with its parity
// bits. After any other clock it is 0, so that banks can be ORed. A written word is not read in
// the same clock. wdata: four bytes, each with its parity bit above it.
// The array has ALL words of the image, because $readmemh reads a file from its first line.
// Synthesis keeps only the words that an address reaches.
// FIRMWARE_HEX: $readmemh image, one word of 36 bits a line. Clock domain: clk.
// Rules: TOP-1, TOP-2.
`default_nettype none

module ram_bank #(
    parameter FIRST = 0,
    parameter WORDS = 512,
    parameter ALL = 1536,
    parameter FIRMWARE_HEX = "firmware.hex"
) (
    input  wire                     clk,
    // bus
    input  wire                     enable,
    input  wire [$clog2(WORDS)-1:0] word,
    input  wire [             35:0] wdata,
    input  wire [              3:0] wstrb,
    output wire [             35:0] rdata
);

  localparam ALL_BITS = $clog2(ALL);
  localparam [ALL_BITS-1:0] BASE = FIRST[ALL_BITS-1:0];

  (* no_rw_check *) reg [35:0] words[0:ALL-1];
  reg [35:0] read = 36'd0;
  wire [ALL_BITS-1:0] place;

  generate
    if (WORDS == ALL) begin : g_only
      assign place = word;
    end else begin : g_one_of_some
      assign place = {BASE[ALL_BITS-1:$clog2(WORDS)], word};
    end
  endgenerate
  assign rdata = read;

  initial $readmemh(FIRMWARE_HEX, words);

  always @(posedge clk) begin
    if (wstrb[0]) words[place][8:0] <= wdata[8:0];
    if (wstrb[1]) words[place][17:9] <= wdata[17:9];
    if (wstrb[2]) words[place][26:18] <= wdata[26:18];
    if (wstrb[3]) words[place][35:27] <= wdata[35:27];
    if (enable && wstrb == 4'd0) read <= words[place];
    else read <= 36'd0;
  end

endmodule

`default_nettype wire
