// SPDX-License-Identifier: Apache-2.0
// Watches the firmware, restarts it when it stops, and halts the card on a fault.
//
// Watchdog (WDG-1): it bites at the third beat without a kick, or on core_trap: a trap of the
// soft core, or a flipped bit that the memory or a guarded bit reports. A bite resets the soft
// core and the queued reply and telegram. The lines and the switch settings are not reset, so a
// telegram on the wire is finished. Three bites are a fault if in between neither a reply was
// sent nor a good telegram came from the drive.
// restarts: the bites since the reset, up to 255.
// Fault (LED-5): an invalid unit address (not while the loop-back test is open), halt (the
// firmware found a wrong sum of its image), or the third bite. Until the next reset the soft core
// is stopped, both ports are in reset (both DE low) and both LEDs are red.
// Loop-back test (LOOP-1): open if its switch pattern is set at power-up, until the firmware
// closes it. It never opens again before the next reset.
// loopback_heard: since the reset a character began on a line while neither port was sending
// (driven), so somebody else sent it.
// Units: beat changes every 32/1200 s, so the watchdog bites 53 to 80 ms after the last kick.
// docs/hardening.md, Watchdog (SAFE-4). Clock domain: clk.
`default_nettype none

module supervisor #(
    parameter [9:1] LOOPBACK_SWITCHES = 9'b1111_00_111
) (
    input  wire       clk,
    input  wire       rst,
    input  wire       beat,
    // firmware
    input  wire       kick,
    input  wire       halt,
    input  wire       loopback_close,
    input  wire       core_trap,
    // line activity
    input  wire       start_seen,
    input  wire       driven,
    // configuration
    input  wire [9:1] sw_baud,
    input  wire       address_valid,
    // status
    input  wire       reply_start,
    input  wire       drive_good,
    output wire       core_rst,
    output wire       fault,
    output wire       loopback_open,
    output reg        loopback_heard,
    output reg  [7:0] restarts
);

  reg beat_before = 1'b0;
  reg [1:0] idle_beats = 2'd0;
  reg [1:0] bites = 2'd0;
  reg [1:0] restarting = 2'b00;
  reg halted = 1'b0;
  reg loopback_closed = 1'b0;
  reg drive_was_good = 1'b0;
  // fault, one clock later. Without it the longest path of the card goes from the switches'
  // address to the soft core's bus.
  reg stopped = 1'b0;

  initial begin
    loopback_heard = 1'b0;
    restarts = 8'd0;
  end

  wire bite = (idle_beats == 2'd3 || core_trap) && restarting == 2'b00;

  assign loopback_open = !loopback_closed && sw_baud == LOOPBACK_SWITCHES;
  assign fault = !rst && (halted || bites == 2'd3 || (!address_valid && !loopback_open));
  assign core_rst = rst || stopped || restarting != 2'b00;

  always @(posedge clk) begin
    // Two clocks, so that an access under way is answered before the next one begins.
    restarting  <= {restarting[0], bite};
    beat_before <= beat;
    if (beat != beat_before) idle_beats <= idle_beats + 2'd1;
    if (kick || bite) idle_beats <= 2'd0;
    drive_was_good <= drive_good;
    stopped <= fault;
    if (!fault && (reply_start || (drive_good && !drive_was_good))) bites <= 2'd0;
    if (bite && !fault) bites <= bites + 2'd1;
    // A sum, for a clock enable of its own would leave slices of the small card half empty.
    restarts <= restarts + {7'd0, bite && restarts != 8'hFF};
    if (halt) halted <= 1'b1;
    if (loopback_close) loopback_closed <= 1'b1;
    if (start_seen && !driven) loopback_heard <= 1'b1;
    if (rst) begin
      restarting <= 2'b00;
      idle_beats <= 2'd0;
      bites <= 2'd0;
      halted <= 1'b0;
      loopback_closed <= 1'b0;
      loopback_heard <= 1'b0;
      restarts <= 8'd0;
    end
  end

endmodule

`default_nettype wire
