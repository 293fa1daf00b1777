// SPDX-License-Identifier: Apache-2.0
// The drive line from pin to telegram. Only the modules in here know FC telegram framing.
//
// Receive: sync_2ff, glitch_filter, uart, silence_timer, bcc, fc_rx. Send: fc_tx, rs485_dir,
// uart. The receiver listens after a telegram that expects a reply. Character format: 9600 8E1,
// fixed (FC-1). This module only wires; network_port has the same shape. telegram_length to
// telegram_stop: see fc_tx and commit_gate. listen_again: forget the received reply and listen
// anew. listen_stop and telegram_start end the listening.
// Clock domain: clk.
// Rules: FC-1, FC-8, FC-10.
`default_nettype none

module drive_port (
    input  wire       clk,
    input  wire       rst,
    input  wire       tick16,
    // frame memory
    output wire       write_valid,
    input  wire       write_ready,
    output wire [4:0] write_addr,
    output wire [7:0] write_data,
    output wire       read_valid,
    input  wire       read_ready,
    output wire [4:0] read_addr,
    input  wire [7:0] read_data,
    // stream in
    input  wire       telegram_start,
    input  wire [4:0] telegram_length,
    input  wire       telegram_no_reply,
    input  wire       telegram_control,
    input  wire       telegram_stop,
    // pins
    input  wire       rx,
    output wire       tx,
    output wire       de,
    // configuration
    input  wire       listen_again,
    input  wire       listen_stop,
    // status
    output wire       listening,
    output wire       sending,
    output wire       quiet,
    output wire       start_seen,
    output wire       candidate,
    output wire       good,
    output wire       bad
);

  // A gap of exactly 2 characters is allowed, so the limit is 1/4 bit later.
  localparam [11:0] PAUSE_TICKS = 12'd352;
  localparam [11:0] GAP_TICKS = PAUSE_TICKS + 12'd4;
  localparam [11:0] SILENCE_START = 12'd18;  // of silence_timer
  localparam [11:0] HALF_END = SILENCE_START + GAP_TICKS / 12'd4 - 12'd1;
  localparam [0:0] PARITY_ENABLE = 1'b1;
  localparam [0:0] PARITY_ODD = 1'b0;
  localparam [0:0] TWO_STOP = 1'b0;

  wire synced;
  wire line;
  wire rx_valid;
  wire [7:0] rx_data;
  wire rx_parity_error;
  wire rx_framing_error;
  wire rx_busy;
  wire half_reached;
  wire short_reached;
  wire long_reached;
  wire long_silent;
  wire bcc_clear;
  wire bcc_good;
  wire bit_valid;
  wire bit_data;
  wire tx_valid;
  wire tx_ready;
  wire [7:0] tx_data;
  wire tx_busy;
  wire line_request;
  wire line_ready;
  wire sent;
  wire [7:0] adr;

  assign write_data = rx_data;
  assign quiet = long_silent && !rx_busy && !rx_valid && synced && !de;

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
      .mute(de),
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
      .send_valid(tx_valid),
      .send_ready(tx_ready),
      .send_data(tx_data),
      .send_check(1'b0),
      // stream out
      .byte_valid(rx_valid),
      .byte_data(rx_data),
      .byte_parity_error(rx_parity_error),
      .byte_framing_error(rx_framing_error),
      // check
      .bit_valid(bit_valid),
      .bit_data(bit_data),
      .check_bit(1'b0),
      // direction
      .line_ready(line_ready),
      // configuration
      .parity_enable(PARITY_ENABLE),
      .parity_odd(PARITY_ODD),
      .two_stop(TWO_STOP),
      // status
      .receiving(rx_busy),
      .sending(tx_busy),
      .start_seen(start_seen)
  );

  silence_timer #(
      .WIDTH(7),
      .SHORT_HALVES(3'd4),
      .LONG_HALVES(3'd4)
  ) silence_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      // line activity
      .restart(rx_valid),
      .sending(de),
      .busy(rx_busy || !synced),
      // configuration
      .half_end(HALF_END[6:0]),
      .half_uneven(1'b0),
      .two_stop(TWO_STOP),
      // status
      .half_reached(half_reached),
      .short_reached(short_reached),
      .long_reached(long_reached),
      .long_silent(long_silent)
  );

  bcc bcc_i (
      .clk(clk),
      // stream in
      .clear(bcc_clear),
      .bit_valid(bit_valid),
      .bit_data(bit_data),
      // status
      .good(bcc_good)
  );

  fc_rx fc_rx_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      // stream in
      .byte_valid(rx_valid),
      .byte_data(rx_data),
      .byte_parity_error(rx_parity_error),
      .byte_framing_error(rx_framing_error),
      .start_seen(start_seen),
      .long_reached(long_reached),
      // frame memory, 32 bytes
      .write_valid(write_valid),
      .write_ready(write_ready),
      .write_addr(write_addr),
      // check
      .check_clear(bcc_clear),
      .check_good(bcc_good),
      // configuration
      .listen_start((sent && !telegram_no_reply) || listen_again),
      .listen_stop(telegram_start || listen_stop),
      .adr(adr),
      // status
      .listening(listening),
      .candidate(candidate),
      .good(good),
      .bad(bad)
  );

  fc_tx fc_tx_i (
      .clk(clk),
      .rst(rst),
      // stream in
      .start(telegram_start),
      .length(telegram_length),
      .control(telegram_control),
      .stop(telegram_stop),
      // frame memory
      .read_valid(read_valid),
      .read_ready(read_ready),
      .read_addr(read_addr),
      .read_data(read_data),
      // stream out
      .send_valid(tx_valid),
      .send_ready(tx_ready),
      .send_data(tx_data),
      // direction
      .line_request(line_request),
      .line_busy(tx_busy),
      // status
      .sending(sending),
      .sent(sent),
      .adr(adr)
  );

  rs485_dir dir_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      // stream in
      .request(line_request),
      .ready(line_ready),
      // pin
      .de(de),
      // status
      .tx_busy(tx_busy)
  );

  // long_reached serves as gap and pause.
  wire unused = &{1'b0, half_reached, short_reached};

endmodule

`default_nettype wire
