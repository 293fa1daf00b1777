// SPDX-License-Identifier: Apache-2.0
// Sends one FC telegram: STX, LGE, then ADR and data from the frame memory, BCC.
//
// start begins it; whether and when, the commit gate decides. DE is asked for and
// the bytes follow each other without a gap (FC-8). LGE is the number of data
// bytes + 2 = length + 1 (FC-1). sending: from start to the end of the last stop
// bit; sent: one clock, its end. length counts ADR and data, 5 to 29. adr keeps the
// ADR that was sent, for the reply must echo it (FC-2). Clock domain: clk. Rules: FC-1, FC-10, SAFE-2.
`default_nettype none

module fc_tx (
    input  wire       clk,
    input  wire       rst,
    // stream in
    input  wire       start,
    input  wire [4:0] length,
    // frame memory
    output wire       read_valid,
    input  wire       read_ready,
    output wire [4:0] read_addr,
    input  wire [7:0] read_data,
    // stream out
    output wire       byte_valid,
    input  wire       byte_ready,
    output wire [7:0] byte_data,
    // direction
    output wire       line_request,
    input  wire       line_ready,
    input  wire       line_busy,
    // status
    output wire       sending,
    output wire       sent,
    output reg  [7:0] adr
);

  localparam [7:0] STX = 8'h02;

  localparam [2:0] S_IDLE = 3'd0;
  localparam [2:0] S_STX = 3'd1;
  localparam [2:0] S_LGE = 3'd2;
  localparam [2:0] S_FETCH = 3'd3;  // ask the frame memory for the next byte
  localparam [2:0] S_LATCH = 3'd4;  // its answer is there
  localparam [2:0] S_SEND = 3'd5;  // wait until the UART takes it
  localparam [2:0] S_BCC = 3'd6;
  localparam [2:0] S_DRAIN = 3'd7;  // until the last stop bit is over

  reg [2:0] state = S_IDLE;
  reg [4:0] index = 5'd0;
  reg [7:0] held = 8'd0;

  wire [7:0] check;
  wire taken = byte_valid && byte_ready;

  assign read_valid = state == S_FETCH;
  assign read_addr = index;
  assign byte_valid = line_ready &&
      (state == S_STX || state == S_LGE || state == S_SEND || state == S_BCC);
  assign byte_data = state == S_BCC ? check : held;
  assign line_request = sending && state != S_DRAIN;
  assign sending = state != S_IDLE;
  assign sent = state == S_DRAIN && !line_busy;

  bcc bcc_i (
      .clk(clk),
      // stream in
      .clear(!sending),
      .byte_valid(taken),
      .byte_data(byte_data),
      // status
      .value(check)
  );

  initial adr = 8'd0;

  always @(posedge clk) begin
    case (state)
      S_STX:
      if (taken) begin
        held  <= {3'd0, length} + 8'd1;
        state <= S_LGE;
      end
      S_LGE:   if (taken) state <= S_FETCH;
      S_FETCH: if (read_ready) state <= S_LATCH;
      S_LATCH: begin
        held <= read_data;
        if (index == 5'd0) adr <= read_data;
        index <= index + 5'd1;
        state <= S_SEND;
      end
      S_SEND:  if (taken) state <= index == length ? S_BCC : S_FETCH;
      S_BCC:   if (taken) state <= S_DRAIN;
      S_DRAIN: if (sent) state <= S_IDLE;
      default: begin
        index <= 5'd0;
        held  <= STX;
        if (start) state <= S_STX;
      end
    endcase
    if (rst) state <= S_IDLE;
  end

`ifndef SYNTHESIS
  reg [8*5-1:0] state_name;
  always @* begin
    case (state)
      S_STX:   state_name = "STX";
      S_LGE:   state_name = "LGE";
      S_FETCH: state_name = "FETCH";
      S_LATCH: state_name = "LATCH";
      S_SEND:  state_name = "SEND";
      S_BCC:   state_name = "BCC";
      S_DRAIN: state_name = "DRAIN";
      default: state_name = "IDLE";
    endcase
  end
`endif

endmodule

`default_nettype wire
