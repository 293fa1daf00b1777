// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: rtu_tx with what it sends through: CRC unit, direction, UART.
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

  wire crc_valid;
  wire [15:0] crc;
  wire crc_good;
  wire byte_valid;
  wire byte_ready;
  wire [7:0] byte_data;
  wire line_request;
  wire line_ready;
  wire tx_busy;

  crc16_modbus crc_i (
      .clk(clk),
      .clear(!sending),
      .byte_valid(crc_valid),
      .byte_data(byte_data),
      .crc(crc),
      .good(crc_good)
  );

  rtu_tx rtu_tx_i (
      .clk(clk),
      .rst(rst),
      .start(start),
      .length(length),
      .read_valid(read_valid),
      .read_ready(read_ready),
      .read_addr(read_addr),
      .read_data(read_data),
      .crc_valid(crc_valid),
      .crc(crc),
      .byte_valid(byte_valid),
      .byte_ready(byte_ready),
      .byte_data(byte_data),
      .line_request(line_request),
      .line_ready(line_ready),
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

  uart_tx uart_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      .byte_valid(byte_valid),
      .byte_ready(byte_ready),
      .byte_data(byte_data),
      .txd(tx),
      .parity_enable(parity_enable),
      .parity_odd(parity_odd),
      .two_stop(two_stop),
      .busy(tx_busy)
  );

endmodule

`default_nettype wire
