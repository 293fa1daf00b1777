// SPDX-License-Identifier: Apache-2.0
// One EIA-485 line from pin to character and back: synchroniser, glitch filter and UART.
//
// mute: level, the card drives the line. The receiver then hears an idle line (LINE-6, FC-10).
// synced: the pin, synchronised but not filtered. line: the filtered pin. All other ports are
// those of uart. Delay from pin to line: 2 clocks and 5 ticks. Units: tick16 = 1/16 bit.
// Clock domain: clk. Only wires in here. Rules: LINE-1, LINE-5, FC-1.
`default_nettype none

module line_uart (
    input  wire       clk,
    input  wire       rst,
    input  wire       tick16,
    // pins
    input  wire       rx,
    output wire       tx,
    // stream in
    input  wire       send_valid,
    output wire       send_ready,
    input  wire [7:0] send_data,
    input  wire       send_check,
    // stream out
    output wire       byte_valid,
    output wire [7:0] byte_data,
    output wire       byte_parity_error,
    output wire       byte_framing_error,
    // check
    output wire       bit_valid,
    output wire       bit_data,
    input  wire       check_bit,
    // direction
    input  wire       mute,
    input  wire       line_ready,
    // configuration
    input  wire       parity_enable,
    input  wire       parity_odd,
    input  wire       two_stop,
    // status
    output wire       synced,
    output wire       line,
    output wire       receiving,
    output wire       sending,
    output wire       start_seen
);

  sync_2ff #(
      .RESET_VALUE(1'b1)
  ) sync_i (
      .clk(clk),
      .rst(rst),
      // pin
      .raw(rx),
      // status
      .synced(synced)
  );

  glitch_filter filter_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      // pin
      .raw(synced),
      // configuration
      .mute(mute),
      // status
      .clean(line)
  );

  uart uart_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      // pins, the input filtered
      .line(line),
      .txd(tx),
      // stream in
      .send_valid(send_valid),
      .send_ready(send_ready),
      .send_data(send_data),
      .send_check(send_check),
      // stream out
      .byte_valid(byte_valid),
      .byte_data(byte_data),
      .byte_parity_error(byte_parity_error),
      .byte_framing_error(byte_framing_error),
      // check
      .bit_valid(bit_valid),
      .bit_data(bit_data),
      .check_bit(check_bit),
      // direction
      .line_ready(line_ready),
      // configuration
      .parity_enable(parity_enable),
      .parity_odd(parity_odd),
      .two_stop(two_stop),
      // status
      .receiving(receiving),
      .sending(sending),
      .start_seen(start_seen)
  );

endmodule

`default_nettype wire
