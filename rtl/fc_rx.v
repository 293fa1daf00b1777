// SPDX-License-Identifier: Apache-2.0
// Receives and checks the drive's reply telegram.
//
// Listening begins with listen_start, after the card's own telegram. It ends with listen_stop,
// which also comes with the next own telegram. Before STX, any other byte is ignored: a line
// that changes direction may produce a phantom character. From STX on everything must be right
// (FC-8): LGE >= 6, the ADR that was sent, parity, stop bits and BCC. A gap is at most 2
// characters, and the whole takes at most 1.5 times the nominal time. A telegram that fails is
// counted once with bad. The receiver looks for STX again after 2 characters of silence.
//
// candidate: level, all data bytes are stored and only the BCC is missing. The firmware may
// prepare its answer. good: level, the BCC was correct. The telegram stays in the frame memory
// until listen_start or listen_stop.
// Data byte i is stored at address i, from 24 on at 24 + (i mod 4). A text of more than 20
// characters is received to its end, and the last four bytes, PCD1 and PCD2, are always kept
// (FC-7). LGE is stored at address 28.
// Units: tick16 = 1/16 bit. Clock domain: clk. Rules: FC-1, FC-2, FC-7, FC-8.
`default_nettype none

module fc_rx (
    input  wire       clk,
    input  wire       rst,
    input  wire       tick16,
    // stream in
    input  wire       byte_valid,
    input  wire [7:0] byte_data,
    input  wire       byte_parity_error,
    input  wire       byte_framing_error,
    input  wire       start_seen,
    input  wire       long_reached,
    // frame memory, 32 bytes
    output wire       write_valid,
    input  wire       write_ready,
    output wire [4:0] write_addr,
    // check
    output wire       check_clear,
    input  wire       check_good,
    // configuration
    input  wire       listen_start,
    input  wire       listen_stop,
    input  wire [7:0] adr,
    // status
    output wire       listening,
    output wire       candidate,
    output wire       good,
    output reg        bad
);

  localparam [7:0] STX = 8'h02;
  localparam [7:0] LGE_MIN = 8'd6;  // ADR, PCD1, PCD2, BCC
  localparam [4:0] LGE_ADDR = 5'd28;
  // The pause is two characters. Each character of a telegram may take a slot of 1.5 characters.
  // Counting begins after STX, when one character of the first slot has passed.
  localparam [11:0] PAUSE_TICKS = 12'd352;
  localparam [8:0] CHARACTER_TICKS = PAUSE_TICKS[9:1];
  localparam [8:0] SLOT_TICKS = CHARACTER_TICKS + CHARACTER_TICKS / 9'd2;

  localparam [2:0] S_OFF = 3'd0;
  localparam [2:0] S_HUNT = 3'd1;  // wait for STX
  localparam [2:0] S_LGE = 3'd2;
  localparam [2:0] S_ADR = 3'd3;
  localparam [2:0] S_DATA = 3'd4;
  localparam [2:0] S_BCC = 3'd5;
  localparam [2:0] S_GOOD = 3'd6;
  localparam [2:0] S_BAD = 3'd7;  // wait for 2 characters of silence

  reg [2:0] state = S_OFF;
  reg [7:0] left = 8'd0;  // bytes still to come, BCC included
  reg [4:0] index = 5'd0;
  reg storing = 1'b0;
  reg [8:0] slot = 9'd0;
  reg signed [9:0] ahead = 10'sd0;  // characters received - slots passed

  wire in_telegram = state == S_LGE || state == S_ADR || state == S_DATA || state == S_BCC;
  wire damaged = byte_parity_error || byte_framing_error;
  wire slot_end = tick16 && slot == SLOT_TICKS - 9'd1;
  // Stops the count before it wraps to a positive value, which noise without characters could
  // otherwise reach. A telegram that ends in time never comes near this limit.
  wire far_behind = ahead[9:8] == 2'b10;
  wire stored = storing && write_ready;

  wire misfit = damaged || (state == S_LGE && byte_data < LGE_MIN) ||
      (state == S_ADR && byte_data != adr) ||
      (state == S_BCC && (!check_good || ahead < 10'sd0));
  wire fault = in_telegram && (long_reached || (byte_valid && misfit));

  assign write_valid = storing;
  assign write_addr = index;
  assign listening = state != S_OFF;
  assign candidate = state == S_BCC;
  assign good = state == S_GOOD;
  // Also while off: listening may begin while the STX of the next telegram is on the line.
  assign check_clear = !in_telegram && start_seen;

  initial bad = 1'b0;

  always @(posedge clk) begin
    bad <= fault;

    if (!in_telegram) slot <= CHARACTER_TICKS;
    else if (tick16) slot <= slot_end ? 9'd0 : slot + 9'd1;
    if (!in_telegram) ahead <= 10'sd1;
    else if (byte_valid && !slot_end) ahead <= ahead + 10'sd1;
    else if (!byte_valid && slot_end && !far_behind) ahead <= ahead - 10'sd1;

    if (stored) begin
      storing <= 1'b0;
      if (index[4:3] == 2'b11) index[1:0] <= index[1:0] + 2'd1;
      else index <= index + 5'd1;
    end

    if (byte_valid) begin
      left <= left - 8'd1;
      case (state)
        S_HUNT:  if (!damaged && byte_data == STX) state <= S_LGE;
        S_LGE: begin
          left <= byte_data;
          index <= LGE_ADDR;
          storing <= 1'b1;
          state <= S_ADR;
        end
        S_ADR: begin
          index <= 5'd0;
          state <= S_DATA;
        end
        S_DATA: begin
          storing <= 1'b1;
          if (left == 8'd2) state <= S_BCC;
        end
        S_BCC:   state <= S_GOOD;
        default: ;
      endcase
    end
    if (fault) state <= S_BAD;
    if (long_reached && (in_telegram || state == S_BAD)) state <= S_HUNT;

    if (listen_start) state <= S_HUNT;
    if (listen_stop || rst) state <= S_OFF;
    if (rst) storing <= 1'b0;
  end

endmodule

`default_nettype wire
