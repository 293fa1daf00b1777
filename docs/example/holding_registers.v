// SPDX-License-Identifier: Apache-2.0
// Example: a Modbus RTU slave with eight holding registers around network_port, no processor.
//
// Functions 03, 06 and 16, exceptions 01, 02 and 03. A broadcast writes and gets no reply.
// registers: register n is bits 16n to 16n+15. All registers of a write change in one clock, at
// the commit, 3.5 characters after the request. Line: BAUD bit/s, 300 to 115200, 8E1.
// Clock domain: clk, CLK_HZ, at least 16 * BAUD. network_port: docs/guide/integration.md.
`default_nettype none

module holding_registers #(
    parameter CLK_HZ = 12_000_000,
    parameter BAUD = 19_200,
    parameter [7:0] UNIT = 8'd1
) (
    input wire clk,
    input wire rst,
    input wire rx,
    output wire tx,
    output wire de,
    output reg [127:0] registers
);
  // 16 ticks a bit. Half a character is 5.5 bits, above 19200 bit/s 250 us.
  localparam [63:0] STEP = ((64'd1 << 24) * 16 * BAUD + CLK_HZ / 2) / CLK_HZ;
  localparam [31:0] HALF = BAUD > 19_200 ? (BAUD + 125) / 250 : 88;
  localparam [8:0] HALF_END = HALF[8:0] + 9'd17;
  reg [ 24:0] phase;

  // The request: its first eight bytes, and its data in the places of their registers.
  reg [ 63:0] head;
  reg [127:0] data;
  wire write_valid, start_seen, quiet;
  wire [5:0] write_addr;
  wire [7:0] write_data;
  wire committing, silent, broadcast;
  wire [7:0] frame_length;
  wire [7:0] code = head[15:8];
  wire reads = code == 8'd3, single = code == 8'd6, many = code == 8'd16;
  wire [31:0] first = {16'd0, head[23:16], head[31:24]};
  wire [31:0] count = single ? 32'd1 : {16'd0, head[39:32], head[47:40]};
  wire [4:0] place = {1'b0, first[2:0], 1'b0} + write_addr[4:0] - (single ? 5'd4 : 5'd7);
  wire [7:0] length = many ? head[55:48] + 8'd9 : 8'd8;
  wire fits = frame_length == length && count != 0 &&
      (many ? count <= 123 && {24'd0, head[55:48]} == 2 * count : count <= 125);
  wire [7:0] error = !(reads || single || many) ? 1 : !fits ? 3 : first + count > 8 ? 2 : 0;
  wire [7:0] chosen = error != 0 || reads ? 0 : ((8'd1 << count[3:0]) - 8'd1) << first[2:0];
  wire commit = committing && silent;

  // The reply: read_data belongs to the read_addr of the clock before.
  reg waiting;
  reg [7:0] read_data;
  wire [4:0] read_addr;
  wire [3:0] from = {first[2:0], 1'b0} + read_addr[3:0] - 4'd3;
  wire reply_start = waiting && quiet;
  integer n;

  always @(posedge clk) begin
    phase <= {1'b0, phase[23:0]} + STEP[24:0];
    if (write_valid && write_addr[4:3] == 0) head[{write_addr[2:0], 3'd0}+:8] <= write_data;
    if (write_valid && !place[4]) data[{place[3:0]^4'd1, 3'd0}+:8] <= write_data;
    for (n = 0; n < 8; n = n + 1) if (commit && chosen[n]) registers[16*n+:16] <= data[16*n+:16];
    if (error != 0 && read_addr != 0) read_data <= read_addr == 1 ? code | 8'h80 : error;
    else if (reads && read_addr == 2) read_data <= {count[6:0], 1'b0};
    else if (reads && read_addr > 2) read_data <= registers[{from^4'd1, 3'd0}+:8];
    else read_data <= head[{read_addr[2:0], 3'd0}+:8];
    waiting <= commit ? !broadcast : waiting && !start_seen && !reply_start;
    if (rst) {registers, phase, waiting} <= 154'd0;
  end

  network_port port_i (
      .clk(clk),
      .rst(rst),
      .tick16(phase[24]),
      .write_valid(write_valid),
      .write_ready(1'b1),
      .write_addr(write_addr),
      .write_data(write_data),
      .read_valid(),
      .read_ready(1'b1),
      .read_addr(read_addr),
      .read_data(read_data),
      .read_damaged(1'b0),
      .reply_start(reply_start),
      .reply_length(error != 0 ? 5'd3 : reads ? {count[3:0], 1'b0} + 5'd3 : 5'd6),
      .rx(rx),
      .tx(tx),
      .de(de),
      .parity_enable(1'b1),
      .parity_odd(1'b0),
      .two_stop(1'b0),
      .half_end(HALF_END),
      .half_uneven(1'b0),
      .own_address(UNIT),
      .loopback_open(1'b0),
      .sending(),
      .quiet(quiet),
      .start_seen(start_seen),
      .silent(silent),
      .fault(),
      .candidate(),
      .commit(committing),
      .revoke(),
      .frame_length(frame_length),
      .frame_broadcast(broadcast),
      .frame_writes_coils(),
      .frame_writes_parameter(),
      .frame_bank(),
      .count_crc(),
      .count_parity(),
      .count_framing(),
      .count_t15(),
      .count_overrun(),
      .count_foreign()
  );
endmodule

`default_nettype wire
