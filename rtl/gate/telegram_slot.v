// SPDX-License-Identifier: Apache-2.0
// The place of the one telegram that waits to leave, and its licence.
//
// queue fills the place with a new telegram; again fills it with the one that has left.
// Only a licence lets a telegram start: a guarded bit (SAFE-1, SAFE-4). A committed request
// licenses it, at once or with the commit; then the telegram must be queued and must never
// have left (begun). The licence outlives newer requests until the telegram has left, and
// is good for one repeat then. The repeat is lost with the reply, with a newer committed
// request and at once for a broadcast (FC-9). A write to the telegram's memory (touched) and
// the end of the loop-back test take licence and telegram. While that test is open, every
// order has a licence, but no command (LOOP-1).
// control: the licensed request writes coils, so bit 10 of the control word may be 1.
// command_left: the write of coils of the newest request leaves in this clock.
// In the clock of any order no telegram starts. Clock domain: clk.
// Rules: FRAME-6, FC-8, FC-9, LOOP-1, SAFE-1, SAFE-4.
`default_nettype none

module telegram_slot (
    input  wire clk,
    input  wire rst,
    // firmware
    input  wire queue,
    input  wire again,
    input  wire touched,
    // newest request
    input  wire current,
    input  wire takes_telegram,
    input  wire licenses,
    input  wire broadcast,
    input  wire writes_coils,
    input  wire candidate,
    input  wire commits,
    input  wire withdrawn,
    input  wire reply_left,
    // drive line
    input  wire quiet,
    // loop-back test
    input  wire loopback_open,
    input  wire closing,
    // stream out
    output wire start,
    output reg  control,
    // status
    output wire command_left,
    output reg  queued,
    output reg  started
);

  reg  newest = 1'b0;  // no other request was committed since the telegram was queued
  reg  repeatable = 1'b0;  // newest, and no broadcast
  reg  begun = 1'b0;  // it has left once, or there is none

  wire licensed;
  wire fault;
  wire dropped = (candidate || withdrawn) && (queue || !licensed);
  wire overtaken = commits && licensed && !queue;
  wire ended = touched || closing || (overtaken && begun);
  wire granted = commits && !candidate && (queue ? current : !licensed && queued && !begun);
  wire at_once = queue && !candidate && (loopback_open || licenses);
  wire answered = reply_left && newest && !loopback_open;
  wire left_last = (start && (begun || !repeatable)) || answered;

  assign start = queued && licensed && quiet && !queue && !again && !touched && !closing;
  assign command_left = start && newest && control;

  initial {queued, started, control} = 3'd0;

  guarded_bit licence_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (ended || granted || queue || left_last),
      .data (!ended && (granted || at_once)),
      // status
      .value(licensed),
      .fault(fault)
  );

  always @(posedge clk) begin
    if (rst || ended || dropped) queued <= 1'b0;
    else if (queue) queued <= loopback_open || takes_telegram;
    else if (again) queued <= licensed && begun && repeatable && !answered;
    else if (start || answered) queued <= 1'b0;

    if (rst || queue || again) started <= 1'b0;
    else if (start) started <= 1'b1;

    if (queue) begun <= 1'b0;
    else if (start || (!queued && !licensed)) begun <= 1'b1;

    if (queue) {newest, repeatable} <= {1'b1, !broadcast};
    else if (overtaken) {newest, repeatable} <= 2'b00;

    if (granted) control <= writes_coils;
    else if (queue) control <= writes_coils && licenses;
  end

  // For waveforms only.
  wire unused = &{1'b0, fault};

endmodule

`default_nettype wire
