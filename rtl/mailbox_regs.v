// SPDX-License-Identifier: Apache-2.0
// The firmware's side of the mailbox: registers and the way into the frame memory.
//
// The map is written in regs/mailbox.rdl alone. An access takes two clocks: valid,
// then ready with the data; one to the frame memory waits until the two lines and
// the counters leave it a clock. Words are 32 bits apart; the upper half of a word
// does not exist. Clock domain: clk.
`default_nettype none

module mailbox_regs #(
    parameter [0:0] STRICT_T15 = 1'b1,
    parameter [0:0] PREPARE_EARLY = 1'b1,
    parameter [1:0] SOFT_CORE_ID = 2'd0,
    parameter [31:0] CLK_HZ = 12_000_000
) (
    input  wire        clk,
    input  wire        rst,
    // firmware bus
    input  wire        bus_valid,
    output wire        bus_ready,
    input  wire        bus_write,
    input  wire [ 8:0] bus_word,
    input  wire [15:0] bus_wdata,
    output wire [15:0] bus_rdata,
    // frame memory
    output wire        write_valid,
    input  wire        write_ready,
    output wire        read_valid,
    input  wire        read_ready,
    output wire [ 7:0] frame_addr,
    output wire [ 7:0] write_data,
    input  wire [ 7:0] read_data,
    // commands
    output wire        queue_reply,
    output wire        queue_telegram,
    output wire        telegram_touched,
    output wire        listen_again,
    output wire        listen_stop,
    output wire        watchdog_kick,
    output wire        halt,
    output wire        loopback_close,
    output reg  [ 4:0] reply_length,
    output reg  [ 4:0] telegram_length,
    output reg         telegram_no_reply,
    output reg         led_modbus_red,
    output reg         led_modbus_green,
    output reg         led_drive_red,
    output reg         led_drive_green,
    // status
    input  wire [ 9:1] sw_baud,
    input  wire [ 8:1] sw_addr,
    input  wire [15:0] ms,
    input  wire [ 3:0] request_ticket,
    input  wire        request_candidate,
    input  wire        request_committed,
    input  wire        request_broadcast,
    input  wire        request_bank,
    input  wire [ 8:0] request_length,
    input  wire        reply_queued,
    input  wire        reply_sending,
    input  wire        telegram_queued,
    input  wire        telegram_sending,
    input  wire        telegram_started,
    input  wire        drive_listening,
    input  wire        drive_candidate,
    input  wire        drive_good,
    input  wire [ 7:0] drive_lge,
    input  wire        loopback_open,
    input  wire [ 1:0] watchdog_bites
);

  localparam [7:0] TELEGRAM_AREA = `MBX_TELEGRAM_FRAME_INDEX;
  localparam [31:0] CLK_MHZ = CLK_HZ / 1_000_000;

  reg done = 1'b0;
  reg frame_read = 1'b0;
  reg [15:0] reg_rdata = 16'd0;

  wire is_frame = bus_word[8];
  wire is_telegram = bus_word[7:5] == TELEGRAM_AREA[7:5];
  wire request = bus_valid && !done;
  // What is on the wire cannot be changed any more.
  wire locked = is_telegram && telegram_sending && bus_write;
  wire reg_write = request && bus_write && !is_frame;

  assign frame_addr = bus_word[7:0];
  assign write_data = bus_wdata[7:0];
  assign write_valid = request && is_frame && bus_write && !locked;
  assign read_valid = request && is_frame && !bus_write;
  assign bus_ready = done;
  assign bus_rdata = frame_read ? {8'd0, read_data} : reg_rdata;

  assign queue_reply = reg_write && bus_word == `MBX_REPLY_WORD;
  assign queue_telegram = reg_write && bus_word == `MBX_TELEGRAM_WORD && !telegram_sending;
  assign telegram_touched = write_valid && write_ready && is_telegram;
  assign listen_again = reg_write && bus_word == `MBX_LISTEN_WORD && bus_wdata[`MBX_LISTEN_ON_BITS];
  assign listen_stop = reg_write && bus_word == `MBX_LISTEN_WORD && !bus_wdata[`MBX_LISTEN_ON_BITS];

  // A key, so that a firmware that writes at random does not keep itself alive.
  assign watchdog_kick = reg_write && bus_word == `MBX_WATCHDOG_WORD &&
      bus_wdata[`MBX_WATCHDOG_KEY_BITS] == `MBX_WATCHDOG_KEY_RESET;
  assign halt = reg_write && bus_word == `MBX_SUPERVISOR_WORD &&
      bus_wdata[`MBX_SUPERVISOR_HALT_BITS];
  assign loopback_close = reg_write && bus_word == `MBX_SUPERVISOR_WORD &&
      bus_wdata[`MBX_SUPERVISOR_LOOPBACK_BITS];

  initial begin
    reply_length = 5'd0;
    telegram_length = 5'd0;
    telegram_no_reply = 1'b0;
    {led_modbus_red, led_modbus_green, led_drive_red, led_drive_green} = 4'd0;
  end

  always @(posedge clk) begin
    done <= request && (!is_frame || locked || write_ready || read_ready);
    frame_read <= is_frame;

    if (queue_reply) reply_length <= bus_wdata[`MBX_REPLY_LENGTH_BITS];
    if (queue_telegram && !bus_wdata[`MBX_TELEGRAM_REPEAT_BITS]) begin
      telegram_length   <= bus_wdata[`MBX_TELEGRAM_LENGTH_BITS];
      telegram_no_reply <= bus_wdata[`MBX_TELEGRAM_NO_REPLY_BITS];
    end
    if (reg_write && bus_word == `MBX_LED_WORD) begin
      led_modbus_red   <= bus_wdata[`MBX_LED_MODBUS_RED_BITS];
      led_modbus_green <= bus_wdata[`MBX_LED_MODBUS_GREEN_BITS];
      led_drive_red    <= bus_wdata[`MBX_LED_DRIVE_RED_BITS];
      led_drive_green  <= bus_wdata[`MBX_LED_DRIVE_GREEN_BITS];
    end

    reg_rdata <= 16'd0;
    case (bus_word)
      `MBX_ID_WORD: reg_rdata <= `MBX_ID_ID_RESET;
      `MBX_VERSION_WORD: begin
        reg_rdata[`MBX_VERSION_MINOR_BITS] <= `MBX_VERSION_MINOR_RESET;
        reg_rdata[`MBX_VERSION_MAJOR_BITS] <= `MBX_VERSION_MAJOR_RESET;
      end
      `MBX_BUILD_WORD: begin
        reg_rdata[`MBX_BUILD_STRICT_T15_BITS] <= STRICT_T15;
        reg_rdata[`MBX_BUILD_PREPARE_EARLY_BITS] <= PREPARE_EARLY;
        reg_rdata[`MBX_BUILD_SOFT_CORE_BITS] <= SOFT_CORE_ID;
        reg_rdata[`MBX_BUILD_CLK_MHZ_BITS] <= CLK_MHZ[7:0];
      end
      `MBX_SW_BAUD_WORD: reg_rdata[`MBX_SW_BAUD_SWITCHES_BITS] <= sw_baud;
      `MBX_SW_ADDR_WORD: reg_rdata[`MBX_SW_ADDR_SWITCHES_BITS] <= sw_addr;
      `MBX_TIME_WORD: reg_rdata[`MBX_TIME_MS_BITS] <= ms;
      `MBX_LED_WORD: begin
        reg_rdata[`MBX_LED_MODBUS_RED_BITS] <= led_modbus_red;
        reg_rdata[`MBX_LED_MODBUS_GREEN_BITS] <= led_modbus_green;
        reg_rdata[`MBX_LED_DRIVE_RED_BITS] <= led_drive_red;
        reg_rdata[`MBX_LED_DRIVE_GREEN_BITS] <= led_drive_green;
      end
      `MBX_REQUEST_WORD: begin
        reg_rdata[`MBX_REQUEST_TICKET_BITS] <= request_ticket;
        reg_rdata[`MBX_REQUEST_CANDIDATE_BITS] <= request_candidate;
        reg_rdata[`MBX_REQUEST_COMMITTED_BITS] <= request_committed;
        reg_rdata[`MBX_REQUEST_BROADCAST_BITS] <= request_broadcast;
        reg_rdata[`MBX_REQUEST_BANK_BITS] <= request_bank;
      end
      `MBX_REQUEST_LENGTH_WORD: reg_rdata[`MBX_REQUEST_LENGTH_BYTES_BITS] <= request_length;
      `MBX_REPLY_WORD: begin
        reg_rdata[`MBX_REPLY_QUEUED_BITS]  <= reply_queued;
        reg_rdata[`MBX_REPLY_SENDING_BITS] <= reply_sending;
      end
      `MBX_EXCHANGE_WORD: begin
        reg_rdata[`MBX_EXCHANGE_QUEUED_BITS] <= telegram_queued;
        reg_rdata[`MBX_EXCHANGE_SENDING_BITS] <= telegram_sending;
        reg_rdata[`MBX_EXCHANGE_STARTED_BITS] <= telegram_started;
        reg_rdata[`MBX_EXCHANGE_LISTENING_BITS] <= drive_listening;
        reg_rdata[`MBX_EXCHANGE_CANDIDATE_BITS] <= drive_candidate;
        reg_rdata[`MBX_EXCHANGE_GOOD_BITS] <= drive_good;
        reg_rdata[`MBX_EXCHANGE_LGE_BITS] <= drive_lge;
      end
      `MBX_SUPERVISOR_WORD: begin
        reg_rdata[`MBX_SUPERVISOR_BITES_BITS] <= watchdog_bites;
        reg_rdata[`MBX_SUPERVISOR_LOOPBACK_BITS] <= loopback_open;
      end
      default: ;
    endcase

    if (rst) begin
      done <= 1'b0;
      {led_modbus_red, led_modbus_green, led_drive_red, led_drive_green} <= 4'd0;
    end
  end

  // TICKET goes to the commit gate.
  wire unused = &{1'b0, bus_wdata[15:8]};

endmodule

`default_nettype wire
