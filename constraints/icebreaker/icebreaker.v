// SPDX-License-Identifier: Apache-2.0
// iCEBreaker (iCE40 UP5K): transceivers and switches on its three PMOD connectors.
//
// Lines, switches and LEDs need one pin more than the 24 PMOD pins. Switch 9 of the baud
// switch, which only the loop-back test reads (LOOP-1), is the user button, held at
// power-up. The section with buttons and LEDs on PMOD 2 must be broken off. The drive's
// LEDs are on PMOD 1A, lit by a high pin. clk: the board's 12 MHz.
// There is no reset pin. reset_sync holds the reset for the first clocks after
// configuration, and the switches settle before the card starts.
// Rules: TOP-1, LINE-6, LED-2, LOOP-1.
`default_nettype none

module icebreaker #(
    parameter CLK_HZ = 12_000_000,
    parameter FIRMWARE_HEX = "firmware.hex",
    parameter EXTENDED_SWITCHES = 0
) (
    input  wire       clk,
    // switches, to ground; the button is switch 9 of the baud switch
    input  wire [8:1] sw_baud_n,
    input  wire       button_n,
    input  wire [8:1] sw_addr_n,
    // network line
    input  wire       modbus_rx,
    output wire       modbus_tx,
    output wire       modbus_de,
    // drive line
    input  wire       drive_rx,
    output wire       drive_tx,
    output wire       drive_de,
    // LEDs: the network's are the board's own
    output wire       led_modbus_red_n,
    output wire       led_modbus_green_n,
    output wire       led_drive_red,
    output wire       led_drive_green
);

  // The board's own LEDs are lit by a low pin.
  wire led_modbus_red;
  wire led_modbus_green;

  assign led_modbus_red_n   = !led_modbus_red;
  assign led_modbus_green_n = !led_modbus_green;

  rtu2fc #(
      .CLK_HZ(CLK_HZ),
      .FIRMWARE_HEX(FIRMWARE_HEX),
      .SOFT_CORE(0),
      .LOCKSTEP(1),
      .MEMORY_BYTES(8192),
      .MASTER_LOSS_STOP(0),
      .EXTENDED_SWITCHES(EXTENDED_SWITCHES)
  ) card_i (
      .clk(clk),
      .rst_n(1'b1),
      // switches
      .sw_baud({~button_n, ~sw_baud_n}),
      .sw_addr(~sw_addr_n),
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
