// SPDX-License-Identifier: Apache-2.0
// LOCKSTEP = 1: nothing reaches the bus but what both cores ask for, and a difference is a trap in the same clock
// (SAFE-4). So with either core arbitrary from any clock on, the other one asks for each access that memory, mailbox
// and gate see.
//
// Both cores are arbitrary here, in each clock. Nothing is assumed.

(* hierconn *) wire \g_picorv32.core_i.seen_reset ;
(* hierconn *) wire \g_picorv32.core_i.seen_ready ;
(* hierconn *) wire [31:0] \g_picorv32.core_i.seen_data ;
(* hierconn *) wire \g_picorv32.g_lockstep.second_i.seen_reset ;
(* hierconn *) wire \g_picorv32.g_lockstep.second_i.seen_ready ;
(* hierconn *) wire [31:0] \g_picorv32.g_lockstep.second_i.seen_data ;
(* hierconn *) wire [69:0] \g_picorv32.core_i.any ;
(* hierconn *) wire [69:0] \g_picorv32.g_lockstep.second_i.any ;

wire g_trap, g_valid, g_second_trap, g_second_valid;
wire [31:0] g_addr, g_wdata, g_second_addr, g_second_wdata;
wire [3:0] g_wstrb, g_second_wstrb;
assign {g_trap, g_valid, g_addr, g_wdata, g_wstrb} = \g_picorv32.core_i.any ;
assign {g_second_trap, g_second_valid, g_second_addr, g_second_wdata, g_second_wstrb} =
    \g_picorv32.g_lockstep.second_i.any ;

// What a write says; a reading says where.
wire g_same_access = g_addr == g_second_addr && g_wstrb == g_second_wstrb &&
    (g_wstrb == 4'd0 || g_wdata == g_second_wdata);
wire g_differ = g_trap != g_second_trap || g_valid != g_second_valid || (g_valid && !g_same_access);

always @* begin
  a_first : assert (!bus_valid || (g_valid && bus_addr == g_addr && bus_wstrb == g_wstrb &&
      (bus_wstrb == 4'd0 || bus_wdata == g_wdata)));
  a_second : assert (!bus_valid || (g_second_valid && bus_addr == g_second_addr && bus_wstrb == g_second_wstrb &&
      (bus_wstrb == 4'd0 || bus_wdata == g_second_wdata)));
  a_difference : assert (!g_differ || (trap && !bus_valid));
  a_trap : assert (trap == (g_differ || g_trap));
  // Cores that agree are served, both with the same answers.
  a_served : assert (g_differ || bus_valid == g_valid);
  a_answers : assert ({\g_picorv32.core_i.seen_reset , \g_picorv32.core_i.seen_ready , \g_picorv32.core_i.seen_data } ==
      {!rst, bus_ready, bus_rdata});
  a_same_answers : assert ({\g_picorv32.g_lockstep.second_i.seen_reset , \g_picorv32.g_lockstep.second_i.seen_ready ,
      \g_picorv32.g_lockstep.second_i.seen_data } == {!rst, bus_ready, bus_rdata});
end

// ---- covers: the module does act
always @(posedge clk) begin
  c_write : cover (bus_valid && bus_wstrb == 4'b0100);
  c_read : cover (bus_valid && bus_wstrb == 4'd0 && g_wdata != g_second_wdata);
  c_difference : cover (trap && g_valid && g_second_valid && g_addr == g_second_addr && g_wdata != g_second_wdata);
end
