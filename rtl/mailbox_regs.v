// SPDX-License-Identifier: Apache-2.0
// The registers between the front end and the firmware.
//
// The map is written in regs/mailbox.rdl alone. Readable bytes fill two words, which
// repeat over the whole map: word 0 with request, exchange, length and time, word 1
// with the events and the restarts in place of the request and the exchange. rdata is 0 unless a word was read a clock
// before: a line may read the memory while a register is written. Any write strobe writes
// the whole word. An event that comes while its flag is being cleared is kept.
// order_telegram and order_repeat are the actions of TELEGRAM, which need a drive line on which
// nothing is sent. kind: of the order, as licences.v has it.
// rst turns the LEDs off. Event flags and lengths stay: a restart of the firmware loses no event,
// and a telegram on the wire keeps its length (WDG-1).
// Clock domain: clk. Rules: FRAME-4, FRAME-5, FRAME-7, FC-8, WDG-1.
`default_nettype none

// Written by `make regs`, the macros of regs/ that this file uses:
`define MBX_REQUEST_BITS 7:0
`define MBX_EXCHANGE_BITS 7:0
`define MBX_EXCHANGE_SENDING_BITS 1
`define MBX_EVENTS_WORD 3'h1
`define MBX_EVENTS_BITS 7:0
`define MBX_RESTARTS_BITS 7:0
`define MBX_REPLY_WORD 3'h2
`define MBX_REPLY_LENGTH_BITS 4:0
`define MBX_TELEGRAM_WORD 3'h3
`define MBX_TELEGRAM_LENGTH_BITS 4:0
`define MBX_TELEGRAM_NO_REPLY_BITS 5
`define MBX_TELEGRAM_ACTION_BITS 7:6
`define MBX_TELEGRAM_ACTION_IS_FIRST 2'h0
`define MBX_TELEGRAM_ACTION_IS_REPEAT 2'h1
`define MBX_TELEGRAM_ACTION_IS_IMAGE 2'h3
`define MBX_LED_WORD 3'h4
`define MBX_LED_BITS 3:0
`define MBX_LISTEN_WORD 3'h5
`define MBX_LISTEN_ON_BITS 0
`define MBX_WATCHDOG_WORD 3'h6
`define MBX_WATCHDOG_KEY_BITS 7:0
`define MBX_WATCHDOG_KEY_RESET 8'ha5
`define MBX_SUPERVISOR_WORD 3'h7
`define MBX_SUPERVISOR_HALT_BITS 0
`define MBX_SUPERVISOR_LOOPBACK_BITS 1
`define MBX_SUPERVISOR_WATCH_BITS 2
// End of what `make regs` writes.

module mailbox_regs (
    input  wire                      clk,
    input  wire                      rst,
    // firmware bus
    input  wire                      valid,
    input  wire                      write,
    input  wire [               2:0] word,
    input  wire [               7:0] wdata,
    output reg  [              31:0] rdata,
    // commands
    output wire                      order_reply,
    output wire                      order_telegram,
    output wire                      order_repeat,
    output wire [               1:0] order_kind,
    output wire                      listen_again,
    output wire                      listen_stop,
    output wire                      watchdog_kick,
    output wire                      halt,
    output wire                      loopback_close,
    output wire                      watch_master,
    output reg  [               4:0] reply_length,
    output reg  [               4:0] telegram_length,
    output reg                       telegram_no_reply,
    output reg  [     `MBX_LED_BITS] leds,
    // status, as the registers show it
    input  wire [  `MBX_EVENTS_BITS] events,
    input  wire [ `MBX_REQUEST_BITS] request,
    input  wire [`MBX_EXCHANGE_BITS] exchange,
    input  wire [`MBX_RESTARTS_BITS] restarts,
    input  wire [               7:0] request_length,
    input  wire [               7:0] ticks
);

  // Kinds of telegrams, as in licences.v.
  localparam [1:0] K_NEWEST = 2'd0;
  localparam [1:0] K_IMAGE = 2'd1;
  localparam [1:0] K_ONE = 2'd2;
  localparam [1:0] K_ALL = 2'd3;

  reg [7:0] flags = 8'd0;

  wire write_now = valid && write;
  wire clear = write_now && word == `MBX_EVENTS_WORD;
  wire write_led = write_now && word == `MBX_LED_WORD;
  wire write_listen = write_now && word == `MBX_LISTEN_WORD;
  wire write_supervisor = write_now && word == `MBX_SUPERVISOR_WORD;
  wire [15:0] shown = word[0] ? {restarts, flags} : {exchange, request};
  wire write_telegram = write_now && word == `MBX_TELEGRAM_WORD;
  wire order = write_telegram && !exchange[`MBX_EXCHANGE_SENDING_BITS];
  wire [1:0] action = wdata[`MBX_TELEGRAM_ACTION_BITS];

  assign order_reply = write_now && word == `MBX_REPLY_WORD;
  assign order_telegram = order && action != `MBX_TELEGRAM_ACTION_IS_REPEAT;
  assign order_repeat = order && action == `MBX_TELEGRAM_ACTION_IS_REPEAT;
  assign order_kind = action == `MBX_TELEGRAM_ACTION_IS_IMAGE ? K_IMAGE :
      action == `MBX_TELEGRAM_ACTION_IS_FIRST ? K_NEWEST :
      wdata[`MBX_TELEGRAM_NO_REPLY_BITS] ? K_ALL : K_ONE;
  assign listen_again = write_listen && wdata[`MBX_LISTEN_ON_BITS];
  assign listen_stop = write_listen && !wdata[`MBX_LISTEN_ON_BITS];
  assign halt = write_supervisor && wdata[`MBX_SUPERVISOR_HALT_BITS];
  assign watch_master = write_supervisor && wdata[`MBX_SUPERVISOR_WATCH_BITS];
  assign loopback_close = write_supervisor && wdata[`MBX_SUPERVISOR_LOOPBACK_BITS];
  // A key, so that a firmware that writes at random does not keep itself alive.
  assign watchdog_kick = write_now && word == `MBX_WATCHDOG_WORD &&
      wdata[`MBX_WATCHDOG_KEY_BITS] == `MBX_WATCHDOG_KEY_RESET;

  initial begin
    rdata = 32'd0;
    reply_length = 5'd0;
    telegram_length = 5'd0;
    telegram_no_reply = 1'b0;
    leds = 4'd0;
  end

  always @(posedge clk) begin
    if (valid && !write) rdata <= {ticks, request_length, shown};
    else rdata <= 32'd0;

    flags <= (flags & ~(wdata &{8{clear}})) | events;

    if (order_reply) reply_length <= wdata[`MBX_REPLY_LENGTH_BITS];
    if (order_telegram) begin
      telegram_length   <= wdata[`MBX_TELEGRAM_LENGTH_BITS];
      telegram_no_reply <= wdata[`MBX_TELEGRAM_NO_REPLY_BITS];
    end
    if (rst) leds <= 4'd0;
    else if (write_led) leds <= wdata[`MBX_LED_BITS];
  end

endmodule

`default_nettype wire
