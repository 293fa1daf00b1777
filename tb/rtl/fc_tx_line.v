// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: fc_tx with the UART that it sends through; the bench takes the
// place of the line driver.
`default_nettype none

module fc_tx_line (
    input  wire       clk,
    input  wire       rst,
    input  wire       tick16,
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
    // pin
    output wire       tx,
    // direction
    output wire       line_request,
    input  wire       line_ready,
    // status
    output wire       line_busy,
    output wire       sending,
    output wire       sent,
    output wire [7:0] adr
);

  wire send_valid;
  wire send_ready;
  wire [7:0] send_data;

  fc_tx fc_tx_i (
      .clk(clk),
      .rst(rst),
      .start(start),
      .length(length),
      .control(control),
      .stop(stop),
      .read_valid(read_valid),
      .read_ready(read_ready),
      .read_addr(read_addr),
      .read_data(read_data),
      .send_valid(send_valid),
      .send_ready(send_ready),
      .send_data(send_data),
      .line_request(line_request),
      .line_busy(line_busy),
      .sending(sending),
      .sent(sent),
      .adr(adr)
  );

  uart uart_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      .line(1'b1),
      .txd(tx),
      .send_valid(send_valid),
      .send_ready(send_ready),
      .send_data(send_data),
      .send_check(1'b0),
      .byte_valid(),
      .byte_data(),
      .byte_parity_error(),
      .byte_framing_error(),
      .bit_valid(),
      .bit_data(),
      .check_bit(1'b0),
      .line_ready(line_ready),
      .parity_enable(1'b1),
      .parity_odd(1'b0),
      .two_stop(1'b0),
      .receiving(),
      .sending(line_busy),
      .start_seen()
  );

endmodule

`default_nettype wire
