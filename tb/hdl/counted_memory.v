// SPDX-License-Identifier: Apache-2.0
// Bench: event_counters behind frame_arbiter on frame_ram, with the lines' traffic
// beside them (line_*: the network line asks in this clock) and a look at a byte
// (peek_*: as the firmware, when nobody else reads).
`default_nettype none

module counted_memory (
    input  wire       clk,
    input  wire       rst,
    input  wire [6:0] events,
    input  wire       line_write,
    input  wire       line_read,
    input  wire [4:0] peek_addr,
    output wire [7:0] peek_data
);

  wire count_read_valid;
  wire count_read_ready;
  wire count_write_valid;
  wire count_write_ready;
  wire [4:0] count_addr;
  wire [7:0] count_write_data;
  wire write_enable;
  wire [7:0] write_addr;
  wire [7:0] write_data;
  wire [7:0] read_addr;
  wire [7:0] read_data;

  assign peek_data = read_data;

  event_counters #(
      .EVENTS(7)
  ) counters_i (
      .clk(clk),
      .rst(rst),
      .events(events),
      .read_valid(count_read_valid),
      .read_ready(count_read_ready),
      .read_data(read_data),
      .write_valid(count_write_valid),
      .write_ready(count_write_ready),
      .addr(count_addr),
      .write_data(count_write_data)
  );

  frame_arbiter arbiter_i (
      .modbus_write_valid(line_write),
      .modbus_write_ready(),
      .modbus_write_addr(8'h00),
      .modbus_write_data(8'hFF),
      .modbus_read_valid(line_read),
      .modbus_read_ready(),
      .modbus_read_addr(8'h00),
      .drive_write_valid(1'b0),
      .drive_write_ready(),
      .drive_write_addr(8'h80),
      .drive_write_data(8'h00),
      .drive_read_valid(1'b0),
      .drive_read_ready(),
      .drive_read_addr(8'h60),
      .count_write_valid(count_write_valid),
      .count_write_ready(count_write_ready),
      .count_addr({3'b101, count_addr}),
      .count_write_data(count_write_data),
      .count_read_valid(count_read_valid),
      .count_read_ready(count_read_ready),
      .cpu_write_valid(1'b0),
      .cpu_write_ready(),
      .cpu_addr({3'b101, peek_addr}),
      .cpu_write_data(8'h00),
      .cpu_read_valid(1'b1),
      .cpu_read_ready(),
      .write_enable(write_enable),
      .write_addr(write_addr),
      .write_data(write_data),
      .read_addr(read_addr)
  );

  frame_ram ram_i (
      .clk(clk),
      .write_enable(write_enable),
      .write_addr(write_addr),
      .write_data(write_data),
      .read_addr(read_addr),
      .read_data(read_data)
  );

endmodule

`default_nettype wire
