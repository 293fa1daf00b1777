// SPDX-License-Identifier: Apache-2.0
// Receives Modbus RTU frames: finds their ends by silence and checks them.
//
//   state    the line            a character      half a character  t1.5          t3.5
//   WAIT     rubbish             ignored                                          IDLE
//   IDLE     silence             RECEIVE
//   RECEIVE  in a frame          RECEIVE          ours: EARLY       good: HOLD    IDLE
//                                                                   bad: SUSPECT
//   EARLY    the candidate       RECEIVE                            HOLD          IDLE
//   HOLD     good until t1.5     WAIT, revoked                                    IDLE, committed
//   SUSPECT  bad at t1.5         RECEIVE                                          IDLE
//
// The character that leaves IDLE or SUSPECT is an address (FRAME-1, FRAME-2). A frame is good if CRC,
// parity and stop bits are right and it has 4 to 256 bytes; ours, if it is also for this card or for
// all. It becomes the candidate as it leaves RECEIVE. In EARLY and HOLD the start bit of a character
// counts already (FRAME-6, FRAME-3). Without EARLY a frame that ends in 00 would be a candidate twice.
// strict_t15 = 0: a frame grows until t3.5, so there is no SUSPECT, and HOLD is left to RECEIVE.
// break_tolerant = 1: a character without a stop bit ends its frame in WAIT and counts at once.
// Both may change in WAIT only.
// may_break: level, a break may follow: the frame is good and no other character has begun, or all is
// dropped. line_start: start_seen, but not delayed by break_filter, in time for the CRC.
// The first 32 bytes go to the frame memory; frame_length is the full length, modulo 256 (FRAME-5).
// Two banks alternate: the bank of the newest candidate is written again only when a newer one exists
// or a start bit has ended this one. So the firmware never reads a mixture of two frames.
//
// Each dropped frame counts one event, the first that applies of framing, parity, length and CRC. A
// character between t1.5 and t3.5 counts count_t15 instead, or revokes a candidate. count_foreign: a
// good frame for another unit. frame_writes_coils: function 05 or 15, the only ones that may command
// the drive. fault: one clock, the halves of frame_bank disagree; the newest frame must be dropped.
// Clock domain: clk. Rules: FRAME-1 ... FRAME-6, SAFE-1, SAFE-4.
`default_nettype none

module rtu_rx (
    input  wire       clk,
    input  wire       rst,
    // stream in
    input  wire       byte_valid,
    input  wire [7:0] byte_data,
    input  wire       byte_parity_error,
    input  wire       byte_framing_error,
    input  wire       line_start,
    input  wire       start_seen,
    input  wire       half_reached,
    input  wire       short_reached,
    input  wire       long_reached,
    // frame memory, 32 bytes a bank
    output wire       write_valid,
    input  wire       write_ready,
    output wire [5:0] write_addr,
    // check
    output wire       crc_clear,
    input  wire       crc_good,
    // configuration
    input  wire       strict_t15,
    input  wire       break_tolerant,
    input  wire       deaf,
    input  wire [7:0] own_address,
    // status
    output reg        candidate,
    output reg        commit,
    output reg        revoke,
    output reg  [7:0] frame_length,
    output reg        frame_broadcast,
    output reg        frame_writes_coils,
    output reg        frame_writes_parameter,
    output wire       frame_bank,
    output wire       may_break,
    output wire       count_crc,
    output wire       count_parity,
    output wire       count_framing,
    output wire       count_t15,
    output wire       count_overrun,
    output wire       count_foreign,
    output wire       fault
);

  // docs/hardening.md, State codes of the receiver (SAFE-4)
  localparam [3:0] S_WAIT = 4'b0000;  // ignore all characters until t3.5 of silence
  localparam [3:0] S_IDLE = 4'b0011;  // silence: the next character starts a frame
  localparam [3:0] S_RECEIVE = 4'b0101;  // inside a frame
  localparam [3:0] S_EARLY = 4'b1010;  // the candidate, before t1.5
  localparam [3:0] S_HOLD = 4'b0110;  // good at t1.5, ends at t3.5
  localparam [3:0] S_SUSPECT = 4'b1001;  // not good at t1.5 and discarded
  // docs/hardening.md, Unit codes (SAFE-4)
  localparam [2:0] TO_US = 3'b011;
  localparam [2:0] TO_ALL = 3'b101;
  localparam [2:0] TO_OTHERS = 3'b110;

  reg [3:0] next_state;
  wire [3:0] state;
  reg [8:0] length = 9'd0;
  reg storing = 1'b0;
  (* fsm_encoding = "none", syn_preserve = 1 *) reg [2:0] unit = TO_OTHERS;  // as in sparse_state
  reg begun_bank = 1'b0;
  reg function_next = 1'b0;
  reg writes_coils = 1'b0;
  reg writes_parameter = 1'b0;
  reg parity_bad = 1'b0;
  reg framing_bad = 1'b0;
  reg overrun = 1'b0;
  reg begun = 1'b0;  // a character is on the line

  wire clean = !parity_bad && !framing_bad && !overrun;
  wire good = crc_good && clean && length[8:2] != 7'd0;
  wire mine = unit == TO_US || unit == TO_ALL;
  // docs/hardening.md, Frame bank (SAFE-4)
  wire in_place = frame_bank == begun_bank;
  wire first = state == S_IDLE || state == S_SUSPECT;
  wire in_frame = state == S_RECEIVE || state == S_EARLY;
  wire accept = byte_valid && (first || in_frame || (state == S_HOLD && !strict_t15));
  wire kept = length[8:5] == 4'd0;
  wire stored = storing && (write_ready || !kept);

  assign crc_clear   = first && line_start;
  assign write_valid = storing && kept;
  assign write_addr  = {!frame_bank, length[4:0]};

  // A character without a stop bit may be a line that nobody drives. Its low is no silence, so the
  // frame ends here; from the next high on each low is a break, and t3.5 comes.
  wire undriven = break_tolerant && byte_valid && byte_framing_error && state != S_WAIT;

  wire received = state == S_RECEIVE && good && !begun && !storing;
  wire held = state == S_EARLY || state == S_HOLD;
  assign may_break = break_tolerant && (received || held || state == S_WAIT);

  wire judged = state == S_RECEIVE && (half_reached || short_reached);
  wire raise = judged && good && mine && in_place;
  // docs/hardening.md, Revoke twice (SAFE-4)
  wire continued = start_seen || byte_valid;
  wire spoilt = state == S_HOLD && continued;
  wire dropped = spoilt && strict_t15;
  wire resumed = state == S_EARLY && continued;
  wire next_bank = raise || (spoilt && mine) || resumed;

  wire ended_bad = long_reached && (state == S_RECEIVE || state == S_SUSPECT);
  assign count_framing = (undriven && !count_t15) || (ended_bad && framing_bad);
  assign count_parity = ended_bad && parity_bad && !framing_bad;
  assign count_overrun = ended_bad && overrun && !parity_bad && !framing_bad;
  assign count_crc = ended_bad && clean;
  assign count_t15 = (byte_valid && state == S_SUSPECT) || (dropped && !mine);
  assign count_foreign = state == S_HOLD && long_reached && !spoilt && !mine;

  always @* begin
    next_state = state;
    case (state)
      S_WAIT: if (long_reached) next_state = S_IDLE;
      S_RECEIVE:
      if (short_reached && good) next_state = S_HOLD;
      else if (short_reached && strict_t15) next_state = S_SUSPECT;
      else if (long_reached) next_state = S_IDLE;
      else if (raise) next_state = S_EARLY;
      S_EARLY:
      if (resumed) next_state = S_RECEIVE;
      else if (short_reached) next_state = S_HOLD;
      else if (long_reached) next_state = S_IDLE;
      S_HOLD:
      if (dropped) next_state = S_WAIT;
      else if (spoilt) next_state = S_RECEIVE;
      else if (long_reached) next_state = S_IDLE;
      S_SUSPECT:
      if (byte_valid) next_state = S_RECEIVE;
      else if (long_reached) next_state = S_IDLE;
      S_IDLE: if (byte_valid) next_state = S_RECEIVE;
      default: next_state = S_WAIT;
    endcase
    if (deaf || undriven) next_state = S_WAIT;
  end

  sparse_state #(
      .WIDTH(4),
      .START(S_WAIT)
  ) state_i (
      .clk  (clk),
      .rst  (rst),
      .next (next_state),
      // status
      .state(state)
  );

  initial {candidate, commit, revoke, frame_length} = 11'd0;
  initial {frame_broadcast, frame_writes_coils, frame_writes_parameter} = 3'd0;

  // A flip between commit and firmware would show an older frame. It ends in bank 0 and reports
  // a fault, which restarts the firmware. docs/hardening.md, Frame bank (SAFE-4)
  guarded_bit bank_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (next_bank || fault),
      .data (next_bank && !frame_bank),
      // status
      .value(frame_bank),
      .fault(fault)
  );

  always @(posedge clk) begin
    candidate <= raise;
    commit <= state == S_HOLD && long_reached && mine && !in_place;
    revoke <= spoilt && mine;

    if (start_seen) begun <= 1'b1;
    else if (byte_valid) begun <= 1'b0;

    if (stored) begin
      storing <= 1'b0;
      if (length[8]) overrun <= 1'b1;
      else length <= length + 9'd1;
    end
    if (accept) begin
      storing <= 1'b1;
      function_next <= first;
      if (function_next) begin
        writes_coils <= byte_data == 8'd5 || byte_data == 8'd15;  // one coil, several
        writes_parameter <= byte_data == 8'd6 || byte_data == 8'd16;  // one register, several
      end
      if (first) begin
        length <= 9'd0;
        overrun <= 1'b0;
        unit <= byte_data == 8'd0 ? TO_ALL : byte_data == own_address ? TO_US : TO_OTHERS;
        begun_bank <= frame_bank;
      end
      parity_bad  <= byte_parity_error || (parity_bad && !first);
      framing_bad <= byte_framing_error || (framing_bad && !first);
    end
    // A 00 byte appended to a good frame leaves the CRC remainder good, so a flipped state could
    // accept a revoked frame again. docs/hardening.md, Revoke twice (SAFE-4)
    if (dropped) unit <= TO_OTHERS;

    // Latched, because the next frame may begin while the firmware still reads this one.
    // A revoked candidate returns its bank and may continue to grow in it.
    if (raise) begin
      frame_length <= length[7:0];
      frame_broadcast <= unit == TO_ALL;
      frame_writes_coils <= writes_coils;
      frame_writes_parameter <= writes_parameter;
    end

    if (rst) {storing, begun, candidate, commit, revoke} <= 5'd0;
  end

endmodule

`default_nettype wire
