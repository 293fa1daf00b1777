// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: fc_rx with the BCC unit that it needs to check telegrams.
`default_nettype none

module fc_rx_bcc (
    input  wire       clk,
    input  wire       rst,
    input  wire       tick16,
    // stream in
    input  wire       bit_valid,
    input  wire       bit_data,
    input  wire       byte_valid,
    input  wire [7:0] byte_data,
    input  wire       byte_parity_error,
    input  wire       byte_framing_error,
    input  wire       start_seen,
    input  wire       long_reached,
    // frame memory
    output wire       write_valid,
    input  wire       write_ready,
    output wire [4:0] write_addr,
    // configuration
    input  wire       listen_start,
    input  wire       listen_stop,
    input  wire [7:0] adr,
    // status
    output wire       listening,
    output wire       candidate,
    output wire       good,
    output wire       bad
);

  wire check_clear;
  wire check_good;

  bcc bcc_i (
      .clk(clk),
      .clear(check_clear),
      .bit_valid(bit_valid),
      .bit_data(bit_data),
      .good(check_good)
  );

  fc_rx rx_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      .byte_valid(byte_valid),
      .byte_data(byte_data),
      .byte_parity_error(byte_parity_error),
      .byte_framing_error(byte_framing_error),
      .start_seen(start_seen),
      .long_reached(long_reached),
      .write_valid(write_valid),
      .write_ready(write_ready),
      .write_addr(write_addr),
      .check_clear(check_clear),
      .check_good(check_good),
      .listen_start(listen_start),
      .listen_stop(listen_stop),
      .adr(adr),
      .listening(listening),
      .candidate(candidate),
      .good(good),
      .bad(bad)
  );

endmodule

`default_nettype wire
