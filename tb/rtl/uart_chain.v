// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: the path of a character through one port, from clock and pin to byte:
// baud_base, baud_divider, sync_2ff, glitch_filter, uart.
`default_nettype none

module uart_chain #(
    parameter CLK_HZ = 12_000_000
) (
    input  wire       clk,
    input  wire       rst,
    // pins
    input  wire       rx,
    output wire       tx,
    // configuration
    input  wire       undivided,
    input  wire [6:0] mask,
    input  wire       parity_enable,
    input  wire       parity_odd,
    input  wire       two_stop,
    // stream in
    input  wire       tx_valid,
    output wire       tx_ready,
    input  wire [7:0] tx_data,
    // stream out
    output wire       rx_valid,
    output wire [7:0] rx_data,
    output wire       rx_parity_error,
    output wire       rx_framing_error,
    // status
    output wire       start_seen,
    output wire       tick16
);

  wire tick_base;
  wire synced;
  wire line;

  baud_base #(
      .CLK_HZ(CLK_HZ)
  ) base_i (
      .clk(clk),
      .rst(rst),
      .tick_base(tick_base)
  );

  baud_divider divider_i (
      .clk(clk),
      .tick_base(tick_base),
      .tick16_modbus(tick16),
      .tick16_drive(),
      .modbus_undivided(undivided),
      .modbus_mask(mask)
  );

  sync_2ff sync_i (
      .clk(clk),
      .rst(rst),
      .raw(rx),
      .synced(synced)
  );

  glitch_filter filter_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      .raw(synced),
      .mute(1'b0),
      .clean(line)
  );

  uart uart_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      .line(line),
      .txd(tx),
      .send_valid(tx_valid),
      .send_ready(tx_ready),
      .send_data(tx_data),
      .send_check(1'b0),
      .byte_valid(rx_valid),
      .byte_data(rx_data),
      .byte_parity_error(rx_parity_error),
      .byte_framing_error(rx_framing_error),
      .bit_valid(),
      .bit_data(),
      .check_bit(1'b0),
      .line_ready(1'b1),
      .parity_enable(parity_enable),
      .parity_odd(parity_odd),
      .two_stop(two_stop),
      .receiving(),
      .sending(),
      .start_seen(start_seen)
  );

endmodule

`default_nettype wire
