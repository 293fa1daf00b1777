// SPDX-License-Identifier: Apache-2.0
// One byte lane of a bank of the card's memory, with the ports of ram_bank.
//
// It is a module of its own, because with a parameter for it in ram_bank the small card, which has
// no lanes, took 14 cells more.
// LANE: the byte that the lane keeps, with its parity bit; the other bits of rdata are 0, so that
// lanes can be ORed. The array has ALL words of the image, because $readmemh reads a file from its
// first line. For the same reason it has all 36 bits of a word, and a write to the lane writes
// them all: not every tool can load or write a part of a word. Synthesis keeps the words and bits
// that rdata can show.
// FIRMWARE_HEX: $readmemh image, one word of 36 bits a line. Clock domain: clk.
// Rules: TOP-1, TOP-2.
`default_nettype none

module ram_lane #(
    parameter FIRST = 0,
    parameter WORDS = 512,
    parameter ALL = 1536,
    parameter LANE = 0,
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
  assign rdata = read & (36'h1ff << 9 * LANE);

  initial $readmemh(FIRMWARE_HEX, words);

  always @(posedge clk) begin
    if (wstrb[LANE]) words[place] <= wdata;
    if (enable && wstrb == 4'd0) read <= words[place];
    else read <= 36'd0;
  end

endmodule

`default_nettype wire
