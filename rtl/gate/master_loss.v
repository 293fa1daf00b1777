// SPDX-License-Identifier: Apache-2.0
// The licence of the one stop that leaves when the master is lost.
//
// watch, with rights: the firmware gives period and, for a write of coils, whether it leaves the
// start bit at 1 (running). running = 1 arms, running = 0 disarms; other requests change neither.
// commits and watch restart the wait. due: armed, and more than period has passed since the last
// of both; never with period 0. take, the licence of the stop while due, disarms until a write of
// coils arms again.
// armed and over are guarded bits. The count is not guarded: the firmware measures the same time,
// and both must agree (docs/hardening.md, Loss of the master).
// rights: the order is for the newest request, which is committed. rights and commits never come
// in one clock.
// Units: period counts changes of beat, 1/1200 s; at most 1 more passes.
// fault: a half of a guarded bit has flipped (docs/hardening.md, Faults of guarded bits).
// rst disarms. Clock domain: clk. Rules: SAFE-7, SAFE-4.
`default_nettype none

module master_loss (
    input  wire        clk,
    input  wire        rst,
    input  wire        beat,
    // newest request
    input  wire        commits,
    input  wire        rights,
    input  wire        writes_coils,
    // firmware
    input  wire        watch,
    input  wire        running,
    input  wire [19:0] period,
    input  wire        take,
    // status
    output wire        due,
    output wire        fault
);

  reg  [19:0] limit = 20'd0;
  reg  [19:0] left = 20'd0;
  reg         beat_before = 1'b0;

  wire        armed;
  wire        over;
  wire        armed_fault;
  wire        over_fault;
  wire        accepted = watch && rights;
  wire        used = take && due;
  wire        tick = beat != beat_before;
  wire        begins = commits || accepted;
  wire        ends = tick && left == 20'd0 && limit != 20'd0;

  assign due   = armed && over && !commits;
  assign fault = armed_fault || over_fault;

  guarded_bit armed_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load ((accepted && writes_coils) || used),
      .data (accepted && writes_coils && running),
      // status
      .value(armed),
      .fault(armed_fault)
  );

  guarded_bit over_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (begins || used || ends),
      .data (!begins && !used),
      // status
      .value(over),
      .fault(over_fault)
  );

  always @(posedge clk) begin
    beat_before <= beat;
    if (accepted) limit <= period;
    if (begins) left <= accepted ? period : limit;
    else if (tick && left != 20'd0) left <= left - 20'd1;
  end

endmodule

`default_nettype wire
