// SPDX-License-Identifier: Apache-2.0
// The place of the one reply that waits to leave.
//
// queue_reply fills the place, or empties it if the order is for no reply, or for a request
// that takes none; a newer order replaces an older one. A withdrawn or a newer request empties
// the place, too. So does a character that begins after the commit (FRAME-7), and the end of
// the loop-back test. A bad drive reply empties it if the order said after_drive.
// With after_drive the reply leaves only while the drive's reply is good (PERF-3).
// start: the reply leaves in this clock. That needs an answerable request, or the open
// loop-back test (LOOP-1), and a line silent for t3.5.
// Clock domain: clk. Rules: FRAME-6, FRAME-7, LOOP-1, PERF-3.
`default_nettype none

module reply_slot (
    input  wire clk,
    input  wire rst,
    // firmware
    input  wire queue_reply,
    input  wire empty,
    input  wire after_drive,
    // newest request
    input  wire takes_reply,
    input  wire candidate,
    input  wire withdrawn,
    input  wire is_committed,
    input  wire answerable,
    // network line
    input  wire start_seen,
    input  wire quiet,
    // drive's reply
    input  wire drive_good,
    input  wire drive_bad,
    // loop-back test
    input  wire loopback_open,
    input  wire closing,
    // stream out
    output wire start,
    // status
    output reg  queued
);

  reg  wait_drive = 1'b0;

  wire heard = start_seen && is_committed;
  wire dropped = candidate || withdrawn || heard || closing || (drive_bad && wait_drive);

  assign start = queued && (answerable || loopback_open) && quiet && !closing &&
      (!wait_drive || drive_good);

  initial queued = 1'b0;

  always @(posedge clk) begin
    if (queue_reply) wait_drive <= after_drive;

    if (rst || dropped) queued <= 1'b0;
    else if (queue_reply) queued <= !empty && (loopback_open || takes_reply);
    else if (start) queued <= 1'b0;
  end

endmodule

`default_nettype wire
