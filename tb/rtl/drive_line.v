// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: the drive port with the base tick made from the clock, as on the card. SystemVerilog joins
// what has the port's names.
`default_nettype none

module drive_line #(
    parameter CLK_HZ = 2_000_000
) (
    input  wire       clk,
    input  wire       rst,
    // pins
    input  wire       rx,
    output wire       tx,
    output wire       de,
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
    // configuration
    input  wire       listen_again,
    input  wire       listen_stop,
    // status
    output wire       sending,
    output wire       quiet,
    output wire       listening,
    output wire       candidate,
    output wire       good,
    output wire       bad
);

  wire tick_base;
  wire tick16_drive;

  baud_base #(.CLK_HZ(CLK_HZ)) base_i (.*);

  baud_divider divider_i (
      .clk(clk),
      .tick_base(tick_base),
      .tick16_modbus(),
      .tick16_drive(tick16_drive),
      .modbus_undivided(1'b0),
      .modbus_mask(7'd0)
  );

  drive_port port_i (
      .tick16(tick16_drive),
      .start_seen(),
      .*
  );

endmodule

`default_nettype wire
