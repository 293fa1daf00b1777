// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: rtu_rx with the CRC unit that it needs to check frames.
`default_nettype none

module rtu_rx_crc #(
    parameter [0:0] STRICT_T15 = 1'b1
) (
    input  wire       clk,
    input  wire       rst,
    // stream in
    input  wire       bit_valid,
    input  wire       bit_data,
    input  wire       byte_valid,
    input  wire [7:0] byte_data,
    input  wire       byte_parity_error,
    input  wire       byte_framing_error,
    input  wire       start_seen,
    input  wire       half_reached,
    input  wire       short_reached,
    input  wire       long_reached,
    // frame memory
    output wire       write_valid,
    input  wire       write_ready,
    output wire [5:0] write_addr,
    // configuration
    input  wire       deaf,
    input  wire [7:0] own_address,
    // status
    output wire       candidate,
    output wire       commit,
    output wire       revoke,
    output wire [7:0] frame_length,
    output wire       frame_broadcast,
    output wire       frame_writes_coils,
    output wire       frame_writes_parameter,
    output wire       frame_bank,
    output wire       count_crc,
    output wire       count_parity,
    output wire       count_framing,
    output wire       count_t15,
    output wire       count_overrun,
    output wire       count_foreign,
    output wire       fault
);

  wire crc_clear;
  wire crc_good;

  crc16_modbus crc_i (
      .clk(clk),
      .clear(crc_clear),
      .bit_valid(bit_valid),
      .bit_data(bit_data),
      .check_bit(),
      .good(crc_good)
  );

  rtu_rx rx_i (
      .clk(clk),
      .rst(rst),
      .byte_valid(byte_valid),
      .byte_data(byte_data),
      .byte_parity_error(byte_parity_error),
      .byte_framing_error(byte_framing_error),
      .line_start(start_seen),
      .start_seen(start_seen),
      .half_reached(half_reached),
      .short_reached(short_reached),
      .long_reached(long_reached),
      .write_valid(write_valid),
      .write_ready(write_ready),
      .write_addr(write_addr),
      .crc_clear(crc_clear),
      .crc_good(crc_good),
      .strict_t15(STRICT_T15),
      .break_tolerant(1'b0),
      .deaf(deaf),
      .own_address(own_address),
      .candidate(candidate),
      .commit(commit),
      .revoke(revoke),
      .frame_length(frame_length),
      .frame_broadcast(frame_broadcast),
      .frame_writes_coils(frame_writes_coils),
      .frame_writes_parameter(frame_writes_parameter),
      .frame_bank(frame_bank),
      .may_break(),
      .count_crc(count_crc),
      .count_parity(count_parity),
      .count_framing(count_framing),
      .count_t15(count_t15),
      .count_overrun(count_overrun),
      .count_foreign(count_foreign),
      .fault(fault)
  );

endmodule

`default_nettype wire
