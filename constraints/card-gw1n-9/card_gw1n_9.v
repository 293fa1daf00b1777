// SPDX-License-Identifier: Apache-2.0
// Reference replacement card with a GW1N-9: standard, soft core PicoRV32.
//
// Switches close to ground, with the FPGA's pull-ups. LEDs are connected between 3.3 V and
// the pins. Only DE controls each transceiver. Its receiver stays enabled (RE low on the
// card), because the card is deaf while it sends. clk: 12 MHz oscillator.
// There is no reset pin. reset_sync holds the reset for the first clocks after
// configuration, and the switches settle before the card starts.
// The memory holds every dialect with all options. MASTER_LOSS_STOP as in rtu2fc.
// Rules: TOP-1, LINE-6, LED-2.
`default_nettype none

module card_gw1n_9 #(
    parameter CLK_HZ = 12_000_000,
    parameter FIRMWARE_HEX = "firmware.hex",
    parameter EXTENDED_SWITCHES = 0,
    parameter MASTER_LOSS_STOP = 0
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
    output wire       led_modbus_red_n,
    output wire       led_modbus_green_n,
    output wire       led_drive_red_n,
    output wire       led_drive_green_n
);

  // An LED is lit by a low pin.
  wire led_modbus_red;
  wire led_modbus_green;
  wire led_drive_red;
  wire led_drive_green;

  assign led_modbus_red_n = !led_modbus_red;
  assign led_modbus_green_n = !led_modbus_green;
  assign led_drive_red_n = !led_drive_red;
  assign led_drive_green_n = !led_drive_green;

  rtu2fc #(
      .CLK_HZ(CLK_HZ),
      .FIRMWARE_HEX(FIRMWARE_HEX),
      .SOFT_CORE(0),
      .LOCKSTEP(1),
      .MEMORY_BYTES(16384),
      .MASTER_LOSS_STOP(MASTER_LOSS_STOP),
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
