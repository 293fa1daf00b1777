// SPDX-License-Identifier: Apache-2.0
// commit_gate equals commit_gate_before: every output in every clock, from power-up on, for any inputs.
//
// Nothing is assumed but that power-up values are those of the bitstream. The helpers state that each flip-flop
// of the one gate has the value of its namesake in the other, and that no pair disagrees.

(* hierconn *) wire [3:0] \before_i.ticket ;
(* hierconn *) wire [3:0] \now_i.request_i.ticket ;
(* hierconn *) wire \before_i.is_candidate ;
(* hierconn *) wire \now_i.request_i.is_candidate ;
(* hierconn *) wire \before_i.committed ;
(* hierconn *) wire \now_i.request_i.committed_i.held ;
(* hierconn *) wire \before_i.uncommitted ;
(* hierconn *) wire \now_i.request_i.committed_i.opposite ;
(* hierconn *) wire \before_i.answerable ;
(* hierconn *) wire \now_i.request_i.answerable ;
(* hierconn *) wire \before_i.spent ;
(* hierconn *) wire \now_i.request_i.spent ;
(* hierconn *) wire \before_i.reply_queued ;
(* hierconn *) wire \now_i.reply_i.queued ;
(* hierconn *) wire \before_i.wait_drive ;
(* hierconn *) wire \now_i.reply_i.wait_drive ;
(* hierconn *) wire \before_i.telegram_queued ;
(* hierconn *) wire \now_i.telegram_i.queued ;
(* hierconn *) wire \before_i.telegram_started ;
(* hierconn *) wire \now_i.telegram_i.started ;
(* hierconn *) wire \before_i.telegram_control ;
(* hierconn *) wire \now_i.telegram_i.control ;
(* hierconn *) wire \before_i.licensed ;
(* hierconn *) wire \now_i.telegram_i.licence_i.held ;
(* hierconn *) wire \before_i.unlicensed ;
(* hierconn *) wire \now_i.telegram_i.licence_i.opposite ;
(* hierconn *) wire \before_i.newest ;
(* hierconn *) wire \now_i.telegram_i.newest ;
(* hierconn *) wire \before_i.repeatable ;
(* hierconn *) wire \now_i.telegram_i.repeatable ;
(* hierconn *) wire \before_i.begun ;
(* hierconn *) wire \now_i.telegram_i.begun ;
(* hierconn *) wire \before_i.was_open ;
(* hierconn *) wire \now_i.loopback_i.was_open ;

// Such a name loses its power-up value.
initial assume (\before_i.ticket == 4'd0);
initial assume (\now_i.request_i.ticket == 4'd0);
initial assume (\before_i.is_candidate == 1'd0);
initial assume (\now_i.request_i.is_candidate == 1'd0);
initial assume (\before_i.committed == 1'd0);
initial assume (\now_i.request_i.committed_i.held == 1'd0);
initial assume (\before_i.uncommitted == 1'd1);
initial assume (\now_i.request_i.committed_i.opposite == 1'd1);
initial assume (\before_i.answerable == 1'd0);
initial assume (\now_i.request_i.answerable == 1'd0);
initial assume (\before_i.spent == 1'd0);
initial assume (\now_i.request_i.spent == 1'd0);
initial assume (\before_i.reply_queued == 1'd0);
initial assume (\now_i.reply_i.queued == 1'd0);
initial assume (\before_i.wait_drive == 1'd0);
initial assume (\now_i.reply_i.wait_drive == 1'd0);
initial assume (\before_i.telegram_queued == 1'd0);
initial assume (\now_i.telegram_i.queued == 1'd0);
initial assume (\before_i.telegram_started == 1'd0);
initial assume (\now_i.telegram_i.started == 1'd0);
initial assume (\before_i.telegram_control == 1'd0);
initial assume (\now_i.telegram_i.control == 1'd0);
initial assume (\before_i.licensed == 1'd0);
initial assume (\now_i.telegram_i.licence_i.held == 1'd0);
initial assume (\before_i.unlicensed == 1'd1);
initial assume (\now_i.telegram_i.licence_i.opposite == 1'd1);
initial assume (\before_i.newest == 1'd0);
initial assume (\now_i.telegram_i.newest == 1'd0);
initial assume (\before_i.repeatable == 1'd0);
initial assume (\now_i.telegram_i.repeatable == 1'd0);
initial assume (\before_i.begun == 1'd0);
initial assume (\now_i.telegram_i.begun == 1'd0);
initial assume (\before_i.was_open == 1'd0);
initial assume (\now_i.loopback_i.was_open == 1'd0);

always @(posedge clk) begin
  a_reply_start : assert (reply_start_now == reply_start_before);
  a_telegram_start : assert (telegram_start_now == telegram_start_before);
  a_telegram_control : assert (telegram_control_now == telegram_control_before);
  a_ticket : assert (ticket_now == ticket_before);
  a_is_candidate : assert (is_candidate_now == is_candidate_before);
  a_is_committed : assert (is_committed_now == is_committed_before);
  a_reply_queued : assert (reply_queued_now == reply_queued_before);
  a_telegram_queued : assert (telegram_queued_now == telegram_queued_before);
  a_telegram_started : assert (telegram_started_now == telegram_started_before);

  i_ticket : assert (\now_i.request_i.ticket == \before_i.ticket );
  i_is_candidate : assert (\now_i.request_i.is_candidate == \before_i.is_candidate );
  i_committed : assert (\now_i.request_i.committed_i.held == \before_i.committed );
  i_uncommitted : assert (\now_i.request_i.committed_i.opposite == \before_i.uncommitted );
  i_answerable : assert (\now_i.request_i.answerable == \before_i.answerable );
  i_spent : assert (\now_i.request_i.spent == \before_i.spent );
  i_reply_queued : assert (\now_i.reply_i.queued == \before_i.reply_queued );
  i_wait_drive : assert (\now_i.reply_i.wait_drive == \before_i.wait_drive );
  i_telegram_queued : assert (\now_i.telegram_i.queued == \before_i.telegram_queued );
  i_telegram_started : assert (\now_i.telegram_i.started == \before_i.telegram_started );
  i_telegram_control : assert (\now_i.telegram_i.control == \before_i.telegram_control );
  i_licensed : assert (\now_i.telegram_i.licence_i.held == \before_i.licensed );
  i_unlicensed : assert (\now_i.telegram_i.licence_i.opposite == \before_i.unlicensed );
  i_newest : assert (\now_i.telegram_i.newest == \before_i.newest );
  i_repeatable : assert (\now_i.telegram_i.repeatable == \before_i.repeatable );
  i_begun : assert (\now_i.telegram_i.begun == \before_i.begun );
  i_was_open : assert (\now_i.loopback_i.was_open == \before_i.was_open );
  i_committed_pair : assert (\before_i.uncommitted == !\before_i.committed );
  i_licensed_pair : assert (\before_i.unlicensed == !\before_i.licensed );
end

// Both gates let things leave.
always @(posedge clk) begin
  c_reply_start : cover (reply_start_now && !loopback_open);
  c_telegram_start : cover (telegram_start_now && !loopback_open);
  c_control : cover (telegram_start_now && telegram_control_now);
end
