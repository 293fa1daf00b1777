// SPDX-License-Identifier: Apache-2.0
// The frame memory: 256 bytes, one write port, one read port, one block RAM.
//
// Reads take one clock. A read and a write of the same byte in the same clock never
// matter (nobody reads what is still being written), so no bypass is asked for.
// Its content outlives a reset: the counters go on counting. Clock domain: clk.
`default_nettype none

module frame_ram (
    input  wire       clk,
    // write port
    input  wire       write_enable,
    input  wire [7:0] write_addr,
    input  wire [7:0] write_data,
    // read port
    input  wire [7:0] read_addr,
    output reg  [7:0] read_data
);

  (* no_rw_check *) reg [7:0] bytes[0:255];

  integer i;
  initial for (i = 0; i < 256; i = i + 1) bytes[i] = 8'd0;

  always @(posedge clk) begin
    if (write_enable) bytes[write_addr] <= write_data;
    read_data <= bytes[read_addr];
  end

endmodule

`default_nettype wire
