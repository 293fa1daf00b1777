// SPDX-License-Identifier: Apache-2.0
// Even parity for each byte of a memory's words.
//
// coded: data with a parity bit above each byte. rdata: the bytes of a coded word that was read.
// damaged: one clock after `read`; a byte does not match its parity. Two wrong bits in one byte are
// not detected. Width: 32 bits and their code of 36. Clock domain: clk.
// docs/hardening.md, Memory parity. Rule: SAFE-4.
`default_nettype none

module word_parity (
    input  wire        clk,
    // to the memory
    input  wire [31:0] data,
    output wire [35:0] coded,
    // from the memory
    input  wire [35:0] read,
    output wire [31:0] rdata,
    // status
    output wire        damaged
);

  // One tree per byte: abc9 does not cope with one tree of 36 inputs.
  reg [3:0] odd = 4'd0;

  assign damaged = odd != 4'd0;

  genvar n;
  generate
    for (n = 0; n < 4; n = n + 1) begin : g_byte
      assign coded[9*n+:9] = {^data[8*n+:8], data[8*n+:8]};
      assign rdata[8*n+:8] = read[9*n+:8];
    end
  endgenerate

  integer i;
  always @(posedge clk) begin
    // With `if`, an X in a simulator does not count as damage. The soft core saves registers
    // to memory before it has written them.
    odd <= 4'd0;
    for (i = 0; i < 4; i = i + 1) if (^read[9*i+:9]) odd[i] <= 1'b1;
  end

endmodule

`default_nettype wire
