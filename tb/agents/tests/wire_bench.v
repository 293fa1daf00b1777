// SPDX-License-Identifier: Apache-2.0
// One wire for the tests of the agents: a source drives line, a monitor reads heard. The test drives de.
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
