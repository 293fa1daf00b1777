// SPDX-License-Identifier: Apache-2.0
// One wire, for the agents' own tests: what a source sends on line, a monitor hears on heard. de is free.
`default_nettype none

module wire_bench (
    input  wire line,
    input  wire de,
    output wire heard,
    output wire enabled
);
  assign heard   = line;
  assign enabled = de;
endmodule

`default_nettype wire
