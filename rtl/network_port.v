// SPDX-License-Identifier: Apache-2.0
// The network line from pin to frame. Only the modules in here know Modbus RTU framing.
//
// Receive: sync_2ff, glitch_filter, uart, silence_timer, crc16_modbus, rtu_rx. Send: rtu_tx,
// crc16_modbus, rs485_dir, uart. One UART and one CRC unit serve both directions, because the
// receiver is deaf while DE is high. This module only wires; drive_port has the same shape.
// silent: t3.5 is over and no character has begun, which a commit asks for. A pulse below a
// quarter bit stops the count of silence and does not end it, so it costs no commit (LINE-5).
// quiet: silent, and the pin is high; only then may a reply start (SAFE-2).
// fault: see rtu_rx and break_filter.
// strict_t15: a silence of t1.5 ends a frame; 0: only t3.5 does (FRAME-3).
// break_tolerant = 1, for a bus without bias: the low of a character or more after a good frame is
// silence (FRAME-3). silent and quiet then hold in such a low, too. See break_filter.
// loopback_open: the CRC is sent with wrong bits, so that no slave takes the test's pattern for a
// frame (LOOP-1). Clock domain: clk. Rules: LINE-1 ... LINE-6, FRAME-1 ... FRAME-8, LOOP-1.
`default_nettype none

module network_port (
    input  wire       clk,
    input  wire       rst,
    input  wire       tick16,
    // frame memory
    output wire       write_valid,
    input  wire       write_ready,
    output wire [5:0] write_addr,
    output wire [7:0] write_data,
    output wire       read_valid,
    input  wire       read_ready,
    output wire [4:0] read_addr,
    input  wire [7:0] read_data,
    input  wire       read_damaged,
    // stream in
    input  wire       reply_start,
    input  wire [4:0] reply_length,
    // pins
    input  wire       rx,
    output wire       tx,
    output wire       de,
    // format and silences, see uart and silence_timer
    input  wire       parity_enable,
    input  wire       parity_odd,
    input  wire       two_stop,
    input  wire [8:0] half_end,
    input  wire       half_uneven,
    // configuration
    input  wire       strict_t15,
    input  wire       break_tolerant,
    input  wire [7:0] own_address,
    input  wire       loopback_open,
    // status
    output wire       sending,
    output wire       quiet,
    output wire       start_seen,
    output wire       silent,
    output wire       fault,
    // newest frame, see rtu_rx
    output wire       candidate,
    output wire       commit,
    output wire       revoke,
    output wire [7:0] frame_length,
    output wire       frame_broadcast,
    output wire       frame_writes_coils,
    output wire       frame_writes_parameter,
    output wire       frame_bank,
    // dropped frames, see rtu_rx
    output wire       count_crc,
    output wire       count_parity,
    output wire       count_framing,
    output wire       count_t15,
    output wire       count_overrun,
    output wire       count_foreign
);

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
  wire crc_clear;
  wire crc_bit;
  wire check_bit;
  wire crc_good;
  wire bit_valid;
  wire bit_data;
  wire tx_valid;
  wire tx_ready;
  wire tx_check;
  wire tx_busy;
  wire line_request;
  wire line_ready;
  wire uart_start;
  wire may_break;
  wire byte_valid;
  wire busy;
  wire in_break;
  wire receiver_fault;
  wire break_fault;

  assign write_data = rx_data;
  assign silent = long_silent && !busy && !byte_valid && !de;
  assign quiet = silent && (synced || in_break);
  assign fault = receiver_fault || break_fault;

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
      .send_data(read_data),
      .send_check(tx_check),
      // stream out
      .byte_valid(rx_valid),
      .byte_data(rx_data),
      .byte_parity_error(rx_parity_error),
      .byte_framing_error(rx_framing_error),
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
      .receiving(rx_busy),
      .sending(tx_busy),
      .start_seen(uart_start)
  );

  break_filter breaks_i (
      .clk(clk),
      .rst(rst),
      // line activity
      .line(line),
      .receiving(rx_busy),
      .line_start(uart_start),
      .line_byte(rx_valid),
      // frame
      .may_break(may_break),
      .sending(de),
      // status
      .start_seen(start_seen),
      .byte_valid(byte_valid),
      .busy(busy),
      .in_break(in_break),
      .fault(break_fault)
  );

  silence_timer silence_i (
      .clk(clk),
      .rst(rst),
      .tick16(tick16),
      // line activity
      .restart(byte_valid),
      .sending(de),
      .busy(busy || !(synced || in_break)),
      // configuration
      .half_end(half_end),
      .half_uneven(half_uneven),
      .two_stop(two_stop),
      // status
      .half_reached(half_reached),
      .short_reached(short_reached),
      .long_reached(long_reached),
      .long_silent(long_silent)
  );

  crc16_modbus crc_i (
      .clk(clk),
      // stream in
      .clear(crc_clear || reply_start),
      .bit_valid(bit_valid),
      .bit_data(bit_data),
      // status
      .check_bit(crc_bit),
      .good(crc_good)
  );

  rtu_rx rtu_rx_i (
      .clk(clk),
      .rst(rst),
      // stream in
      .byte_valid(byte_valid),
      .byte_data(rx_data),
      .byte_parity_error(rx_parity_error),
      .byte_framing_error(rx_framing_error),
      .line_start(uart_start),
      .start_seen(start_seen),
      .half_reached(half_reached),
      .short_reached(short_reached),
      .long_reached(long_reached),
      // frame memory, 32 bytes a bank
      .write_valid(write_valid),
      .write_ready(write_ready),
      .write_addr(write_addr),
      // check
      .crc_clear(crc_clear),
      .crc_good(crc_good),
      // configuration
      .strict_t15(strict_t15),
      .break_tolerant(break_tolerant),
      .deaf(de),
      .own_address(own_address),
      // status
      .candidate(candidate),
      .commit(commit),
      .revoke(revoke),
      .frame_length(frame_length),
      .frame_broadcast(frame_broadcast),
      .frame_writes_coils(frame_writes_coils),
      .frame_writes_parameter(frame_writes_parameter),
      .frame_bank(frame_bank),
      .may_break(may_break),
      .count_crc(count_crc),
      .count_parity(count_parity),
      .count_framing(count_framing),
      .count_t15(count_t15),
      .count_overrun(count_overrun),
      .count_foreign(count_foreign),
      .fault(receiver_fault)
  );

  rtu_tx rtu_tx_i (
      .clk(clk),
      .rst(rst),
      // stream in
      .start(reply_start),
      .length(reply_length),
      // frame memory
      .read_valid(read_valid),
      .read_ready(read_ready),
      .read_addr(read_addr),
      .read_damaged(read_damaged || loopback_open),
      // stream out, its data straight from the frame memory
      .send_valid(tx_valid),
      .send_ready(tx_ready),
      .send_check(tx_check),
      // check
      .crc_bit(crc_bit),
      .check_bit(check_bit),
      // direction
      .line_request(line_request),
      .line_busy(tx_busy),
      // status
      .sending(sending)
  );

  // A sender may be 4 % slow (LINE-5). Its last stop bit then ends 0.44 bits later than by this
  // card's clock. A lead of 9/16 bit instead of 1/4 bit keeps the reply after 3.5 characters for
  // such a sender, too (FRAME-8).
  rs485_dir #(
      .LEAD_TICKS(9)
  ) dir_i (
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

endmodule

`default_nettype wire
