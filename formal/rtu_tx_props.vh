// SPDX-License-Identifier: Apache-2.0
// A reply is exactly the bytes of the frame memory, each once and in order, then two CRC bytes (FRAME-4). Only a start
// begins one. Damage in the memory inverts the CRC of the reply that is sent (SAFE-4).
//
// Assumed of the neighbours: the UART is ready until it gets a byte and busy from then to its last stop bit, the memory
// answers one clock after it was ready. Task `prove` only: length is steady while a reply is sent and is not 0
// (commit_gate). Task `prove_any_length`: at any length, no reply is longer than the memory's 32 bytes (SAFE-2).

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

reg [5:0] g_bytes = 6'd0;  // bytes that the UART took
reg [5:0] g_reads = 6'd0;
reg g_answers = 1'b0;
reg g_started = 1'b0;
reg g_sending = 1'b0;
reg g_rst = 1'b1;
reg g_offered = 1'b0;  // the UART was ready, and no byte was offered
reg g_took = 1'b0;
reg g_was_busy = 1'b0;
reg [4:0] g_length = 5'd1;
reg g_damaged = 1'b0;  // while this reply is sent

wire g_take = send_valid && send_ready;
wire g_read = read_valid && read_ready;

always @(posedge clk) begin
  g_rst <= rst;
  g_started <= start && !sending && !rst;
  g_sending <= sending;
  g_offered <= send_ready && !send_valid;
  g_took <= g_take;
  g_was_busy <= line_busy;
  g_length <= length;
  g_answers <= g_read;
  g_damaged <= sending && (g_damaged || read_damaged);
  if (!sending || rst) begin
    g_bytes <= 6'd0;
    g_reads <= 6'd0;
  end else begin
    if (g_take) g_bytes <= g_bytes + 6'd1;
    if (g_read) g_reads <= g_reads + 6'd1;
  end
end

always @* begin
  if (g_past) begin
    assume (!g_offered || send_ready || g_rst);
    assume (!g_took || line_busy);
  end
`ifdef STABLE_LENGTH
  assume (length != 5'd0);
  assume (!(g_past && sending && g_sending) || length == g_length);
`endif
end

always @(posedge clk) begin
  if (g_past && !rst) begin
    a_started : assert (!sending || g_sending || g_started);
    // SAFE-2: never more than the whole memory and two CRC bytes.
    a_longest : assert (g_bytes <= 6'd34 && (!g_take || g_bytes < 6'd34));
    // The line is held until the last stop bit is over (SAFE-2).
    a_kept : assert (!g_sending || sending || g_rst || !g_was_busy);
    // SAFE-4: after damage each bit of the CRC is inverted, to the end of the reply.
    a_spoils : assert (check_bit == (crc_bit ^ g_damaged));
    a_asked : assert (!send_valid || line_request);
`ifdef STABLE_LENGTH
    // The UART takes the memory's answer of the clock before, for the next address.
    a_data : assert (!g_take || g_bytes >= {1'b0, length} || (g_answers && g_reads == g_bytes + 6'd1));
    a_address : assert (!g_read || read_addr == g_reads[4:0]);
    a_none_lost : assert (!g_answers || !sending || g_rst || g_take);
    // Two CRC bytes follow. The UART needs the bits of a byte while it is on the line, after it took the byte.
    a_no_more : assert (!g_take || g_bytes < {1'b0, length} + 6'd2);
    a_check : assert (send_check == (g_bytes > {1'b0, length} && sending));
    a_all_of_it : assert (!g_sending || sending || g_rst || $past(g_bytes) == {1'b0, g_length} + 6'd2);
`endif
  end
end

// ---- helpers for induction
always @(posedge clk) begin
  if (g_past) begin
    i_known : assert (state <= S_DRAIN);
    i_spoilt : assert (spoilt == g_damaged);
    i_idle : assert (state != S_IDLE || g_bytes == 6'd0 || g_sending);
    i_fetch : assert (state != S_FETCH || (g_reads == {1'b0, index} && g_bytes == g_reads));
    // After the 32nd byte the index is 0 again.
    i_send : assert (state != S_SEND || (g_answers && send_ready && g_bytes == g_reads - 6'd1 &&
        g_reads == {index == 5'd0, index}));
    i_sent : assert (state == S_IDLE || g_bytes <= 6'd32 + (state == S_CRC_HIGH) + {state == S_DRAIN, 1'b0});
`ifdef STABLE_LENGTH
    i_length : assert ((state != S_FETCH || index < length) && (state != S_SEND || (index <= length && index != 5'd0)));
    i_low : assert (state != S_CRC_LOW || g_bytes == {1'b0, length});
    i_high : assert (state != S_CRC_HIGH || g_bytes == {1'b0, length} + 6'd1);
    i_drain : assert (state != S_DRAIN || g_bytes == {1'b0, length} + 6'd2);
`endif
    i_answers : assert (!g_answers || state == S_SEND || g_rst);
  end
end

// ---- covers
always @(posedge clk) c_sent : cover (g_past && g_sending && !sending && !g_rst && g_length == 5'd3);

`ifdef FLIPPED
// ---- one flipped bit of the sender (formal/flips.py): a reply does begin in these clocks
always @(posedge clk) c_begins : cover (g_past && sending && !g_sending);
`endif
