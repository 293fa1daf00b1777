// SPDX-License-Identifier: Apache-2.0
// A telegram is STX, LGE and then exactly the bytes of the frame memory, each once and in order (FC-1). Only a start
// begins one (SAFE-1).
//
// Assumed of the neighbours:
// - The UART is ready until it gets a byte, and busy from then to its last stop bit.
// - The length is steady while a telegram is sent (mailbox_regs).
// - The memory answers one clock after it was ready.

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

reg [5:0] g_bytes = 6'd0;  // bytes that the UART took
reg [5:0] g_reads = 6'd0;
reg [7:0] g_answer = 8'd0;  // the memory's answer to the last read
reg g_answers = 1'b0;
reg g_started = 1'b0;
reg g_sending = 1'b0;
reg g_rst = 1'b1;
reg g_offered = 1'b0;  // the UART was ready, and no byte was offered
reg g_took = 1'b0;
reg [4:0] g_length = 5'd6;
reg [7:0] g_adr = 8'd0;
reg g_adr_known = 1'b0;

wire g_take = send_valid && send_ready;
// Upper byte of PCD1: before its lower byte, PCD2 and the BCC.
wire g_control_byte = g_bytes >= 6'd2 && g_bytes + 6'd3 == {1'b0, length};
// Its lower byte.
wire g_run_byte = g_bytes >= 6'd2 && g_bytes + 6'd2 == {1'b0, length};
wire g_read = read_valid && read_ready;

always @(posedge clk) begin
  g_rst <= rst;
  g_started <= start && !sending && !rst;
  g_sending <= sending;
  g_offered <= send_ready && !send_valid;
  g_took <= g_take;
  g_length <= length;
  g_answers <= g_read;
  if (g_answers) begin
    g_answer <= read_data;
    if (g_reads == 6'd1 && sending) begin
      g_adr <= read_data;
      g_adr_known <= 1'b1;
    end
  end
  if (!sending) begin
    g_bytes <= 6'd0;
    g_reads <= 6'd0;
  end else begin
    if (g_take) g_bytes <= g_bytes + 6'd1;
    if (g_read) g_reads <= g_reads + 6'd1;
  end
  if (rst) begin
    g_bytes <= 6'd0;
    g_reads <= 6'd0;
    g_adr_known <= 1'b0;
  end
end

always @* begin
  assume (length >= 5'd6 && length <= 5'd30);
  if (g_past) begin
    assume (!g_offered || send_ready || g_rst);
    assume (!g_took || line_busy);
    assume (!sending || !g_sending || length == g_length);
  end
end

always @(posedge clk) begin
  if (g_past && !rst) begin
    // SAFE-1: only a start begins a telegram.
    a_started : assert (!sending || g_sending || g_started);
    a_stx : assert (!g_take || g_bytes != 6'd0 || send_data == 8'h02);
    a_lge : assert (!g_take || g_bytes != 6'd1 || send_data == {3'd0, length});
    // Every later byte is the memory's answer of the clock before, for the next address.
    a_data : assert (!g_take || g_bytes < 6'd2 || (g_answers && g_reads == g_bytes - 6'd1 &&
        send_data == (g_control_byte && !control ? read_data & 8'hFB :
            g_run_byte && stop ? read_data & 8'hBF : read_data)));
    // SAFE-1: bit 10 of the control word is 0 unless this telegram may command the drive.
    a_control : assert (!g_take || !g_control_byte || control || !send_data[2]);
    // SAFE-7: bit 6, the start, is 0 in the stop.
    a_stop : assert (!g_take || !g_run_byte || !stop || !send_data[6]);
    a_address : assert (!g_read || read_addr == g_reads[4:0]);
    // No byte is lost between memory and UART.
    a_none_lost : assert (!g_answers || !sending || g_rst || g_take);
    // Exactly LGE bytes follow (FC-1).
    a_no_more : assert (!g_take || g_bytes < {1'b0, length} + 6'd2);
    a_no_less : assert (!sent || g_bytes == {1'b0, length} + 6'd2);
    // The line is held until the last stop bit is over (SAFE-2).
    a_kept : assert (!sent || !line_busy);
    a_asked : assert (!send_valid || line_request);
    // FC-2
    a_adr : assert (!g_adr_known || adr == g_adr);
  end
end

// ---- helpers for induction
always @(posedge clk) begin
  if (g_past) begin
    i_known : assert (state <= S_DRAIN);
    i_begun : assert (state == S_IDLE || begun);
    i_idle : assert (state != S_IDLE || (g_bytes == 6'd0 || g_sending));
    i_stx : assert (state != S_STX || (g_bytes == 6'd0 && g_reads == 6'd0 && index == 5'd0));
    i_lge : assert (state != S_LGE || (g_bytes == 6'd1 && g_reads == 6'd0 && index == 5'd0));
    i_fetch : assert (state != S_FETCH || (g_reads == {1'b0, index} && g_bytes == g_reads + 6'd2 && index < length));
    i_send : assert (state != S_SEND || (g_answers && send_ready && g_reads == {1'b0, index} &&
        g_bytes == g_reads + 6'd1 && index <= length && index != 5'd0));
    i_drain : assert (state != S_DRAIN || g_bytes == {1'b0, length} + 6'd2);
    i_answers : assert (!g_answers || state == S_SEND || g_rst);
  end
end

// ---- covers
always @(posedge clk) begin
  c_sent : cover (g_past && sent && length == 5'd6);
end

`ifdef FLIPPED
// ---- one flipped bit of the sender (formal/flips.py): the two bytes that the promises are about do leave
always @(posedge clk) begin
  c_commands : cover (g_past && g_take && g_control_byte && control && send_data[2]);
  c_not_stopped : cover (g_past && g_take && g_run_byte && !stop && send_data[6]);
end
`endif
