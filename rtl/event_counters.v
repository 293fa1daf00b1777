// SPDX-License-Identifier: Apache-2.0
// Counts one-clock events in the frame memory: 16 bits each, low byte first.
//
// An event sets its flag; one at a time the flags are worked off by reading,
// adding and writing back, low byte and, on carry, high byte. That takes some ten
// clocks, far less than the time between two events of one kind. The counters wrap
// round at 65536. Counter k stands at bytes 2k and 2k + 1. Clock domain: clk.
`default_nettype none

module event_counters #(
    parameter EVENTS = 7
) (
    input  wire              clk,
    input  wire              rst,
    // stream in
    input  wire [EVENTS-1:0] events,
    // frame memory, 32 bytes
    output wire              read_valid,
    input  wire              read_ready,
    input  wire [       7:0] read_data,
    output wire              write_valid,
    input  wire              write_ready,
    output wire [       4:0] addr,
    output reg  [       7:0] write_data
);

  localparam [1:0] S_IDLE = 2'd0;
  localparam [1:0] S_READ = 2'd1;
  localparam [1:0] S_ADD = 2'd2;
  localparam [1:0] S_WRITE = 2'd3;

  reg [1:0] state = S_IDLE;
  reg [EVENTS-1:0] flags = {EVENTS{1'b0}};
  reg [3:0] which = 4'd0;
  reg high = 1'b0;
  reg carry = 1'b0;

  // The lowest flag that is set, as a number and as a mask to take it back.
  reg [3:0] lowest;
  integer i;
  always @* begin
    lowest = 4'd0;
    for (i = EVENTS - 1; i >= 0; i = i - 1) if (flags[i]) lowest = i[3:0];
  end
  wire [EVENTS-1:0] lowest_mask = flags & (~flags + {{(EVENTS - 1) {1'b0}}, 1'b1});

  assign read_valid = state == S_READ;
  assign write_valid = state == S_WRITE;
  assign addr = {which, high};

  always @(posedge clk) begin
    flags <= flags | events;
    case (state)
      S_READ: if (read_ready) state <= S_ADD;
      S_ADD: begin
        {carry, write_data} <= {1'b0, read_data} + 9'd1;
        state <= S_WRITE;
      end
      S_WRITE:
      if (write_ready) begin
        high  <= 1'b1;
        state <= carry && !high ? S_READ : S_IDLE;
      end
      default: begin
        which <= lowest;
        high  <= 1'b0;
        if (flags != {EVENTS{1'b0}}) begin
          flags <= (flags & ~lowest_mask) | events;
          state <= S_READ;
        end
      end
    endcase
    if (rst) begin
      state <= S_IDLE;
      flags <= {EVENTS{1'b0}};
    end
  end

`ifndef SYNTHESIS
  reg [8*5-1:0] state_name;
  always @* begin
    case (state)
      S_READ:  state_name = "READ";
      S_ADD:   state_name = "ADD";
      S_WRITE: state_name = "WRITE";
      default: state_name = "IDLE";
    endcase
  end
`endif

endmodule

`default_nettype wire
