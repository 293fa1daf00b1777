// SPDX-License-Identifier: Apache-2.0
// The card's one memory: program, data and frames, loaded with the firmware image.
//
// BYTES: any multiple of 4. One 32-bit port with byte writes. rdata is the word that was
// enabled in the clock before. After any other clock it is 0, so that it can be ORed with other
// read data. A written word is not read in the same clock.
// Each byte is stored with an even parity bit above it, in the ninth bit of a block RAM lane.
// damaged: one clock after rdata; a byte of that word does not match its parity. Two wrong bits
// in one byte are not detected (docs/hardening.md, Memory parity, SAFE-4).
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
  // One tree per byte: abc9 does not cope with one tree of 36 inputs.
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
    // With `if`, an X in a simulator does not count as damage. The soft core saves registers
    // to memory before it has written them.
    odd <= 4'd0;
    if (^read[8:0]) odd[0] <= 1'b1;
    if (^read[17:9]) odd[1] <= 1'b1;
    if (^read[26:18]) odd[2] <= 1'b1;
    if (^read[35:27]) odd[3] <= 1'b1;
  end

endmodule

`default_nettype wire
