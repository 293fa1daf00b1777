// SPDX-License-Identifier: Apache-2.0
// Sends one Modbus RTU reply: address and PDU from the frame memory, then the CRC.
//
// start begins the reply and clears the CRC unit; the commit gate decides on start.
// line_request asks for DE. Bytes follow without a gap if the memory answers within one bit. The
// CRC goes low byte first (FRAME-4); send_check makes the UART send check_bit, which is crc_bit.
// read_damaged: the memory found a damaged byte, two clocks after it was ready. Then check_bit is
// the inverse of crc_bit to the end of the reply. Any read of the memory counts, also one by
// the soft core. docs/hardening.md, Damaged reply (SAFE-4)
// sending: level, from start to the end of the last stop bit. length: address and PDU, 2 to 31
// bytes. With any other length the reply ends after the memory's 32 bytes at the latest.
// Clock domain: clk. Rules: FRAME-4, LINE-6, SAFE-2, SAFE-4.
`default_nettype none

module rtu_tx (
    input  wire       clk,
    input  wire       rst,
    // stream in
    input  wire       start,
    input  wire [4:0] length,
    // frame memory
    output wire       read_valid,
    input  wire       read_ready,
    output wire [4:0] read_addr,
    input  wire       read_damaged,
    // stream out, its data straight from the frame memory
    output wire       send_valid,
    input  wire       send_ready,
    output wire       send_check,
    // check
    input  wire       crc_bit,
    output wire       check_bit,
    // direction
    output wire       line_request,
    input  wire       line_busy,
    // status
    output wire       sending
);

  localparam [2:0] S_IDLE = 3'd0;
  localparam [2:0] S_FETCH = 3'd1;  // read the next byte from the frame memory
  localparam [2:0] S_SEND = 3'd2;  // pass it to the UART, which is ready
  localparam [2:0] S_CRC_LOW = 3'd3;
  localparam [2:0] S_CRC_HIGH = 3'd4;
  localparam [2:0] S_DRAIN = 3'd5;  // until the last stop bit is over

  reg [2:0] state = S_IDLE;
  reg [4:0] index = 5'd0;
  reg spoilt = 1'b0;

  assign read_valid = state == S_FETCH && send_ready;
  assign read_addr = index;
  assign send_valid = state == S_SEND || state == S_CRC_LOW || state == S_CRC_HIGH;
  assign send_check = state == S_CRC_HIGH || state == S_DRAIN;
  assign check_bit = crc_bit != spoilt;
  assign line_request = sending && state != S_DRAIN;
  assign sending = state != S_IDLE;

  always @(posedge clk) begin
    spoilt <= sending && (spoilt || read_damaged);
    case (state)
      S_FETCH:
      if (read_valid && read_ready) begin
        index <= index + 5'd1;
        state <= S_SEND;
      end
      // Ends after 32 bytes even if index never equals length (SAFE-2).
      S_SEND: state <= index == length || index == 5'd0 ? S_CRC_LOW : S_FETCH;
      S_CRC_LOW: if (send_ready) state <= S_CRC_HIGH;
      S_CRC_HIGH: if (send_ready) state <= S_DRAIN;
      S_DRAIN: if (!line_busy) state <= S_IDLE;
      default: begin
        index <= 5'd0;
        // docs/hardening.md, Undefined states (SAFE-4)
        state <= start ? S_FETCH : S_IDLE;
      end
    endcase
    if (rst) state <= S_IDLE;
  end

endmodule

`default_nettype wire
