// SPDX-License-Identifier: Apache-2.0
// Every access is answered, each line reaches its own frames only, and every write to the telegram is reported
// (FRAME-5, SAFE-1). The soft core reaches memory by every address that is not a register, and nothing while it is
// in reset, whatever its bus shows (SAFE-5).
//
// Assumed: the soft core holds an access until ready; a line never reads and writes at once; the registers' data is 0
// in the clock after any other than their reading (proved for mailbox).

reg g_past = 1'b0;
always @(posedge clk) g_past <= 1'b1;
initial assume (rst);

reg g_waiting = 1'b0;  // a soft core access was not answered in the clock before
reg [31:0] g_addr = 32'd0;
reg [31:0] g_wdata = 32'd0;
reg [3:0] g_wstrb = 4'd0;
reg g_served = 1'b0;  // memory or registers took the soft core's access in the clock before
reg g_rst = 1'b1;
reg g_line_read = 1'b0;  // a line read the memory in the clock before
reg g_regs_read = 1'b0;  // so did the soft core a register

wire g_modbus_asks = modbus_read_valid || modbus_write_valid;
wire g_drive_asks = drive_read_valid || drive_write_valid;
wire g_to_telegram = ram_enable && ram_wstrb[0] &&
    ram_word[5:0] >= TELEGRAM && ram_word[WORD_BITS-1:6] == LAST[WORD_BITS-1:6];
wire g_core_asks = core_valid && !core_ready && !rst;
wire g_to_place = core_addr[31] && !core_addr[10];
wire g_core_has_ram = ram_enable && !g_modbus_asks && !g_drive_asks;

always @(posedge clk) begin
  g_rst <= rst;
  g_line_read <= modbus_read_ready || drive_read_ready;
  g_regs_read <= regs_valid && !regs_write;
  g_waiting <= core_valid && !core_ready && !rst;
  g_addr <= core_addr;
  g_wdata <= core_wdata;
  g_wstrb <= core_wstrb;
  g_served <= regs_valid || g_core_has_ram;
end

always @* begin
  assume (!(modbus_read_valid && modbus_write_valid));
  assume (!(drive_read_valid && drive_write_valid));
  assume (!g_past || g_regs_read || regs_rdata == 32'd0);
  if (g_past && g_waiting) begin
    assume (core_valid);
    assume (core_addr == g_addr && core_wdata == g_wdata && core_wstrb == g_wstrb);
  end
end

// From the first clock on, with any contents of the registers.
always @* begin
  a_reset : assert (!rst || !(regs_valid || g_core_has_ram || telegram_touched));
  a_reset_writes : assert (!rst || ram_wstrb == 4'b0000 || modbus_write_ready || drive_write_ready);
end

always @(posedge clk) begin
  if (g_past) begin
    // Each access of the soft core is answered once, one clock after it was served.
    a_answer : assert (core_ready == (g_served && !g_rst));
    a_once : assert (!core_ready || !(regs_valid || g_core_has_ram));
    a_served : assert (!core_valid || rst || core_ready || g_modbus_asks || g_drive_asks || regs_valid || ram_enable);
    a_one_place : assert (!regs_valid || !g_core_has_ram);
    // Both data are ORed, so no line reads in the clock of a register's read.
    a_one_reads : assert (!regs_valid || regs_write || !ram_enable);
    // Registers lie from 80000000h on, unless bit 10 is set; everything else is memory.
    // A line keeps the soft core from memory and from a register's read, never from a register's write.
    a_place : assert (regs_valid ==
        (g_core_asks && g_to_place && (core_wstrb != 4'd0 || (!g_modbus_asks && !g_drive_asks))));
    // An access has the soft core's address, data and strobes; the last addresses are the frame memory.
    a_core_word : assert (!g_core_has_ram || core_addr >= MEMORY_BYTES || ram_word == core_addr[WORD_BITS+1:2]);
    a_core_frames : assert (!g_core_has_ram || core_addr < 32'hFFFFFF00 ||
        ram_word == {LAST[WORD_BITS-1:6], core_addr[7:2]});
    a_core_data : assert (!g_core_has_ram || (ram_wdata == core_wdata && ram_wstrb[3:1] == core_wstrb[3:1]));
    a_core_lane_0 : assert (!g_core_has_ram || ram_wstrb[0] == core_wstrb[0] || telegram_sending);
    a_regs : assert (!regs_valid || (regs_word == core_addr[4:2] && regs_write == (core_wstrb != 4'd0)));
    // The network line never waits; the drive line waits for the network line only (FRAME-5).
    a_modbus : assert (!g_modbus_asks || (modbus_read_ready || modbus_write_ready));
    a_drive : assert (!g_drive_asks || g_modbus_asks || drive_read_ready || drive_write_ready);
    a_drive_waits : assert (!g_modbus_asks || !(drive_read_ready || drive_write_ready));
    // A line writes only to its own byte lane of the frame memory.
    a_in_frames : assert (!(g_modbus_asks || g_drive_asks) ||
        (ram_enable && ram_word[WORD_BITS-1:6] == LAST[WORD_BITS-1:6]));
    a_modbus_lane : assert (!modbus_write_ready || (ram_wstrb == 4'b0010 && ram_wdata[15:8] == modbus_write_data &&
        ram_word[5:0] == modbus_write_addr));
    a_drive_lane : assert (!drive_write_ready || (ram_wstrb == 4'b0100 && ram_wdata[23:16] == drive_write_data &&
        ram_word[4:0] == drive_write_addr));
    a_reads_write_nothing : assert (!(modbus_read_ready || drive_read_ready) || ram_wstrb == 4'b0000);
    a_reply : assert (!modbus_read_ready || ram_word[5:0] == {REPLY[5], modbus_read_addr});
    a_telegram : assert (!drive_read_ready || ram_word[5:0] == {TELEGRAM[5], drive_read_addr});
    a_not_asked : assert (modbus_write_ready <= modbus_write_valid && modbus_read_ready <= modbus_read_valid &&
        drive_write_ready <= drive_write_valid && drive_read_ready <= drive_read_valid);
    // What a line gets is the memory's answer, with nothing of the registers in it; so does the soft core.
    a_read : assert (!g_line_read || read_data == ram_rdata[7:0]);
    a_core_read : assert (!core_ready || g_regs_read || core_rdata == ram_rdata);
    // SAFE-1: a write to the telegram is reported or dropped, by whatever address it comes.
    a_touched : assert (!g_to_telegram || telegram_touched);
    a_not_while_sending : assert (!telegram_sending || !g_to_telegram);
    // Reported from the first clock on, also if a line is served first.
    a_touched_only_then : assert (!telegram_touched || g_to_telegram ||
        (g_core_asks && !g_to_place && core_wstrb[0] && (g_modbus_asks || g_drive_asks)));
    a_touched_stays : assert (!$past(telegram_touched && !g_to_telegram && !rst) || telegram_touched || rst || telegram_sending);
  end
end

// ---- covers
always @(posedge clk) begin
  c_touched : cover (g_past && telegram_touched && core_addr[31]);
  c_dropped : cover (g_past && telegram_sending && core_ready && g_wstrb == 4'b0001 && g_addr == 32'hFFFFFF80);
  c_waited : cover (g_past && core_ready && $past(g_waiting, 2));
end
