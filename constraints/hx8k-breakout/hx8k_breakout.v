// SPDX-License-Identifier: Apache-2.0
// Lattice's HX8K breakout board: transceivers and switches on header J2, its own LEDs.
//
// Switches close to ground, with the FPGA's weak pull-ups. The LEDs, all of one colour,
// are lit by a high pin. clk: the board's 12 MHz.
// There is no reset pin. reset_sync holds the reset for the first clocks after
// configuration, and the switches settle before the card starts.
// Rules: TOP-1, LINE-6, LED-2.
`default_nettype none

module hx8k_breakout #(
    parameter CLK_HZ = 12_000_000,
    parameter FIRMWARE_HEX = "firmware.hex",
    parameter EXTENDED_SWITCHES = 0
) (
    input  wire       clk,
    // switches, to ground
    input  wire [9:1] sw_baud_n,
    input  wire [8:1] sw_addr_n,
    // network line
    input  wire       modbus_rx,
    output wire       modbus_tx,
    output wire       modbus_de,
    // drive line
    input  wire       drive_rx,
    output wire       drive_tx,
    output wire       drive_de,
    // LEDs
    output wire       led_modbus_red,
    output wire       led_modbus_green,
    output wire       led_drive_red,
    output wire       led_drive_green
);

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
      .sw_baud(~sw_baud_n),
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
