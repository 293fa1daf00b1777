// SPDX-License-Identifier: Apache-2.0
// Block RAM of MachXO2 and MachXO3 for netlist simulations; Yosys has no model of it.
//
// Models only the features that Yosys uses: no output registers, no chip select decoding.
// 1024 words of 9 bits; narrower ports use 8 of them, the 18-bit port two words, then
// with ADA0 and ADA1 as byte enables. Ports and parameters are the vendor's.
`default_nettype none

module DP8KC #(
    parameter DATA_WIDTH_A = 9,
    parameter DATA_WIDTH_B = 9,
    parameter REGMODE_A = "NOREG",
    parameter REGMODE_B = "NOREG",
    parameter CSDECODE_A = "0b000",
    parameter CSDECODE_B = "0b000",
    parameter WRITEMODE_A = "NORMAL",
    parameter WRITEMODE_B = "NORMAL",
    parameter GSR = "ENABLED",
    parameter RESETMODE = "SYNC",
    parameter ASYNC_RESET_RELEASE = "SYNC",
    parameter INIT_DATA = "STATIC",
    parameter [319:0] INITVAL_00 = 320'd0,
    parameter [319:0] INITVAL_01 = 320'd0,
    parameter [319:0] INITVAL_02 = 320'd0,
    parameter [319:0] INITVAL_03 = 320'd0,
    parameter [319:0] INITVAL_04 = 320'd0,
    parameter [319:0] INITVAL_05 = 320'd0,
    parameter [319:0] INITVAL_06 = 320'd0,
    parameter [319:0] INITVAL_07 = 320'd0,
    parameter [319:0] INITVAL_08 = 320'd0,
    parameter [319:0] INITVAL_09 = 320'd0,
    parameter [319:0] INITVAL_0A = 320'd0,
    parameter [319:0] INITVAL_0B = 320'd0,
    parameter [319:0] INITVAL_0C = 320'd0,
    parameter [319:0] INITVAL_0D = 320'd0,
    parameter [319:0] INITVAL_0E = 320'd0,
    parameter [319:0] INITVAL_0F = 320'd0,
    parameter [319:0] INITVAL_10 = 320'd0,
    parameter [319:0] INITVAL_11 = 320'd0,
    parameter [319:0] INITVAL_12 = 320'd0,
    parameter [319:0] INITVAL_13 = 320'd0,
    parameter [319:0] INITVAL_14 = 320'd0,
    parameter [319:0] INITVAL_15 = 320'd0,
    parameter [319:0] INITVAL_16 = 320'd0,
    parameter [319:0] INITVAL_17 = 320'd0,
    parameter [319:0] INITVAL_18 = 320'd0,
    parameter [319:0] INITVAL_19 = 320'd0,
    parameter [319:0] INITVAL_1A = 320'd0,
    parameter [319:0] INITVAL_1B = 320'd0,
    parameter [319:0] INITVAL_1C = 320'd0,
    parameter [319:0] INITVAL_1D = 320'd0,
    parameter [319:0] INITVAL_1E = 320'd0,
    parameter [319:0] INITVAL_1F = 320'd0
) (
    // port A
    input  wire DIA0,
    input  wire DIA1,
    input  wire DIA2,
    input  wire DIA3,
    input  wire DIA4,
    input  wire DIA5,
    input  wire DIA6,
    input  wire DIA7,
    input  wire DIA8,
    input  wire ADA0,
    input  wire ADA1,
    input  wire ADA2,
    input  wire ADA3,
    input  wire ADA4,
    input  wire ADA5,
    input  wire ADA6,
    input  wire ADA7,
    input  wire ADA8,
    input  wire ADA9,
    input  wire ADA10,
    input  wire ADA11,
    input  wire ADA12,
    input  wire CEA,
    input  wire OCEA,
    input  wire CLKA,
    input  wire WEA,
    input  wire CSA0,
    input  wire CSA1,
    input  wire CSA2,
    input  wire RSTA,
    output wire DOA0,
    output wire DOA1,
    output wire DOA2,
    output wire DOA3,
    output wire DOA4,
    output wire DOA5,
    output wire DOA6,
    output wire DOA7,
    output wire DOA8,
    // port B
    input  wire DIB0,
    input  wire DIB1,
    input  wire DIB2,
    input  wire DIB3,
    input  wire DIB4,
    input  wire DIB5,
    input  wire DIB6,
    input  wire DIB7,
    input  wire DIB8,
    input  wire ADB0,
    input  wire ADB1,
    input  wire ADB2,
    input  wire ADB3,
    input  wire ADB4,
    input  wire ADB5,
    input  wire ADB6,
    input  wire ADB7,
    input  wire ADB8,
    input  wire ADB9,
    input  wire ADB10,
    input  wire ADB11,
    input  wire ADB12,
    input  wire CEB,
    input  wire OCEB,
    input  wire CLKB,
    input  wire WEB,
    input  wire CSB0,
    input  wire CSB1,
    input  wire CSB2,
    input  wire RSTB,
    output wire DOB0,
    output wire DOB1,
    output wire DOB2,
    output wire DOB3,
    output wire DOB4,
    output wire DOB5,
    output wire DOB6,
    output wire DOB7,
    output wire DOB8
);

  reg [8:0] words[0:1023];
  reg [8:0] out_a = 9'd0;
  reg [8:0] out_b = 9'd0;

  wire [12:0] addr_a = {
    ADA12, ADA11, ADA10, ADA9, ADA8, ADA7, ADA6, ADA5, ADA4, ADA3, ADA2, ADA1, ADA0
  };
  wire [12:0] addr_b = {
    ADB12, ADB11, ADB10, ADB9, ADB8, ADB7, ADB6, ADB5, ADB4, ADB3, ADB2, ADB1, ADB0
  };
  wire [8:0] in_a = {DIA8, DIA7, DIA6, DIA5, DIA4, DIA3, DIA2, DIA1, DIA0};
  wire [8:0] in_b = {DIB8, DIB7, DIB6, DIB5, DIB4, DIB3, DIB2, DIB1, DIB0};
  wire [10239:0] content = {
    INITVAL_1F,
    INITVAL_1E,
    INITVAL_1D,
    INITVAL_1C,
    INITVAL_1B,
    INITVAL_1A,
    INITVAL_19,
    INITVAL_18,
    INITVAL_17,
    INITVAL_16,
    INITVAL_15,
    INITVAL_14,
    INITVAL_13,
    INITVAL_12,
    INITVAL_11,
    INITVAL_10,
    INITVAL_0F,
    INITVAL_0E,
    INITVAL_0D,
    INITVAL_0C,
    INITVAL_0B,
    INITVAL_0A,
    INITVAL_09,
    INITVAL_08,
    INITVAL_07,
    INITVAL_06,
    INITVAL_05,
    INITVAL_04,
    INITVAL_03,
    INITVAL_02,
    INITVAL_01,
    INITVAL_00
  };

  // Two words are stored in 20 bits.
  integer i;
  initial #0 for (i = 0; i < 1024; i = i + 1) words[i] = content[i/2*20+i%2*9+:9];

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

  wire [9:0] word_a = addr_a[12:3];
  wire [9:0] word_b = addr_b[12:3];
  wire [8:0] new_a = merged(DATA_WIDTH_A, addr_a[2:0], words[word_a], in_a);
  wire [8:0] new_b = merged(DATA_WIDTH_B, addr_b[2:0], words[word_b], in_b);
  wire wide_write = DATA_WIDTH_A == 18;
  wire wide_read = DATA_WIDTH_B == 18;

  always @(posedge CLKA) begin
    if (CEA && WEA) begin
      if (wide_write) begin
        if (ADA0) words[{addr_a[12:4], 1'b0}] <= in_a;
        if (ADA1) words[{addr_a[12:4], 1'b1}] <= in_b;
      end else if (DATA_WIDTH_A != 9 || ADA0) words[word_a] <= new_a;
    end
    if (CEA && !wide_read) begin
      if (!WEA || WRITEMODE_A == "READBEFOREWRITE")
        out_a <= seen(DATA_WIDTH_A, addr_a[2:0], words[word_a]);
      else if (WRITEMODE_A == "WRITETHROUGH") out_a <= seen(DATA_WIDTH_A, addr_a[2:0], new_a);
    end
    if (RSTA && !wide_read) out_a <= 9'd0;
  end

  always @(posedge CLKB) begin
    if (CEB && WEB) words[word_b] <= new_b;
    if (CEB) begin
      if (wide_read) {out_b, out_a} <= {words[{addr_b[12:4], 1'b1}], words[{addr_b[12:4], 1'b0}]};
      else if (!WEB || WRITEMODE_B == "READBEFOREWRITE")
        out_b <= seen(DATA_WIDTH_B, addr_b[2:0], words[word_b]);
      else if (WRITEMODE_B == "WRITETHROUGH") out_b <= seen(DATA_WIDTH_B, addr_b[2:0], new_b);
    end
    if (RSTB) begin
      out_b <= 9'd0;
      if (wide_read) out_a <= 9'd0;
    end
  end

  wire clear_a = RESETMODE == "ASYNC" && (wide_read ? RSTB : RSTA);
  wire clear_b = RESETMODE == "ASYNC" && RSTB;
  assign {DOA8, DOA7, DOA6, DOA5, DOA4, DOA3, DOA2, DOA1, DOA0} = clear_a ? 9'd0 : out_a;
  assign {DOB8, DOB7, DOB6, DOB5, DOB4, DOB3, DOB2, DOB1, DOB0} = clear_b ? 9'd0 : out_b;

  // Rejects parameters beyond the model.
  initial
    if (REGMODE_A != "NOREG" || REGMODE_B != "NOREG" ||
        CSDECODE_A != "0b000" || CSDECODE_B != "0b000") begin
      $display("DP8KC: used in a way that is not modelled");
      $finish;
    end

endmodule

`default_nettype wire
