// SPDX-License-Identifier: Apache-2.0
// A request is handed over only if all its characters were good; once, at its time, with its full length. No byte that
// the firmware may be reading is overwritten (FRAME-1 ... FRAME-6, SAFE-1).
//
// No flipped bit is modelled here: fault stays low, and the bank's halves stay opposite.
//
// The ghosts follow the line by the rules: the number of characters of the frame, the errors of any of them, and the
// silences after it.
//
// Assumed of the neighbours: a character begins with start_seen and ends with byte_valid; no limit of silence is
// reached within a character nor in the clock before, because the vote on a start bit takes time; no two limits
// are reached at once; the memory takes a character before the next event on the line (bus_arbiter: it never
// waits). The CRC changes only while a character is on the line. Address switches do not move.
//
// The options of the network line may change while all characters are ignored, as they do once after a reset.
//
// BREAKS, with break_tolerant = 1: start_seen may come later than line_start or not at all, as break_filter delays it and takes breaks out. The
// zeros of a break leave the CRC's verdict as it is: the division of a remainder is reversible.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

(* hierconn *) wire \bank_i.held ;
(* hierconn *) wire \bank_i.opposite ;

reg g_character = 1'b0;  // a character is on the line
reg g_pending = 1'b0;  // a character was accepted and is not stored or dropped yet
reg g_reached = 1'b0;  // a limit was reached in the clock before
wire g_limit = half_reached || short_reached || long_reached;
always @(posedge clk) g_reached <= g_limit;
`ifdef BREAKS
wire g_is_break;  // the start bit that was held back was that of a break
assign g_is_break = $anyseq;
reg g_withheld = 1'b0;  // a start bit is held back
always @(posedge clk) begin
  if (start_seen || rst || deaf) g_withheld <= 1'b0;
  else if (line_start) g_withheld <= 1'b1;
  else if (g_is_break) g_withheld <= 1'b0;
end
// A start bit is held back only after a good frame or the card's own reply, which leave one of these states.
wire g_may_hold = may_break || state == S_IDLE;
always @* begin
  assume (!start_seen || line_start || g_withheld);
  assume (!(line_start && (g_character || g_withheld || byte_valid)));
  assume (!(line_start && !start_seen) || g_may_hold);
  assume (!(g_withheld && (g_limit || byte_valid)));
  assume (!(line_start && (g_limit || g_reached || g_pending)));
  assume (break_tolerant);
end
`else
always @* assume (line_start == start_seen && !break_tolerant);
`endif
reg g_cleared = 1'b0;  // in the clock before the CRC began anew
always @(posedge clk) g_cleared <= crc_clear;

always @* begin
  assume ({1'b0, half_reached} + {1'b0, short_reached} + {1'b0, long_reached} <= 2'd1);
  assume (!(start_seen && (byte_valid || g_character || g_reached)));
  assume (!byte_valid || g_character);
  assume (!((g_character || start_seen) && g_limit));
  assume (!(g_pending && (start_seen || byte_valid || g_limit)));
end
always @(posedge clk) begin
  if (g_past) assume ($stable(own_address));
  if (g_past && !(g_lost && $past(g_lost))) assume ($stable(strict_t15));
  if (g_past && !g_character && !g_cleared) assume ($stable(crc_good));
end

// ---- the frame by the rules
reg g_lost = 1'b1;  // characters are ignored until the next t3.5
reg [8:0] g_count = 9'd0;  // characters of the frame; 257: more than 256; 0: no frame
reg g_good = 1'b0;  // the frame was good at t1.5, and no character came since
reg g_early = 1'b0;  // the frame is good and the candidate, before t1.5
reg g_forgotten = 1'b0;  // the frame was not good at t1.5 (strict_t15)
reg g_parity = 1'b0;  // at least one of its characters had the error
reg g_framing = 1'b0;
reg [7:0] g_address = 8'd0;
reg g_coils = 1'b0;  // its second character is function 05 or 15
reg g_parameter = 1'b0;  // 06 or 16
reg g_bank = 1'b0;  // bank that its characters are written to
reg [8:0] g_summed = 9'd0;  // characters in the CRC unit, up to 257

wire g_whole = g_count >= 9'd4 && g_count <= 9'd256 && !g_parity && !g_framing && crc_good;
wire g_ours = g_address == own_address || g_address == 8'd0;
wire g_first = !g_lost && (g_count == 9'd0 || g_forgotten);
wire g_continued = g_good && start_seen;
wire g_resumed = g_early && start_seen;
wire g_take = byte_valid && !g_lost;
wire g_undriven = break_tolerant && g_take && byte_framing_error;  // perhaps a line that nobody drives
wire g_unjudged = g_count != 9'd0 && !g_good && !g_early && !g_forgotten;

wire g_raise_early = (half_reached || short_reached) && g_unjudged && g_whole && g_ours;

always @(posedge clk) begin
  if (start_seen) g_character <= 1'b1;
  if (byte_valid) g_character <= 1'b0;

  if (crc_clear) g_summed <= 9'd0;
  else if (byte_valid && g_summed != 9'd257) g_summed <= g_summed + 9'd1;

  if (byte_valid) g_forgotten <= 1'b0;
  if (g_continued) begin
    g_good <= 1'b0;
    if (strict_t15) begin
      g_lost  <= 1'b1;
      g_count <= 9'd0;
    end
  end
  if (g_raise_early) g_early <= !short_reached;
  if (g_resumed || short_reached) g_early <= 1'b0;
  if (g_take) begin
    g_count   <= g_first ? 9'd1 : g_count == 9'd257 ? 9'd257 : g_count + 9'd1;
    g_parity  <= byte_parity_error || (g_parity && !g_first);
    g_framing <= byte_framing_error || (g_framing && !g_first);
    if (g_first) g_address <= byte_data;
    else if (g_count == 9'd1) begin
      g_coils <= byte_data == 8'h05 || byte_data == 8'h0F;
      g_parameter <= byte_data == 8'h06 || byte_data == 8'h10;
    end
  end
  if (short_reached && g_count != 9'd0 && !g_good && !g_forgotten) begin
    g_good <= g_whole;
    g_forgotten <= !g_whole && strict_t15;
  end
  if (long_reached || g_undriven || deaf || rst) begin
    g_count <= 9'd0;
    g_good <= 1'b0;
    g_early <= 1'b0;
    g_forgotten <= 1'b0;
    g_lost <= g_undriven || deaf || rst;
  end
  if (rst) g_character <= 1'b0;
end

// ---- the memory
reg [8:0] g_index = 9'd0;  // index of the pending character in its frame
reg g_held = 1'b0;  // the firmware has a request that was not revoked
reg g_held_bank = 1'b0;  // bank of that request

always @(posedge clk) begin
  if (write_ready || g_index >= 9'd32) g_pending <= 1'b0;
  if (g_take) begin
    g_pending <= 1'b1;
    g_index   <= g_first ? 9'd0 : g_count;
  end
  if (write_valid && write_ready) g_bank <= write_addr[5];
  if (rst) g_pending <= 1'b0;
end

// ---- expected outputs, one clock after their causes
reg g_candidate = 1'b0;
reg g_commit = 1'b0;
reg g_revoke = 1'b0;
reg g_rst = 1'b1;
reg [7:0] g_length = 8'd0;
reg g_broadcast = 1'b0;
reg g_writes_coils = 1'b0;
reg g_writes_parameter = 1'b0;
wire g_raise = g_raise_early;
always @(posedge clk) begin
  g_rst <= rst;
  g_candidate <= g_raise && !rst;
  g_commit <= long_reached && g_good && g_ours && !rst;
  g_revoke <= g_continued && g_ours && !rst;
  if (g_raise) begin
    g_length <= g_count[7:0];
    g_broadcast <= g_address == 8'd0;
    g_writes_coils <= g_coils;
    g_writes_parameter <= g_parameter;
    g_held_bank <= g_bank;
    g_held <= 1'b1;
  end
  if ((g_continued && g_ours) || g_resumed) g_held <= 1'b0;
  if (rst) g_held <= 1'b0;
end

reg g_open = 1'b0;  // a candidate is neither committed nor revoked, as in commit_gate
reg g_over = 1'b0;  // a request was committed, and no character began since
always @(posedge clk) begin
  g_open <= candidate ? !commit && !g_resumed : g_open && !commit && !revoke && !g_resumed;
  if (commit) g_over <= 1'b1;
  else if (start_seen) g_over <= 1'b0;
  if (rst) g_open <= 1'b0;
  if (rst) g_over <= 1'b0;
end

wire g_ended = long_reached && g_count != 9'd0 && !g_good && !g_early;
wire [2:0] g_counted = {2'd0, count_crc} + {2'd0, count_parity} + {2'd0, count_framing} + {2'd0, count_t15} +
    {2'd0, count_overrun};

`ifdef FLIPPED
// ---- one flipped bit of the receiver (formal/flips.py): the gate acts on a candidate and its commit, never on one alone
always @(posedge clk) if (g_past) f_accepts : assert (!(commit && (candidate || g_open)) || g_commit);
// SAFE-1: what it lets the gate do is what its own characters said.
always @(posedge clk)
  if (g_past)
    f_rights : assert (!(commit && (candidate || g_open)) ||
        (frame_broadcast == g_broadcast && frame_writes_coils == g_writes_coils));
