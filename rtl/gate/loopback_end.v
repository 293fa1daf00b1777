// SPDX-License-Identifier: Apache-2.0
// Finds the clock in which the loop-back test ends, and with it all that the test queued.
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
