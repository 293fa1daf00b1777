// SPDX-License-Identifier: Apache-2.0
// Block RAM of MachXO2 and MachXO3 for netlist simulations; Yosys has no model of it.
//
// Models only the features that Yosys uses: no output registers, no chip select decoding.
// 1024 words of 9 bits; narrower ports use 8 of them, the 18-bit port two words, then
// with ADA0 and ADA1 as byte enables. The vendor's module has a port for each bit and its
// content in parts: block_ram() of tb/gates/netlists.py writes it around this one.
`default_nettype none

module block_ram_9k #(
    parameter DATA_WIDTH_A = 9,
    parameter DATA_WIDTH_B = 9,
    parameter REGMODE_A = "NOREG",
    parameter REGMODE_B = "NOREG",
    parameter CSDECODE_A = "0b000",
    parameter CSDECODE_B = "0b000",
    parameter WRITEMODE_A = "NORMAL",
    parameter WRITEMODE_B = "NORMAL",
    parameter RESETMODE = "SYNC",
    parameter [10239:0] CONTENT = 10240'd0
) (
    // port A
    input  wire [ 8:0] dia,
    input  wire [12:0] ada,
    input  wire        cea,
    input  wire        clka,
    input  wire        wea,
    input  wire        rsta,
    output wire [ 8:0] doa,
    // port B
    input  wire [ 8:0] dib,
    input  wire [12:0] adb,
    input  wire        ceb,
    input  wire        clkb,
    input  wire        web,
    input  wire        rstb,
    output wire [ 8:0] dob
);

  reg [8:0] words[0:1023];
  reg [8:0] out_a = 9'd0;
  reg [8:0] out_b = 9'd0;

  // Two words are stored in 20 bits.
  integer i;
  initial #0 for (i = 0; i < 1024; i = i + 1) words[i] = CONTENT[i/2*20+i%2*9+:9];

  // The bits of a word that a port of this width writes, and the bits that it reads.
  function [8:0] merged(input integer width, input [2:0] low, input [8:0] old, input [8:0] data);
    begin
      merged = old;
      case (width)
        1: merged[low] = data[1];
        2: merged[{low[2:1], 1'b0}+:2] = {data[5], data[2]};
        4: merged[{low[2], 2'b00}+:4] = data[3:0];
        default: merged = data;
      endcase
    end
  endfunction

  function [8:0] seen(input integer width, input [2:0] low, input [8:0] word);
    case (width)
      1: seen = {8'd0, word[low]};
      2: seen = {7'd0, word[{low[2:1], 1'b0}+:2]};
      4: seen = {5'd0, word[{low[2], 2'b00}+:4]};
      default: seen = word;
    endcase
  endfunction

  wire [9:0] word_a = ada[12:3];
  wire [9:0] word_b = adb[12:3];
  wire [8:0] new_a = merged(DATA_WIDTH_A, ada[2:0], words[word_a], dia);
  wire [8:0] new_b = merged(DATA_WIDTH_B, adb[2:0], words[word_b], dib);
  wire wide_write = DATA_WIDTH_A == 18;
  wire wide_read = DATA_WIDTH_B == 18;

  always @(posedge clka) begin
    if (cea && wea) begin
      if (wide_write) begin
        if (ada[0]) words[{ada[12:4], 1'b0}] <= dia;
        if (ada[1]) words[{ada[12:4], 1'b1}] <= dib;
      end else if (DATA_WIDTH_A != 9 || ada[0]) words[word_a] <= new_a;
    end
    if (cea && !wide_read) begin
      if (!wea || WRITEMODE_A == "READBEFOREWRITE")
        out_a <= seen(DATA_WIDTH_A, ada[2:0], words[word_a]);
      else if (WRITEMODE_A == "WRITETHROUGH") out_a <= seen(DATA_WIDTH_A, ada[2:0], new_a);
    end
    if (rsta && !wide_read) out_a <= 9'd0;
  end

  always @(posedge clkb) begin
    if (ceb && web) words[word_b] <= new_b;
    if (ceb) begin
      if (wide_read) {out_b, out_a} <= {words[{adb[12:4], 1'b1}], words[{adb[12:4], 1'b0}]};
      else if (!web || WRITEMODE_B == "READBEFOREWRITE")
        out_b <= seen(DATA_WIDTH_B, adb[2:0], words[word_b]);
      else if (WRITEMODE_B == "WRITETHROUGH") out_b <= seen(DATA_WIDTH_B, adb[2:0], new_b);
    end
    if (rstb) begin
      out_b <= 9'd0;
      if (wide_read) out_a <= 9'd0;
    end
  end

  wire clear_a = RESETMODE == "ASYNC" && (wide_read ? rstb : rsta);
  wire clear_b = RESETMODE == "ASYNC" && rstb;
  assign doa = clear_a ? 9'd0 : out_a;
  assign dob = clear_b ? 9'd0 : out_b;

  // Rejects parameters beyond the model.
  initial
    if (REGMODE_A != "NOREG" || REGMODE_B != "NOREG" ||
        CSDECODE_A != "0b000" || CSDECODE_B != "0b000") begin
      $display("DP8KC: used in a way that is not modelled");
      $finish;
    end

endmodule

`default_nettype wire
