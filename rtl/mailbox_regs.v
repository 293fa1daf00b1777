// SPDX-License-Identifier: Apache-2.0
// The registers between the front end and the firmware, and the only decoder of their map.
//
// The map is regs/mailbox.rdl; regs/test_regs.py compares the numbers below with it. Readable
// bytes fill two words, which repeat over the whole map: word 0 with request, exchange, length and
// time, word 1 with the events and the restarts in place of the request and the exchange. rdata
// is 0 unless a word was read a clock before: a line may read the memory while a register is
// written. Any write strobe writes the whole word. An event that comes while its flag is being
// cleared is kept.
// Orders are strobes, and their fields hold in the same clock. order_telegram and order_repeat are
// the actions of TELEGRAM, which need a drive line on which nothing is sent. order_kind: as
// licences.v has it.
// rst turns the LEDs off. Event flags, lengths and options stay: a restart of the firmware loses no
// event, and a telegram on the wire keeps its length (WDG-1).
// Clock domain: clk. Rules: FRAME-4, FRAME-5, FRAME-7, FC-8, WDG-1.
`default_nettype none

module mailbox_regs (
    input  wire        clk,
    input  wire        rst,
    // firmware bus
    input  wire        valid,
    input  wire        write,
    input  wire [ 2:0] word,
    input  wire [31:0] wdata,
    output reg  [31:0] rdata,
    // orders
    output wire        order_reply,
    output wire        order_telegram,
    output wire        order_repeat,
    output wire        listen_again,
    output wire        listen_stop,
    output wire        watchdog_kick,
    output wire        halt,
    output wire        loopback_close,
    output wire        watch_master,
    // fields of an order
    output wire [ 3:0] order_ticket,
    output wire        reply_empty,
    output wire        reply_after_drive,
    output wire [ 1:0] order_kind,
    output wire        order_no_reply,
    output wire        order_stop,
    output wire        order_early,
    output wire        running,
    output wire [19:0] period,
    // kept until the next order
    output reg  [ 4:0] reply_length,
    output reg  [ 4:0] telegram_length,
    output reg         telegram_no_reply,
    output reg         lit_modbus_red,
    output reg         lit_modbus_green,
    output reg         lit_drive_red,
    output reg         lit_drive_green,
    // options of the network line, kept until the next kick
    output reg         strict_t15,
    output reg         break_tolerant,
    // newest request
    input  wire [ 3:0] ticket,
    input  wire        is_candidate,
    input  wire        is_committed,
    input  wire        frame_broadcast,
    input  wire        frame_bank,
    input  wire [ 7:0] frame_length,
    // exchange with the drive
    input  wire        telegram_queued,
    input  wire        telegram_started,
    input  wire        drive_sending,
    input  wire        drive_candidate,
    input  wire        drive_good,
    // supervision
    input  wire        loopback_open,
    input  wire        loopback_heard,
    input  wire        stop_due,
    input  wire [ 7:0] restarts,
    input  wire [ 7:0] ticks,
    // events
    input  wire        count_crc,
    input  wire        count_parity,
    input  wire        count_framing,
    input  wire        count_t15,
    input  wire        count_overrun,
    input  wire        revoke,
    input  wire        count_foreign,
    input  wire        drive_bad
);

  // Words that are written, and the lowest bit of each of their fields.
  localparam [2:0] EVENTS = 3'd1;
  localparam [2:0] REPLY = 3'd2;
  localparam REPLY_LENGTH = 0;
  localparam REPLY_AFTER_DRIVE = 5;
  localparam REPLY_TICKET = 8;  // TELEGRAM and SUPERVISOR have theirs in the same place
  localparam [2:0] TELEGRAM = 3'd3;
  localparam TELEGRAM_LENGTH = 0;
  localparam TELEGRAM_NO_REPLY = 5;
  localparam TELEGRAM_ACTION = 6;
  localparam TELEGRAM_STOP = 12;
  localparam TELEGRAM_EARLY = 13;
  localparam [2:0] LED = 3'd4;
  localparam [2:0] LISTEN = 3'd5;
  localparam LISTEN_ON = 0;
  localparam [2:0] WATCHDOG = 3'd6;
  localparam WATCHDOG_KEY = 0;
  localparam WATCHDOG_STRICT_T15 = 8;
  localparam WATCHDOG_BREAK_TOLERANT = 9;
  localparam [2:0] SUPERVISOR = 3'd7;
  localparam SUPERVISOR_HALT = 0;
  localparam SUPERVISOR_LOOPBACK = 1;
  localparam SUPERVISOR_WATCH = 2;
  localparam SUPERVISOR_RUNNING = 3;
  localparam SUPERVISOR_PERIOD = 12;
  // Values of TELEGRAM_ACTION; the fourth is a parameter write.
  localparam [1:0] ACTION_FIRST = 2'd0;
  localparam [1:0] ACTION_REPEAT = 2'd1;
  localparam [1:0] ACTION_IMAGE = 2'd3;
  // A key, so that a firmware that writes at random does not keep itself alive.
  localparam [7:0] KEY = 8'hA5;

  // Kinds of telegrams, as in licences.v.
  localparam [1:0] K_NEWEST = 2'd0;
  localparam [1:0] K_IMAGE = 2'd1;
  localparam [1:0] K_ONE = 2'd2;
  localparam [1:0] K_ALL = 2'd3;

  reg [7:0] flags = 8'd0;

  // Bytes that are read.
  wire [7:0] request = {frame_bank, frame_broadcast, is_committed, is_candidate, ticket};
  wire [7:0] exchange = {
    stop_due,
    loopback_heard,
    loopback_open,
    drive_good,
    drive_candidate,
    telegram_started,
    drive_sending,
    telegram_queued
  };
  wire [7:0] events = {
    drive_bad,
    count_foreign,
    revoke,
    count_overrun,
    count_t15,
    count_framing,
    count_parity,
    count_crc
  };
  wire [15:0] shown = word[0] ? {restarts, flags} : {exchange, request};

  wire write_now = valid && write;
  wire write_listen = write_now && word == LISTEN;
  wire write_supervisor = write_now && word == SUPERVISOR;
  wire write_telegram = write_now && word == TELEGRAM && !drive_sending;
  wire [7:0] cleared = write_now && word == EVENTS ? wdata[7:0] : 8'd0;
  wire [1:0] action = wdata[TELEGRAM_ACTION+:2];

  assign order_reply = write_now && word == REPLY;
  assign order_telegram = write_telegram && action != ACTION_REPEAT;
  assign order_repeat = write_telegram && action == ACTION_REPEAT;
  assign listen_again = write_listen && wdata[LISTEN_ON];
  assign listen_stop = write_listen && !wdata[LISTEN_ON];
  assign watchdog_kick = write_now && word == WATCHDOG && wdata[WATCHDOG_KEY+:8] == KEY;
  assign halt = write_supervisor && wdata[SUPERVISOR_HALT];
  assign loopback_close = write_supervisor && wdata[SUPERVISOR_LOOPBACK];
  assign watch_master = write_supervisor && wdata[SUPERVISOR_WATCH];

  assign order_ticket = wdata[REPLY_TICKET+:4];
  assign reply_empty = wdata[REPLY_LENGTH+:5] == 5'd0;
  assign reply_after_drive = wdata[REPLY_AFTER_DRIVE];
  assign order_no_reply = wdata[TELEGRAM_NO_REPLY];
  assign order_stop = wdata[TELEGRAM_STOP];
  assign order_early = wdata[TELEGRAM_EARLY];
  assign order_kind = action == ACTION_IMAGE ? K_IMAGE :
      action == ACTION_FIRST ? K_NEWEST : order_no_reply ? K_ALL : K_ONE;
  assign running = wdata[SUPERVISOR_RUNNING];
  assign period = wdata[SUPERVISOR_PERIOD+:20];

  initial begin
    rdata = 32'd0;
    reply_length = 5'd0;
    telegram_length = 5'd0;
    telegram_no_reply = 1'b0;
    {lit_drive_green, lit_drive_red, lit_modbus_green, lit_modbus_red} = 4'd0;
    {break_tolerant, strict_t15} = 2'd0;
  end

  always @(posedge clk) begin
    if (valid && !write) rdata <= {ticks, frame_length, shown};
    else rdata <= 32'd0;

    flags <= (flags & ~cleared) | events;

    if (order_reply) reply_length <= wdata[REPLY_LENGTH+:5];
    if (order_telegram) begin
      telegram_length   <= wdata[TELEGRAM_LENGTH+:5];
      telegram_no_reply <= order_no_reply;
    end
    if (watchdog_kick) begin
      strict_t15 <= wdata[WATCHDOG_STRICT_T15];
      break_tolerant <= wdata[WATCHDOG_BREAK_TOLERANT];
    end
    if (write_now && word == LED)
      {lit_drive_green, lit_drive_red, lit_modbus_green, lit_modbus_red} <= wdata[3:0];
    if (rst) {lit_drive_green, lit_drive_red, lit_modbus_green, lit_modbus_red} <= 4'd0;
  end

endmodule

`default_nettype wire
