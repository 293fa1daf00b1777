// SPDX-License-Identifier: Apache-2.0
// A Modbus RTU slave for other designs: network_port and functions 03, 06 and 16, no processor.
//
// The design keeps the registers. regs_addr is the number of a register on the line, from 0 on.
// regs_rdata: its value, in the same clock or, from a synchronous memory, in the next. regs_write:
// in this clock the register becomes regs_wdata. A write of several registers takes a clock each,
// without a pause, at the commit, 3.5 characters after the request. The two bytes of a value are
// read at once; each register is read when its turn in the reply comes. At other times regs_addr is any
// number, and there is no strobe for a read.
// A request has at most 12 registers. Exceptions: 01 other function, 02 no such register, 03 a
// wrong length or number. A broadcast writes and gets no reply; a function above 127, the exception of
// another slave, gets none. rst: synchronous, a clock or more.
// Clock domain: clk. rx, tx, de: docs/guide/integration.md.
`default_nettype none

module modbus_slave #(
    parameter CLK_HZ = 12_000_000,  // of clk, from 16 * BAUD to 100 MHz; 64 * BAUD is better
    parameter BAUD = 19_200,  // bit/s, 300 to 115200
    parameter PARITY = 2,  // 0: none, two stop bits; 1: odd; 2: even; 3: none, one stop bit
    parameter ADDRESS = 1,  // of the slave, 1 to 247
    parameter REPLY_DELAY = 0,  // ms from the commit to the reply, 0 to 250, for slow masters
    parameter STRICT_T15 = 1,  // 0: a gap of up to t3.5 does not end a frame, for USB adapters
    parameter REGISTERS = 8  // 1 to 65536
) (
    input  wire        clk,
    input  wire        rst,
    // pins of the transceiver
    input  wire        rx,
    output wire        tx,
    output wire        de,
    // registers
    output wire [15:0] regs_addr,
    input  wire [15:0] regs_rdata,
    output wire        regs_write,
    output wire [15:0] regs_wdata
);

  // 16 ticks a bit. Half a character is 5.5 bits, with 8N1 5; above 19200 bit/s 250 us.
  localparam [63:0] STEP = ((64'd1 << 24) * 16 * BAUD + CLK_HZ / 2) / CLK_HZ;
  localparam [31:0] HALF = BAUD > 19_200 ? (BAUD + 125) / 250 : PARITY == 3 ? 80 : 88;
  localparam [31:0] UNIT = ADDRESS;
  localparam [31:0] DELAY = REPLY_DELAY * ((CLK_HZ + 999) / 1000);
  localparam DELAY_BITS = $clog2(DELAY + 2) + 1;
  localparam [15:0] MOST = 16'd12;  // the frame memory holds 32 bytes, 7 of them before the data

  reg [24:0] phase;

  wire write_valid;
  wire [5:0] write_addr;
  wire [7:0] write_data;
  wire read_valid;
  wire [4:0] read_addr;
  wire quiet;
  wire start_seen;
  wire silent;
  wire committing;
  wire [7:0] frame_length;
  wire broadcast;

  // The request
  reg [7:0] code;
  reg [15:0] first;
  reg [15:0] number;  // of registers; the value of function 06
  reg [7:0] bytes;
  reg [7:0] previous;
  reg [15:0] words[0:15];
  wire reads = code == 8'd3;
  wire single = code == 8'd6;
  wire many = code == 8'd16;
  wire [15:0] count = single ? 16'd1 : number;
  wire [4:0] place = write_addr[4:0] - (single ? 5'd4 : 5'd7);
  wire [16:0] doubled = {count, 1'b0};
  wire [16:0] last = {1'b0, first} + {1'b0, count};
  wire right = frame_length == (many ? bytes + 8'd9 : 8'd8) && count != 0 &&
      (many ? count <= 123 && doubled == {9'd0, bytes} : count <= 125);
  wire there = {15'd0, last} <= REGISTERS;
  wire known = reads || single || many;
  wire [7:0] error = !known ? 8'd1 : !right ? 8'd3 : !there ? 8'd2 : count > MOST ? 8'd3 : 8'd0;

  // The commit
  wire commit = committing && silent && !code[7];
  reg [3:0] left;  // registers that are still to be written
  reg [3:0] at;
  wire [3:0] at_next = regs_write ? at + 4'd1 : 4'd0;
  reg [15:0] word;

  // The reply
  reg waiting;
  reg [DELAY_BITS-1:0] delay;
  reg read_ready;
  reg [7:0] reply;
  reg [7:0] low;
  wire reply_start = waiting && quiet && delay == 0;

  assign regs_write = left != 0;
  assign regs_wdata = word;
  assign regs_addr  = first + {12'd0, regs_write ? at : read_addr[4:1] - 4'd1};

  always @(posedge clk) begin
    phase <= {1'b0, phase[23:0]} + STEP[24:0];

    // Each word of data is kept at its place, what is no data at the last four.
    if (write_valid) begin
      previous <= write_data;
      case (write_addr[4:0])
        5'd1: code <= write_data;
        5'd2: first[15:8] <= write_data;
        5'd3: first[7:0] <= write_data;
        5'd4: number[15:8] <= write_data;
        5'd5: number[7:0] <= write_data;
        5'd6: bytes <= write_data;
        default: ;
      endcase
    end
    if (write_valid && place[0]) words[place[4:1]] <= {previous, write_data};

    at   <= at_next;
    word <= words[at_next];
    left <= left - {3'd0, regs_write};
    if (commit && !reads && error == 0) left <= count[3:0];

    // A character after the commit takes the reply back (FRAME-7).
    waiting <= commit ? !broadcast : waiting && !start_seen && !reply_start;
    delay <= commit ? DELAY[DELAY_BITS-1:0] : delay - {{DELAY_BITS - 1{1'b0}}, delay != 0};

    // A clock later than read_addr, so that a synchronous memory has its value.
    read_ready <= read_valid && !read_ready;
    if (read_ready) begin
      low <= regs_rdata[7:0];
      case (read_addr)
        5'd0: reply <= UNIT[7:0];
        5'd1: reply <= code | {error != 0, 7'd0};
        5'd2: reply <= error != 0 ? error : reads ? doubled[7:0] : first[15:8];
        5'd3: reply <= reads ? regs_rdata[15:8] : first[7:0];
        5'd4: reply <= reads ? low : number[15:8];
        5'd5: reply <= reads ? regs_rdata[15:8] : number[7:0];
        default: reply <= read_addr[0] ? regs_rdata[15:8] : low;
      endcase
    end

    if (rst) begin
      phase <= 25'd0;
      left <= 4'd0;
      waiting <= 1'b0;
      read_ready <= 1'b0;
    end
  end

  network_port port_i (
      .clk(clk),
      .rst(rst),
      .tick16(phase[24]),
      // frame memory
      .write_valid(write_valid),
      .write_ready(1'b1),
      .write_addr(write_addr),
      .write_data(write_data),
      .read_valid(read_valid),
      .read_ready(read_ready),
      .read_addr(read_addr),
      .read_data(reply),
      .read_damaged(1'b0),
      // stream in
      .reply_start(reply_start),
      .reply_length(error != 0 ? 5'd3 : reads ? doubled[4:0] + 5'd3 : 5'd6),
      // pins
      .rx(rx),
      .tx(tx),
      .de(de),
      // configuration
      .parity_enable(PARITY == 1 || PARITY == 2),
      .parity_odd(PARITY == 1),
      .two_stop(PARITY == 0),
      .half_end(HALF[8:0] + 9'd17),
      .half_uneven(1'b0),
      .strict_t15(STRICT_T15 != 0),
      .break_tolerant(1'b0),
      .own_address(UNIT[7:0]),
      .loopback_open(1'b0),
      // status
      .sending(),
      .quiet(quiet),
      .start_seen(start_seen),
      .silent(silent),
      .fault(),
      // newest frame
      .candidate(),
      .commit(committing),
      .revoke(),
      .frame_length(frame_length),
      .frame_broadcast(broadcast),
      .frame_writes_coils(),
      .frame_writes_parameter(),
      .frame_bank(),
      // dropped frames
      .count_crc(),
      .count_parity(),
      .count_framing(),
      .count_t15(),
      .count_overrun(),
      .count_foreign()
  );

  // A module that does not exist stops every tool and names the mistake.
  generate
    if (BAUD < 300 || BAUD > 115_200) begin : g_baud_mistake
      BAUD_is_not_between_300_and_115200 mistake_i ();
    end
    if (CLK_HZ < 16 * BAUD || CLK_HZ > 100_000_000) begin : g_clock_mistake
      CLK_HZ_is_not_between_16_BAUD_and_100_MHz mistake_i ();
    end
    if (PARITY < 0 || PARITY > 3) begin : g_parity_mistake
      PARITY_is_not_between_0_and_3 mistake_i ();
    end
    if (ADDRESS < 1 || ADDRESS > 247) begin : g_address_mistake
      ADDRESS_is_not_between_1_and_247 mistake_i ();
    end
    if (REPLY_DELAY < 0 || REPLY_DELAY > 250) begin : g_delay_mistake
      REPLY_DELAY_is_not_between_0_and_250 mistake_i ();
    end
    if (STRICT_T15 < 0 || STRICT_T15 > 1) begin : g_t15_mistake
      STRICT_T15_is_not_0_or_1 mistake_i ();
    end
    if (REGISTERS < 1 || REGISTERS > 65_536) begin : g_registers_mistake
      REGISTERS_is_not_between_1_and_65536 mistake_i ();
    end
  endgenerate

endmodule

`default_nettype wire
