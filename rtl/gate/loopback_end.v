// SPDX-License-Identifier: Apache-2.0
// Marks the clock in which the loop-back test ends. reply_slot and telegram_slot then drop what
// the test queued (LOOP-1).
//
// closing: loopback_open was 1 in the clock before and is 0 now.
// Clock domain: clk. Rule: LOOP-1.
`default_nettype none

module loopback_end (
    input  wire clk,
    // configuration
    input  wire loopback_open,
    // status
    output wire closing
);

  reg was_open = 1'b0;

  assign closing = was_open && !loopback_open;

  always @(posedge clk) was_open <= loopback_open;

endmodule

`default_nettype wire
