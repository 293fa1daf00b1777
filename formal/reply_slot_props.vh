// SPDX-License-Identifier: Apache-2.0
// reply_slot: one order makes one reply at most, and nothing that should leave stays (FRAME-6, FRAME-7, PERF-3).

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

reg g_due = 1'b0;  // the last order counted, and neither left nor ended since
reg g_waits = 1'b0;  // it is to wait for the drive's reply
wire g_ends = candidate || withdrawn || (start_seen && is_committed) || closing || (g_waits && drive_bad);

always @(posedge clk) begin
  if (queue_reply) {g_due, g_waits} <= {!empty && (takes_reply || loopback_open), after_drive};
  else if (start) g_due <= 1'b0;
  if (g_ends || rst) g_due <= 1'b0;
end

always @(posedge clk) begin
  if (g_past) begin
    // FRAME-6, FRAME-7: only what was ordered, for a request that may be answered; without one in the loop-back test.
    a_ordered : assert (!start || g_due);
    a_answerable : assert (!start || answerable || loopback_open);
    a_quiet : assert (!start || quiet);
    a_after_drive : assert (!start || !g_waits || drive_good);
    a_closing : assert (!start || !closing);
    a_leaves : assert (start || !(g_due && quiet && !closing && (answerable || loopback_open) && (!g_waits || drive_good)));
    a_queued : assert (queued == g_due);
    i_waits : assert (wait_drive == g_waits);
  end
  if (g_past && !rst) begin
    c_leaves : cover (start && !loopback_open);
    c_after_drive : cover (start && g_waits);
    c_dropped : cover (!queued && $past(queued && drive_bad && !start));
  end
end
