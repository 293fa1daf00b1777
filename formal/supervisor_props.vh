// SPDX-License-Identifier: Apache-2.0
// The watchdog bites in time and only then, a fault stays, and the loop-back test never opens again (WDG-1, LED-5,
// LOOP-1).

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

reg [1:0] g_beats = 2'd0;  // changes of the beat since the last kick or bite, up to 3
reg g_beat = 1'b0;
reg g_trap = 1'b0;  // a trap in the clock before
reg g_rst = 1'b1;
reg [1:0] g_restart = 2'd0;  // remaining clocks of the restart
reg [1:0] g_bites = 2'd0;  // bites since the last exchange
reg g_halted = 1'b0;
reg g_closed = 1'b0;
reg g_heard = 1'b0;  // a character that no port of the card sent
reg [7:0] g_restarts = 8'd0;  // since the reset, up to 255
reg g_good = 1'b0;
reg g_fault = 1'b0;  // a fault in the clock before

wire g_bite = (g_beats == 2'd3 || core_trap) && g_restart == 2'd0;

always @(posedge clk) begin
  g_rst <= rst;
  g_beat <= beat;
  g_trap <= core_trap;
  g_good <= drive_good;
  g_fault <= fault;
  g_restart <= g_bite ? 2'd2 : g_restart == 2'd0 ? 2'd0 : g_restart - 2'd1;
  if (kick || g_bite) g_beats <= 2'd0;
  else if (beat != g_beat) g_beats <= g_beats + 2'd1;
  if (g_bite && !fault) g_bites <= g_bites + 2'd1;
  else if (!fault && (reply_start || (drive_good && !g_good))) g_bites <= 2'd0;
  if (g_bite && g_restarts != 8'd255) g_restarts <= g_restarts + 8'd1;
  g_halted <= g_halted || halt;
  g_closed <= g_closed || loopback_close;
  g_heard <= g_heard || (start_seen && !driven);
  if (rst) begin
    g_restart <= 2'd0;
    g_beats <= 2'd0;
    g_bites <= 2'd0;
    g_halted <= 1'b0;
    g_closed <= 1'b0;
    g_heard <= 1'b0;
    g_restarts <= 8'd0;
  end
end

always @(posedge clk) begin
  if (g_past) begin
    // WDG-1: the soft core restarts for two clocks, only at the third beat or a trap.
    a_restarts : assert (rst || g_fault || core_rst == (g_restart != 2'd0));
    // LED-5: only the third bite, a halt and an invalid address are a fault.
    a_fault : assert (fault == (!rst && (g_halted || g_bites == 2'd3 || (!address_valid && !loopback_open))));
    // The soft core is in reset during a fault, from its second clock on.
    a_stopped : assert (!g_fault || core_rst);
    // A fault stays until reset.
    a_stays : assert (g_rst || rst || !$past(g_halted || g_bites == 2'd3) || fault);
    // LOOP-1
    a_loopback : assert (loopback_open == (!g_closed && sw_baud == LOOPBACK_SWITCHES));
    a_heard : assert (loopback_heard == g_heard);
    // MAP-10
    a_counted : assert (restarts == g_restarts);
  end
end

// ---- helpers for induction
always @(posedge clk) begin
  if (g_past) begin
    i_beats : assert (idle_beats == g_beats && beat_before == g_beat);
    i_bites : assert (bites == g_bites);
    i_restarting : assert (restarting == (g_restart == 2'd2 ? 2'b01 : g_restart == 2'd1 ? 2'b10 : 2'b00));
    i_halted : assert (halted == g_halted && loopback_closed == g_closed && drive_was_good == g_good);
    i_stopped : assert (stopped == g_fault);
  end
end

// ---- covers
always @(posedge clk) begin
  c_third_bite : cover (g_past && fault && g_bites == 2'd3 && !g_halted && address_valid);
  c_saved : cover (g_past && !rst && g_bites == 2'd0 && $past(g_bites) == 2'd2 && !$past(rst));
  c_bites_without_trap : cover (g_past && g_restart == 2'd2 && !g_trap && !rst);
end
