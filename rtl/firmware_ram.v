// SPDX-License-Identifier: Apache-2.0
// The card's one memory: program, data and frames, loaded with the firmware image.
//
// BYTES: any multiple of 4. One 32-bit port with byte writes. rdata is the word that was
// enabled in the clock before. After any other clock it is 0, so that it can be ORed with other
// read data. A written word is not read in the same clock.
// Each byte is stored with its parity above it, in the ninth bit of a block RAM lane. damaged: one
// clock after rdata; see word_parity.
// A bank of more than 512 words is four lanes of one byte: not every tool maps byte writes to block
// RAMs. A smaller one takes fewer block RAMs as whole words.
// A memory that is not a power of two has banks, because ORed banks need fewer cells and less
// time than multiplexed block RAMs.
// FIRMWARE_HEX: $readmemh image, one word of 36 bits a line. Clock domain: clk.
// Rules: TOP-1, TOP-2, SAFE-4.
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
    output wire [               31:0] rdata,
    // status
    output wire                       damaged
);

  localparam WORDS = BYTES / 4;
  // The largest power of two that divides WORDS.
  localparam BANK_WORDS = WORDS & -WORDS;
  localparam BANKS = WORDS / BANK_WORDS;
  localparam BANK_BITS = $clog2(BANK_WORDS);
  localparam WORD_BITS = $clog2(WORDS);

  // Parts of the memory: banks, or the lanes of banks, bank by bank.
  localparam LANES = BANK_WORDS > 512 ? 4 : 1;
  localparam PARTS = BANKS * LANES;

  wire [35:0] wlanes;
  wire [36*PARTS+35:0] sums;  // from bit 36 * (n + 1): the parts 0 to n, ORed
  wire [35:0] read = sums[36*PARTS+:36];

  word_parity parity_i (
      .clk(clk),
      // to the memory
      .data(wdata),
      .coded(wlanes),
      // from the memory
      .read(read),
      .rdata(rdata),
      // status
      .damaged(damaged)
  );

  assign sums[35:0] = 36'd0;

  genvar n;
  generate
    for (n = 0; n < PARTS; n = n + 1) begin : g_bank
      localparam FIRST = n / LANES * BANK_WORDS;
      wire here;
      wire [35:0] bank_rdata;

      if (BANKS == 1) begin : g_only
        assign here = 1'b1;
      end else begin : g_one_of_some
        assign here = word[WORD_BITS-1:BANK_BITS] == FIRST[WORD_BITS-1:BANK_BITS];
      end
      assign sums[36*n+36+:36] = sums[36*n+:36] | bank_rdata;

      if (LANES == 1) begin : g_part
        ram_bank #(
            .FIRST(FIRST),
            .WORDS(BANK_WORDS),
            .ALL(WORDS),
            .FIRMWARE_HEX(FIRMWARE_HEX)
        ) bank_i (
            .clk(clk),
            // bus
            .enable(enable && here),
            .word(word[BANK_BITS-1:0]),
            .wdata(wlanes),
            .wstrb(wstrb & {4{here}}),
            .rdata(bank_rdata)
        );
      end else begin : g_part
        ram_lane #(
            .FIRST(FIRST),
            .WORDS(BANK_WORDS),
            .ALL(WORDS),
            .LANE(n % LANES),
            .FIRMWARE_HEX(FIRMWARE_HEX)
        ) bank_i (
            .clk(clk),
            // bus
            .enable(enable && here),
            .word(word[BANK_BITS-1:0]),
            .wdata(wlanes),
            .wstrb(wstrb & {4{here}}),
            .rdata(bank_rdata)
        );
      end
    end
  endgenerate

endmodule

`default_nettype wire
