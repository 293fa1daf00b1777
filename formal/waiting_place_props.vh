// SPDX-License-Identifier: Apache-2.0
// waiting_place: a licence that moved in stays, with its right, until it is taken or a newer one comes (FRAME-7).

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

(* hierconn *) wire \valid_i.held ;
(* hierconn *) wire \valid_i.opposite ;

reg g_there = 1'b0;
reg g_command = 1'b0;  // of the licence that came last
always @(posedge clk) begin
  if (fill) {g_there, g_command} <= {1'b1, writes_coils};
  else if (take) g_there <= 1'b0;
  if (rst) g_there <= 1'b0;
end

always @(posedge clk) begin
  if (g_past) begin
    a_valid : assert (valid == g_there);
    a_control : assert (!valid || control == g_command);
    i_halves : assert (\valid_i.held == g_there && \valid_i.opposite == !g_there);
  end
  if (g_past && !rst) begin
    c_stays : cover (valid && control && $past(valid && !fill && !take));
    c_taken : cover (!valid && $past(valid && take));
    c_newer : cover (valid && !control && $past(valid && control && fill));
  end
end
