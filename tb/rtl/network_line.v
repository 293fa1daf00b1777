// SPDX-License-Identifier: Apache-2.0
// Bench wrapper: the network port with base tick and tables of the switches, as on the card, by default with
// EXTENDED_SWITCHES for every rate and format. CLK_HZ 0: a base tick in each clock. SystemVerilog joins what has the
// port's names.
`default_nettype none

module network_line #(
    parameter CLK_HZ = 0,
    parameter [0:0] STRICT_T15 = 1'b1,
    parameter [0:0] BREAK_TOLERANT = 1'b0,
    parameter [0:0] EXTENDED_SWITCHES = 1'b1
) (
    input  wire       clk,
    input  wire       rst,
    // frame memory
    output wire       write_valid,
    input  wire       write_ready,
    output wire [5:0] write_addr,
    output wire [7:0] write_data,
    output wire       read_valid,
    input  wire       read_ready,
    output wire [4:0] read_addr,
    input  wire [7:0] read_data,
    input  wire       read_damaged,
    // stream in
    input  wire       reply_start,
    input  wire [4:0] reply_length,
    // pins
    input  wire       rx,
    output wire       tx,
    output wire       de,
    // configuration
    input  wire [5:1] sw_baud,
    input  wire [7:0] own_address,
    input  wire       loopback_open,
    // status
    output wire       sending,
    output wire       quiet,
    output wire       start_seen,
    output wire       candidate,
    output wire       commit,
    output wire       revoke,
    output wire [7:0] frame_length,
    output wire       frame_broadcast,
    output wire       frame_writes_coils,
    output wire       frame_writes_parameter,
    output wire       frame_bank,
    output wire       silent,
    output wire       count_crc,
    output wire       count_parity,
    output wire       count_framing,
    output wire       count_t15,
    output wire       count_overrun,
    output wire       count_foreign,
    output wire       fault
);

  wire tick_base;
  wire tick16;
  wire undivided;
  wire [6:0] mask;
  wire parity_enable;
  wire parity_odd;
  wire two_stop;
  wire [8:0] half_end;
  wire half_uneven;

  card_tables #(
      .EXTENDED_SWITCHES(EXTENDED_SWITCHES)
  ) tables_i (
      .baud_undivided(undivided),
      .baud_mask(mask),
      .*
  );

  generate
    if (CLK_HZ == 0) begin : g_each
      assign tick_base = 1'b1;
    end else begin : g_base
      baud_base #(.CLK_HZ(CLK_HZ)) base_i (.*);
    end
  endgenerate

  baud_divider divider_i (
      .clk(clk),
      .tick_base(tick_base),
      .tick16_modbus(tick16),
      .tick16_drive(),
      .modbus_undivided(undivided),
      .modbus_mask(mask)
  );

  network_port port_i (
      .strict_t15(STRICT_T15),
      .break_tolerant(BREAK_TOLERANT),
      .*
  );

endmodule

`default_nettype wire
