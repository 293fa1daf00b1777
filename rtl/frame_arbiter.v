// SPDX-License-Identifier: Apache-2.0
// Shares the one frame memory between both lines, the counters and the firmware.
//
// Each side holds valid until ready. The lines come first: they ask once a
// character, hundreds of clocks apart, so nobody waits for more than three clocks.
// Read data comes on the shared port one clock after ready. Clock domain: clk.
`default_nettype none

module frame_arbiter (
    // network line
    input  wire       modbus_write_valid,
    output wire       modbus_write_ready,
    input  wire [7:0] modbus_write_addr,
    input  wire [7:0] modbus_write_data,
    input  wire       modbus_read_valid,
    output wire       modbus_read_ready,
    input  wire [7:0] modbus_read_addr,
    // drive line
    input  wire       drive_write_valid,
    output wire       drive_write_ready,
    input  wire [7:0] drive_write_addr,
    input  wire [7:0] drive_write_data,
    input  wire       drive_read_valid,
    output wire       drive_read_ready,
    input  wire [7:0] drive_read_addr,
    // counters
    input  wire       count_write_valid,
    output wire       count_write_ready,
    input  wire [7:0] count_addr,
    input  wire [7:0] count_write_data,
    input  wire       count_read_valid,
    output wire       count_read_ready,
    // firmware
    input  wire       cpu_write_valid,
    output wire       cpu_write_ready,
    input  wire [7:0] cpu_addr,
    input  wire [7:0] cpu_write_data,
    input  wire       cpu_read_valid,
    output wire       cpu_read_ready,
    // memory
    output wire       write_enable,
    output reg  [7:0] write_addr,
    output reg  [7:0] write_data,
    output reg  [7:0] read_addr
);

  assign modbus_write_ready = modbus_write_valid;
  assign drive_write_ready = drive_write_valid && !modbus_write_valid;
  assign count_write_ready = count_write_valid && !modbus_write_valid && !drive_write_valid;
  assign cpu_write_ready = cpu_write_valid && !modbus_write_valid && !drive_write_valid &&
      !count_write_valid;
  assign write_enable = modbus_write_valid || drive_write_valid || count_write_valid ||
      cpu_write_valid;

  assign modbus_read_ready = modbus_read_valid;
  assign drive_read_ready = drive_read_valid && !modbus_read_valid;
  assign count_read_ready = count_read_valid && !modbus_read_valid && !drive_read_valid;
  assign cpu_read_ready = cpu_read_valid && !modbus_read_valid && !drive_read_valid &&
      !count_read_valid;

  always @* begin
    write_addr = cpu_addr;
    write_data = cpu_write_data;
    if (count_write_valid) begin
      write_addr = count_addr;
      write_data = count_write_data;
    end
    if (drive_write_valid) begin
      write_addr = drive_write_addr;
      write_data = drive_write_data;
    end
    if (modbus_write_valid) begin
      write_addr = modbus_write_addr;
      write_data = modbus_write_data;
    end

    read_addr = cpu_addr;
    if (count_read_valid) read_addr = count_addr;
    if (drive_read_valid) read_addr = drive_read_addr;
    if (modbus_read_valid) read_addr = modbus_read_addr;
  end

endmodule

`default_nettype wire
