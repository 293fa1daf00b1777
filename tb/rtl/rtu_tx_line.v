// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: rtu_tx with the units that it sends through: CRC unit, direction, UART.
`default_nettype none

module rtu_tx_line (
    input  wire       clk,
    input  wire       rst,
    input  wire       tick16,
    // stream in
    input  wire       start,
    input  wire [4:0] length,
    // frame memory
    output wire       read_valid,
    input  wire       read_ready,
    output wire [4:0] read_addr,
    input  wire [7:0] read_data,
    input  wire       read_damaged,
    // pins
    output wire       tx,
    output wire       de,
    // configuration
    input  wire       parity_enable,
    input  wire       parity_odd,
    input  wire       two_stop,
    // status
    output wire       sending
);

  wire bit_valid;
  wire bit_data;
  wire crc_bit;
  wire check_bit;
  wire send_valid;
  wire send_ready;
  wire send_check;
  wire line_request;
  wire line_ready;
  wire tx_busy;

  crc16_modbus crc_i (
      .clk(clk),
      .clear(start && !sending),
      .bit_valid(bit_valid),
      .bit_data(bit_data),
      .check_bit(crc_bit),
      .good()
  );

  rtu_tx rtu_tx_i (
      .clk(clk),
      .rst(rst),
      .start(start),
      .length(length),
      .read_valid(read_valid),
      .read_ready(read_ready),
      .read_addr(read_addr),
      .read_damaged(read_damaged),
      .send_valid(send_valid),
      .send_ready(send_ready),
      .send_check(send_check),
      .crc_bit(crc_bit),
      .check_bit(check_bit),
      .line_request(line_request),
      .line_busy(tx_busy),
      .sending(sending)
  );

  rs485_dir dir_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      .request(line_request),
      .ready(line_ready),
      .de(de),
      .tx_busy(tx_busy)
  );

  uart uart_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      .line(1'b1),
      .txd(tx),
      .send_valid(send_valid),
      .send_ready(send_ready),
      .send_data(read_data),
      .send_check(send_check),
      .byte_valid(),
      .byte_data(),
      .byte_parity_error(),
      .byte_framing_error(),
      .bit_valid(bit_valid),
      .bit_data(bit_data),
      .check_bit(check_bit),
      .line_ready(line_ready),
      .parity_enable(parity_enable),
      .parity_odd(parity_odd),
      .two_stop(two_stop),
      .receiving(),
      .sending(tx_busy),
      .start_seen()
  );

endmodule

`default_nettype wire
