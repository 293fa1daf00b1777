// SPDX-License-Identifier: Apache-2.0
// The card's one memory: program, data and frames, loaded with the firmware image.
//
// BYTES is any multiple of 4. One 32-bit port, byte writes. rdata shows the word that
// was enabled a clock before and 0 after any other clock, so that it can be ORed with
// what else is read. A word that is written is not read. Each byte has a ninth bit above
// it, its parity, even: the lanes of a block RAM. damaged comes a clock after rdata and
// says that a bit of that word is not what was written or loaded, in whichever byte
// (SAFE-4). A word that is damaged in two bits of a byte looks good.
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

  (* no_rw_check *) reg [35:0] words[0:WORDS-1];
  reg [35:0] read = 36'd0;
  // By byte: abc9 does not get over one tree of 36 inputs.
  reg [3:0] odd = 4'd0;

  assign rdata   = {read[34:27], read[25:18], read[16:9], read[7:0]};
  assign damaged = odd != 4'd0;

  initial $readmemh(FIRMWARE_HEX, words);

  always @(posedge clk) begin
    if (wstrb[0]) words[word][8:0] <= {^wdata[7:0], wdata[7:0]};
    if (wstrb[1]) words[word][17:9] <= {^wdata[15:8], wdata[15:8]};
    if (wstrb[2]) words[word][26:18] <= {^wdata[23:16], wdata[23:16]};
    if (wstrb[3]) words[word][35:27] <= {^wdata[31:24], wdata[31:24]};
    if (enable && wstrb == 4'd0) read <= words[word];
    else read <= 36'd0;
    // Asked one by one: what a simulator does not know passes, as registers do that the
    // soft core saves before anything was in them.
    odd <= 4'd0;
    if (^read[8:0]) odd[0] <= 1'b1;
    if (^read[17:9]) odd[1] <= 1'b1;
    if (^read[26:18]) odd[2] <= 1'b1;
    if (^read[35:27]) odd[3] <= 1'b1;
  end

endmodule

`default_nettype wire
