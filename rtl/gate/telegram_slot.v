// SPDX-License-Identifier: Apache-2.0
// The place of the one telegram that waits to leave, and its licence.
//
// queue and use_place fill the place with a new telegram; again fills it with the one that
// has left. Only a licence lets a telegram start: a guarded bit (SAFE-1, SAFE-4). For queue a
// committed request gives it, at once or with the commit. The telegram must then be queued
// and fresh: it has never left. For use_place the licence comes from a waiting_place, at
// once; an empty place gives none (FRAME-7). The licence outlives newer requests until the
// telegram has left. After that it is good for one repeat (docs/hardening.md, Two
// transmissions). A broadcast has no repeat (FC-9). The repeat is lost with the reply, and
// with a newer write that waits (others_wait). A newer committed request ends it, too, unless
// the licence came from a place. A write to the telegram's memory (touched) and the end of the
// loop-back test end the licence and drop the telegram. While that test is open, every order of
// queue has a licence, but no command (LOOP-1).
// control: the licence is that of a write of coils or of the stop, so bit 10 of the control word
// may be 1.
// stop: master_loss gave the licence (place_stop), so bit 6, the start, leaves as 0 (SAFE-7).
// command_left: the write of coils of the newest request leaves in this clock.
// fault: a half of a guarded bit has flipped (docs/hardening.md, Faults of guarded bits).
// own: from this clock on the newest request licenses the telegram here.
// started: the telegram of the last order has started. rst drops licence and telegram.
// In the clock of any order no telegram starts. Clock domain: clk.
// Rules: FRAME-6, FC-8, FC-9, LOOP-1, SAFE-1, SAFE-4, SAFE-7.
`default_nettype none

module telegram_slot (
    input  wire clk,
    input  wire rst,
    // firmware
    input  wire queue,
    input  wire use_place,
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
    // waiting writes
    input  wire place_valid,
    input  wire place_control,
    input  wire place_to_all,
    input  wire place_stop,
    input  wire others_wait,
    // drive line
    input  wire quiet,
    // loop-back test
    input  wire loopback_open,
    input  wire closing,
    // stream out
    output wire start,
    output reg  control,
    output reg  stop,
    // status
    output wire command_left,
    output wire own,
    output reg  queued,
    output reg  started,
    output wire fault
);

  reg newest = 1'b0;  // no other request was committed since the telegram was queued
  reg repeatable = 1'b0;  // no broadcast, and no newer commit unless from_place
  reg from_place = 1'b0;  // the last order used the place of a unicast write

  wire licensed;
  wire fresh;  // it has not left yet; 0 if there is none
  wire licence_fault;
  wire fresh_fault;
  wire order = queue || use_place;
  wire dropped = (candidate || withdrawn) && (queue || !licensed) && !use_place;
  wire overtaken = commits && licensed && !order;
  wire passed_over = others_wait || (overtaken && !from_place);
  wire ended = touched || closing || (!fresh && !order && passed_over);
  wire granted = commits && !candidate && !use_place &&
      (queue ? current : !licensed && queued && fresh);
  wire at_once = use_place ? place_valid : queue && !candidate && (loopback_open || licenses);
  wire answered = reply_left && newest && !loopback_open;
  wire left_last = (start && (!fresh || !repeatable)) || answered;

  assign start = queued && licensed && quiet && !order && !again && !touched && !closing;
  assign command_left = start && newest && control;
  assign own = granted || (licensed && newest && !commits);

  assign fault = licence_fault || fresh_fault;

  initial {queued, started, control, stop} = 4'd0;

  guarded_bit licence_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (ended || granted || order || left_last),
      .data (!ended && (granted || at_once)),
      // status
      .value(licensed),
      .fault(licence_fault)
  );

  guarded_bit fresh_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (order || start || (!queued && !licensed)),
      .data (order),
      // status
      .value(fresh),
      .fault(fresh_fault)
  );

  always @(posedge clk) begin
    if (rst || ended || dropped) queued <= 1'b0;
    else if (order) queued <= use_place ? place_valid : loopback_open || takes_telegram;
    else if (again) queued <= licensed && !fresh && repeatable && !answered;
    else if (start || answered) queued <= 1'b0;

    if (rst || order || again) started <= 1'b0;
    else if (start) started <= 1'b1;

    if (queue) {newest, repeatable, from_place} <= {1'b1, !broadcast, 1'b0};
    else if (use_place)
      {newest, repeatable, from_place} <= {current && !candidate, {2{!place_to_all}}};
    else if (overtaken) {newest, repeatable} <= {1'b0, repeatable && from_place};

    if (granted) control <= writes_coils;
    else if (order) control <= use_place ? place_control : writes_coils && licenses;

    if (order) stop <= use_place && place_stop;
  end

endmodule

`default_nettype wire
