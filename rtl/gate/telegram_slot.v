// SPDX-License-Identifier: Apache-2.0
// The place of the one telegram in the frame memory.
//
//   EMPTY     no telegram, or it was dropped
//   QUEUED    ordered; if it was made for the candidate (early), it waits for the commit
//   LICENSED  may leave as soon as the line is quiet
//   LEFT      on the line, or sent; as long as it is licensed it may leave once more (FC-9)
//
// docs/hardening.md, State of the telegram: codes differ in two bits; fault: one is flipped.
//
// An order takes the telegram of `kind` (licences) if its ticket is current. It is dropped when the
// candidate is withdrawn or a newer one comes, when its kind has no licence, and when its memory is
// written (touched). A commit of its own kind, which it does not contain, drops a write that has not
// left, for the firmware orders the newer one, and ends the repeat of any telegram that has left. A
// licensed reading may still leave. Without a reply (no_reply) there is no repeat. control: bit 10 of the control word may be
// 1. stop: bit 6, the start, leaves as 0 (SAFE-7), of an image that was ordered as the stop and of
// one without a committed write of coils. grants_stop: such a telegram gets its licence;
// from then on no candidate drops it. used: a licence is used up. In the clock of an order no
// telegram starts. Clock domain: clk.
`default_nettype none

module telegram_slot (
    input  wire       clk,
    input  wire       rst,
    // firmware
    input  wire       order,
    input  wire       again,
    input  wire       touched,
    input  wire [1:0] order_kind,
    input  wire       early,
    input  wire       no_reply,
    input  wire       take_stop,
    // newest request
    input  wire       current,
    input  wire       candidate,
    input  wire       is_candidate,
    input  wire       is_committed,
    input  wire       withdrawn,
    // licences
    input  wire       valid,
    input  wire       renewed,
    input  wire       free,
    output reg  [1:0] kind,
    output wire       used,
    // drive line
    input  wire       quiet,
    // loop-back test
    input  wire       loopback_open,
    input  wire       loopback_close,
    // stream out
    output wire       start,
    output wire       control,
    output reg        stop,
    // status
    output wire       queued,
    output wire       grants_stop,
    output wire       started,
    output wire       fault
);

  localparam [1:0] K_NEWEST = 2'd0;
  localparam [1:0] K_IMAGE = 2'd1;

  localparam [2:0] S_EMPTY = 3'b000;
  localparam [2:0] S_QUEUED = 3'b011;
  localparam [2:0] S_LICENSED = 3'b101;
  localparam [2:0] S_LEFT = 3'b110;

  wire [2:0] state;
  reg [2:0] next;
  reg repeatable = 1'b0;
  reg repeated = 1'b0;
  reg is_stop = 1'b0;

  wire licensed;
  wire licence_fault;

  // Made for a candidate that is still there or has committed, or without one. Made without the
  // candidate that is there, it might leave with the licence that this gives.
  wire meant = early ? is_candidate || is_committed : !is_candidate;
  wire accepted = current && !candidate && !withdrawn && meant;

  // The request of a reading need not be the newest one when its telegram leaves.
  wire outdated = renewed && (kind != K_NEWEST || state == S_LEFT || repeated);
  wire ended = touched || loopback_close || (!order && state != S_QUEUED && outdated);
  wire decided = state == S_QUEUED && !is_candidate && !candidate;
  wire grant = decided && !order && !ended && (valid || loopback_open);
  wire refused = state == S_QUEUED && (candidate || withdrawn || (decided && !grant));
  wire last = repeated || !repeatable;

  assign start = state == S_LICENSED && licensed && quiet && !order && !again && !ended;
  assign used = start && !repeated && !loopback_open;
  assign grants_stop = grant && kind == K_IMAGE && (!free || is_stop);
  assign control = kind == K_IMAGE;
  assign queued = state == S_QUEUED || state == S_LICENSED;
  assign started = state == S_LEFT;
  assign fault = licence_fault || ^state;

  initial begin
    kind = K_NEWEST;
    stop = 1'b0;
  end

  sparse_state #(
      .WIDTH(3),
      .START(S_EMPTY)
  ) state_i (
      .clk  (clk),
      .rst  (rst),
      .next (next),
      // status
      .state(state)
  );

  guarded_bit licence_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (order || ended || grant || (start && last)),
      .data (grant),
      // status
      .value(licensed),
      .fault(licence_fault)
  );

  always @* begin
    next = state;
    case (state)
      S_QUEUED:
      if (refused) next = S_EMPTY;
      else if (grant) next = S_LICENSED;
      S_LICENSED: if (start) next = S_LEFT;
      S_LEFT: if (again) next = licensed ? S_LICENSED : S_EMPTY;
      default: next = S_EMPTY;
    endcase
    if (order) next = accepted || loopback_open ? S_QUEUED : S_EMPTY;
    if (ended) next = started && !order && !again ? S_LEFT : S_EMPTY;
  end

  always @(posedge clk) begin
    if (grant) stop <= grants_stop;
    if (order) begin
      kind <= loopback_open ? K_NEWEST : order_kind;
      repeatable <= !no_reply;
      is_stop <= take_stop;
    end

    if (order) repeated <= 1'b0;
    else if (again && state == S_LEFT) repeated <= 1'b1;
  end

endmodule

`default_nettype wire
