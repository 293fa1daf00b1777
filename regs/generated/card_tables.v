// SPDX-License-Identifier: Apache-2.0
// Generated from regs/card.toml by `make regs`; edit that file, not this one.
//
// Settings of the network line by the baud and parity switches. Combinational; 1 = ON.
// EXTENDED_SWITCHES = 0: the positions of the old card. 1: also 38400 and 115200 bit/s and 8N1.
// Index = switch. Rate by baud_divider (LINE-2), format (LINE-1, LINE-3). half_end: end value of
// silence_timer's count of half a character (FRAME-1); half_uneven: every second half is one tick
// shorter. character_half: half_end of the rates whose silences are characters.

`default_nettype none

module card_tables #(
    parameter [0:0] EXTENDED_SWITCHES = 1'b0
) (
    input  wire [ 5:1] sw_baud,
    output reg         baud_undivided,
    output reg  [ 6:0] baud_mask,
    output reg         parity_enable,
    output reg         parity_odd,
    output reg         two_stop,
    output reg  [ 8:0] half_end,
    output reg         half_uneven
);

  reg [8:0] character_half;

  always @* begin
    case (sw_baud[3:1])
      3'b000: begin
        baud_undivided = 1'b0;
        baud_mask = 7'd127;
        half_end = character_half;
        half_uneven = 1'b0;
      end
      3'b001: begin
        baud_undivided = 1'b0;
        baud_mask = EXTENDED_SWITCHES ? 7'd0 : 7'd3;
        half_end = EXTENDED_SWITCHES ? 9'd171 : character_half;
        half_uneven = EXTENDED_SWITCHES ? 1'b1 : 1'b0;
      end
      3'b010: begin
        baud_undivided = 1'b0;
        baud_mask = 7'd15;
        half_end = character_half;
        half_uneven = 1'b0;
      end
      3'b011: begin
        baud_undivided = EXTENDED_SWITCHES ? 1'b1 : 1'b0;
        baud_mask = EXTENDED_SWITCHES ? 7'd0 : 7'd3;
        half_end = EXTENDED_SWITCHES ? 9'd478 : character_half;
        half_uneven = EXTENDED_SWITCHES ? 1'b1 : 1'b0;
      end
      3'b100: begin
        baud_undivided = 1'b0;
        baud_mask = 7'd31;
        half_end = character_half;
        half_uneven = 1'b0;
      end
      3'b101: begin
        baud_undivided = 1'b0;
        baud_mask = 7'd1;
        half_end = character_half;
        half_uneven = 1'b0;
      end
      3'b110: begin
        baud_undivided = 1'b0;
        baud_mask = 7'd7;
        half_end = character_half;
        half_uneven = 1'b0;
      end
      default: begin
        baud_undivided = 1'b0;
        baud_mask = 7'd3;
        half_end = character_half;
        half_uneven = 1'b0;
      end
    endcase
  end

  always @* begin
    case (sw_baud[5:4])
      2'b00: begin
        parity_enable = 1'b1;
        parity_odd = 1'b0;
        two_stop = 1'b0;
        character_half = 9'd105;
      end
      2'b01: begin
        parity_enable = 1'b0;
        parity_odd = 1'b0;
        two_stop = EXTENDED_SWITCHES ? 1'b0 : 1'b1;
        character_half = EXTENDED_SWITCHES ? 9'd97 : 9'd105;
      end
      2'b10: begin
        parity_enable = 1'b1;
        parity_odd = 1'b1;
        two_stop = 1'b0;
        character_half = 9'd105;
      end
      default: begin
        parity_enable = 1'b0;
        parity_odd = 1'b0;
        two_stop = 1'b1;
        character_half = 9'd105;
      end
    endcase
  end

endmodule

`default_nettype wire