always @(posedge clk) if (g_past) c_accepted : cover (commit && (candidate || g_open));
always @(posedge clk) if (g_past) c_spoilt : cover (count_crc || count_parity || revoke);
`endif

always @(posedge clk) begin
  if (g_past) begin
    // FRAME-4, FRAME-5: candidate after half a character of silence if and only if the frame is good and for this
    // card.
    a_candidate : assert (candidate == g_candidate);
    // FRAME-6: committed at t3.5 if and only if no character came in between.
    a_commit : assert (commit == g_commit);
    a_revoke : assert (revoke == g_revoke);
    a_not_both : assert (!revoke || !(commit || candidate));
    // SAFE-1: no commit without its candidate, after a revoke, or twice.
    a_no_commit_alone : assert (!commit || g_open || candidate);
    a_no_revoke_alone : assert (!revoke || g_open);
    a_commit_later : assert (!commit || !candidate);
    // commit_gate relies on this: a newer request has begun with a start bit.
    a_begun : assert (!candidate || !g_over);
    // FRAME-5: full length, address and bank, valid from the candidate to the next one.
    a_length : assert (frame_length == g_length);
    a_broadcast : assert (frame_broadcast == g_broadcast);
    // SAFE-1
    a_writes_coils : assert (frame_writes_coils == g_writes_coils);
    a_writes_parameter : assert (frame_writes_parameter == g_writes_parameter);
    a_bank : assert (!g_held || frame_bank == g_held_bank);
    // The CRC covers exactly this frame's characters.
    a_summed : assert (!(g_raise || g_good) || g_summed == g_count);
    // Each of the first 32 characters is written once, at its address; no other is written.
    a_write : assert (write_valid == (g_pending && g_index < 9'd32));
    a_place : assert (!write_valid || write_addr[4:0] == g_index[4:0]);
    // A frame is written to one bank only, and never to the bank of the request that the firmware has.
    a_one_bank : assert (!write_valid || g_index == 9'd0 || write_addr[5] == g_bank);
    a_not_held : assert (!write_valid || !g_held || write_addr[5] != g_held_bank);
    // A discarded frame is counted once, under the first of its faults.
    a_framing : assert (count_framing == ((g_undriven && !count_t15) || (g_ended && g_framing)));
    a_parity : assert (count_parity == (g_ended && !g_framing && g_parity));
    a_overrun : assert (count_overrun == (g_ended && !g_framing && !g_parity && g_count == 9'd257));
    a_crc : assert (count_crc == (g_ended && !g_framing && !g_parity && g_count != 9'd257));
    a_t15 : assert (count_t15 == ((byte_valid && g_forgotten) || (g_continued && strict_t15 && !g_ours)));
    a_foreign : assert (count_foreign == (long_reached && g_good && !g_ours && !g_continued));
    a_one_cause : assert (g_counted <= 3'd1);
    a_no_fault : assert (!fault);
    // break_filter relies on this: the frame is good up to its last character and none has begun since, or all is dropped.
    a_may_break : assert (may_break == (break_tolerant &&
        (g_lost || g_good || g_early || (g_unjudged && g_whole && !g_character && !g_pending))));
    a_good_not_counted : assert (!(candidate || commit || count_foreign) || g_counted == 3'd0);
  end
end

// ---- helpers for induction
always @(posedge clk) begin
  if (g_past) begin
    i_known : assert (state == S_WAIT || state == S_IDLE || state == S_RECEIVE || state == S_HOLD || state == S_SUSPECT ||
        state == S_EARLY);
    i_halves : assert (\bank_i.opposite == !\bank_i.held );
    i_wait : assert ((state == S_WAIT) == g_lost);
    i_idle : assert ((state == S_IDLE) == (!g_lost && g_count == 9'd0));
    i_hold : assert ((state == S_HOLD) == g_good);
    i_early : assert ((state == S_EARLY) == g_early);
    i_no_character : assert (!(g_good || g_early) || !g_character);
    i_early_whole : assert (!g_early || (g_whole && g_ours && !g_pending));
    i_suspect : assert ((state == S_SUSPECT) == g_forgotten);
    i_frame : assert (!(g_good || g_early || g_forgotten) || g_count != 9'd0);
    i_either : assert ({1'b0, g_good} + {1'b0, g_early} + {1'b0, g_forgotten} <= 2'd1 && !(g_lost && g_count != 9'd0));
    i_strict : assert (strict_t15 || !g_forgotten);
    i_count : assert (g_count == 9'd0 || g_count == (overrun ? 9'd257 : length + {8'd0, storing}));
    i_length : assert (g_count == 9'd0 || length <= 9'd256);
    i_overrun : assert (g_count == 9'd0 || !overrun || length == 9'd256);
    i_faults : assert (g_count == 9'd0 || (parity_bad == g_parity && framing_bad == g_framing));
    i_ours : assert (g_count == 9'd0 ||
        unit == (g_address == 8'd0 ? TO_ALL : g_address == own_address ? TO_US : TO_OTHERS));
    i_begun : assert (g_count == 9'd0 || begun_bank == (frame_bank ^ ((g_good || g_early) && g_ours)));
    i_function : assert (g_count == 9'd0 || function_next == (g_count == 9'd1));
    i_coils : assert (g_count < 9'd2 || (writes_coils == g_coils && writes_parameter == g_parameter));
    i_storing : assert (storing == g_pending && (!storing || kept == (g_index < 9'd32)));
    i_pending : assert (!storing || g_index >= 9'd32 || g_index == length);
    i_place : assert (g_count == 9'd0 || !storing || g_index == (overrun ? 9'd257 : length));
    i_was_good : assert (!g_good || (g_count >= 9'd4 && g_count <= 9'd256 && !g_pending && !g_parity && !g_framing));
    // All bytes of a frame other than the held one are in the other bank.
    i_bank : assert (g_count == 9'd0 || ((g_good || g_early) && g_ours) || (g_count == 9'd1 && g_pending) ||
        g_bank == !frame_bank);
    i_good_held : assert (!((g_good || g_early) && g_ours) || (g_held && g_bank == frame_bank));
    i_open : assert (!((g_good || g_early) && g_ours) || g_open || candidate);
    i_held : assert (!g_held || frame_bank == g_held_bank);
    i_summed : assert (g_count == 9'd0 || g_first || g_summed == g_count);
    i_new : assert (!g_character || !g_first || g_summed == 9'd0);
`ifdef BREAKS
    i_withheld : assert (!g_withheld || (!g_character && (!g_first || g_summed == 9'd0)));
`endif
    i_line : assert (begun == g_character);
    i_over : assert (!g_over || (g_count == 9'd0 && !g_character));
  end
end

// ---- covers
reg g_has_resumed = 1'b0;
always @(posedge clk) if (g_resumed) g_has_resumed <= 1'b1;
always @(posedge clk) begin
  if (g_past && !rst) begin
    // A frame whose first characters are a good frame, too.
    c_resumed : cover (commit && frame_length == 8'd5 && g_has_resumed);
    c_broadcast : cover (commit && frame_broadcast);
    c_revoked : cover (revoke);
    c_thrown_away : cover (count_t15);
    c_foreign : cover (count_foreign);
    c_other_bank : cover (write_valid && g_held && write_addr[5] != g_held_bank && $past(commit, 3));
    c_grown : cover (commit && frame_length == 8'd5 && $past(revoke, 4));
  end
end
