// SPDX-License-Identifier: Apache-2.0
// The place of the one reply that waits to leave: empty or queued.
//
// An order fills the place, or empties it if the reply has no bytes or the newest request takes
// none; a newer order replaces an older one. The place is emptied by a newer candidate, by a
// withdrawn one, by a character that begins after the commit (FRAME-7), by the end of the loop-back
// test, and, if the order said after_drive, by a bad telegram of the drive.
// start: the reply leaves in this clock. It needs an answerable request, or the open loop-back test
// (LOOP-1), a line silent for t3.5 and, with after_drive, a good telegram of the drive (PERF-3).
// Clock domain: clk.
`default_nettype none

module reply_slot (
    input  wire clk,
    input  wire rst,
    // firmware
    input  wire order,
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
    input  wire loopback_close,
    // stream out
    output wire start,
    // status
    output reg  queued
);

  reg  wait_drive = 1'b0;

  wire heard = start_seen && is_committed;
  wire dropped = candidate || withdrawn || heard || loopback_close || (drive_bad && wait_drive);

  assign start = queued && (answerable || loopback_open) && quiet && (!wait_drive || drive_good);

  initial queued = 1'b0;

  always @(posedge clk) begin
    if (order) wait_drive <= after_drive;

    if (rst || dropped) queued <= 1'b0;
    else if (order) queued <= !empty && (loopback_open || takes_reply);
    else if (start) queued <= 1'b0;
  end

endmodule

`default_nettype wire
