// SPDX-License-Identifier: Apache-2.0
// Sends one FC telegram: STX, LGE, then ADR, data and BCC from the frame memory.
//
// The frame memory holds the BCC, too: docs/hardening.md, BCC made with the telegram (SAFE-4).
// start begins the telegram; the commit gate decides on start. line_request asks for DE. Bytes
// follow without a gap if the memory answers within one bit (FC-8).
// control, steady while sending: 1 allows bit 10 of the control word to be 1. Otherwise this bit
// leaves as 0. The drive then ignores the command, because of bit 10 and because the BCC no
// longer matches (SAFE-1).
// stop, steady likewise: bit 6 of the control word, the start, leaves as 0 (SAFE-7).
// sending: level, from start to the end of the last stop bit. sent: one clock, at that end.
// length: ADR, data and BCC, 6 to 30 bytes; it is sent as LGE (FC-1). adr keeps the ADR that
// was sent, which the reply must echo (FC-2). Clock domain: clk.
// Rules: FC-1, FC-10, SAFE-1, SAFE-2, SAFE-4, SAFE-7.
`default_nettype none

module fc_tx (
    input  wire       clk,
    input  wire       rst,
    // stream in
    input  wire       start,
    input  wire [4:0] length,
    input  wire       control,
    input  wire       stop,
    // frame memory
    output wire       read_valid,
    input  wire       read_ready,
    output wire [4:0] read_addr,
    input  wire [7:0] read_data,
    // stream out
    output wire       send_valid,
    input  wire       send_ready,
    output wire [7:0] send_data,
    // direction
    output wire       line_request,
    input  wire       line_busy,
    // status
    output wire       sending,
    output wire       sent,
    output reg  [7:0] adr
);

  localparam [7:0] STX = 8'h02;
  localparam [7:0] VALID = 8'h04;  // control word bit 10, in its upper byte
  localparam [7:0] RUN = 8'h40;  // control word bit 6, in its lower byte

  localparam [2:0] S_IDLE = 3'd0;
  localparam [2:0] S_STX = 3'd1;
  localparam [2:0] S_LGE = 3'd2;
  localparam [2:0] S_FETCH = 3'd3;  // read the next byte from the frame memory
  localparam [2:0] S_SEND = 3'd4;  // pass it to the UART, which is ready
  localparam [2:0] S_DRAIN = 3'd5;  // until the last stop bit is over

  reg [2:0] state = S_IDLE;
  reg [4:0] index = 5'd0;
  // Set by start; nothing is sent without it.
  // docs/hardening.md, Undefined states (SAFE-4)
  reg begun = 1'b0;

  // Three data bytes and the BCC follow the upper byte of the control word.
  wire control_byte = index + 5'd4 == length;
  wire run_byte = index + 5'd3 == length;
  // docs/hardening.md, Command bit (SAFE-1), Loss of the master (SAFE-7)
  wire [7:0] kept = control_byte && !control ? read_data & ~VALID :
      run_byte && stop ? read_data & ~RUN : read_data;

  assign read_valid = begun && state == S_FETCH && send_ready;
  assign read_addr = index;
  assign send_valid = begun && (state == S_STX || state == S_LGE || state == S_SEND);
  assign send_data = state == S_STX ? STX : state == S_LGE ? {3'd0, length} : kept;
  assign line_request = sending && state != S_DRAIN;
  assign sending = begun && state != S_IDLE;
  assign sent = begun && state == S_DRAIN && !line_busy;

  initial adr = 8'd0;

  always @(posedge clk) begin
    case (state)
      S_STX:   if (send_ready) state <= S_LGE;
      S_LGE:   if (send_ready) state <= S_FETCH;
      S_FETCH:
      if (read_valid && read_ready) begin
        index <= index + 5'd1;
        state <= S_SEND;
      end
      S_SEND: begin
        if (index == 5'd1) adr <= read_data;
        state <= index == length ? S_DRAIN : S_FETCH;
      end
      S_DRAIN: if (sent) state <= S_IDLE;
      default: begin
        index <= 5'd0;
        begun <= start;
        // docs/hardening.md, Undefined states (SAFE-4)
        state <= start ? S_STX : S_IDLE;
      end
    endcase
    if (rst || (!begun && state != S_IDLE)) state <= S_IDLE;
  end

endmodule

`default_nettype wire
