// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: the whole card and what its two ports are connected to.
//
// wired = 0: each port hears its line, on which everybody else sends.
// wired = 1: the two ports are wired to each other as a half-duplex pair: each hears
// the other while the other's DE is up, 1 else. cut_to_*: that direction is dead;
// flip_to_*: that port hears the opposite; a line held at 0 wins, as a short circuit.
// Besides the pins, the strobes of docs/guide/timing.md, looked up inside the card.
// Clock domain: clk. Rule: LOOP-1.
`default_nettype none

module wired_card #(
    parameter CLK_HZ = 2_000_000,
    parameter FIRMWARE_HEX = "firmware.hex"
) (
    input  wire       clk,
    input  wire       rst_n,
    // switches
    input  wire [9:1] sw_baud,
    input  wire [8:1] sw_addr,
    // wires
    input  wire       wired,
    input  wire       modbus_line,
    input  wire       drive_line,
    input  wire       cut_to_modbus,
    input  wire       cut_to_drive,
    input  wire       flip_to_modbus,
    input  wire       flip_to_drive,
    // pins
    output wire       modbus_rx,
    output wire       modbus_tx,
    output wire       modbus_de,
    output wire       drive_rx,
    output wire       drive_tx,
    output wire       drive_de,
    // LEDs
    output wire       led_modbus_red,
    output wire       led_modbus_green,
    output wire       led_drive_red,
    output wire       led_drive_green,
    // strobes
    output wire       candidate,
    output wire       commit,
    output wire       revoke,
    output wire       reply_queued,
    output wire       telegram_queued,
    output wire       drive_candidate,
    output wire       drive_good
);

  wire to_modbus = drive_tx || !drive_de || cut_to_modbus || !wired;
  wire to_drive = modbus_tx || !modbus_de || cut_to_drive || !wired;

  assign modbus_rx = (to_modbus && modbus_line) ^ flip_to_modbus;
  assign drive_rx = (to_drive && drive_line) ^ flip_to_drive;

  assign candidate = card_i.candidate;
  assign commit = card_i.commit;
  assign revoke = card_i.revoke;
  assign reply_queued = card_i.mailbox_i.reply_queued;
  assign telegram_queued = card_i.mailbox_i.telegram_queued;
  assign drive_candidate = card_i.drive_candidate;
  assign drive_good = card_i.drive_good;

  rtu2fc #(
      .CLK_HZ(CLK_HZ),
      .FIRMWARE_HEX(FIRMWARE_HEX)
  ) card_i (
      .clk(clk),
      .rst_n(rst_n),
      // switches
      .sw_baud(sw_baud),
      .sw_addr(sw_addr),
      // network line
      .modbus_rx(modbus_rx),
      .modbus_tx(modbus_tx),
      .modbus_de(modbus_de),
      // drive line
      .drive_rx(drive_rx),
      .drive_tx(drive_tx),
      .drive_de(drive_de),
      // LEDs
      .led_modbus_red(led_modbus_red),
      .led_modbus_green(led_modbus_green),
      .led_drive_red(led_drive_red),
      .led_drive_green(led_drive_green)
  );

endmodule

`default_nettype wire
