// SPDX-License-Identifier: Apache-2.0
// What the drive may be sent: the licences that commits give and telegrams use up.
//
// Three licences, each a guarded bit, each for one telegram: of the control image, of a parameter
// write for this card, of a parameter write for all. The commit of such a request gives the licence
// of its kind (renewed). The first start of a telegram of that kind uses it up. A licence that
// nothing has used stays, whatever requests come (FRAME-7).
// SECOND_TELEGRAM = 1: a parameter write for this card has a second licence, a guarded bit, too. A
// number that the drive refuses goes out as text with it (MAP-8 of some dialects).
// kind: 0 the newest request itself, as long as it is unanswered (no licence is used up; the control
// word leaves deactivated); 1 image; 2 parameter write for this card; 3 for all.
// take_stop, with the stop due: the image gets a licence without start, if it has none (SAFE-7).
// free: a committed write of coils gave the licence of the image, so the start bit may be 1. Without
// MASTER_LOSS_STOP nothing else gives it.
// Clock domain: clk.
`default_nettype none

module licences #(
    parameter [0:0] MASTER_LOSS_STOP = 1'b0,
    parameter [0:0] SECOND_TELEGRAM  = 1'b0
) (
    input  wire       clk,
    input  wire       rst,
    // newest request
    input  wire       commits,
    input  wire       broadcast,
    input  wire       writes_coils,
    input  wire       writes_parameter,
    input  wire       unanswered,
    // loss of the master
    input  wire       take_stop,
    // telegram
    input  wire [1:0] kind,
    input  wire       used,
    // status
    output reg        valid,
    output reg        renewed,
    output wire       free,
    output wire       fault
);

  localparam [1:0] K_NEWEST = 2'd0;
  localparam [1:0] K_IMAGE = 2'd1;
  localparam [1:0] K_ONE = 2'd2;

  wire image_valid;
  wire one_valid;
  wire second_valid;
  wire all_valid;
  wire image_fault;
  wire free_fault;
  wire one_fault;
  wire second_fault;
  wire all_fault;

  wire renews_image = commits && writes_coils;
  wire renews_one = commits && writes_parameter && !broadcast;
  wire renews_all = commits && writes_parameter && broadcast;
  wire used_image = used && kind == K_IMAGE;
  wire used_one = used && kind == K_ONE;
  wire used_all = used && kind > K_ONE;

  assign fault = image_fault || free_fault || one_fault || second_fault || all_fault;

  always @*
    case (kind)
      K_NEWEST: {valid, renewed} = {unanswered && !broadcast, commits};
      K_IMAGE:  {valid, renewed} = {image_valid, renews_image};
      K_ONE:    {valid, renewed} = {one_valid, renews_one};
      default:  {valid, renewed} = {all_valid, renews_all};
    endcase

  guarded_bit image_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (renews_image || used_image || take_stop),
      .data (renews_image || take_stop),
      // status
      .value(image_valid),
      .fault(image_fault)
  );

  guarded_bit one_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (renews_one || used_one),
      .data (renews_one || second_valid),
      // status
      .value(one_valid),
      .fault(one_fault)
  );

  generate
    if (MASTER_LOSS_STOP) begin : g_stop
      guarded_bit free_i (
          .clk  (clk),
          .rst  (rst),
          // next value
          .load (renews_image || used_image),
          .data (renews_image),
          // status
          .value(free),
          .fault(free_fault)
      );
    end else begin : g_no_stop
      assign free = 1'b1;
      assign free_fault = 1'b0;
    end

    if (SECOND_TELEGRAM) begin : g_second
      guarded_bit second_i (
          .clk  (clk),
          .rst  (rst),
          // next value
          .load (renews_one || used_one),
          .data (renews_one),
          // status
          .value(second_valid),
          .fault(second_fault)
      );
    end else begin : g_no_second
      assign second_valid = 1'b0;
      assign second_fault = 1'b0;
    end
  endgenerate

  guarded_bit all_i (
      .clk  (clk),
      .rst  (rst),
      // next value
      .load (renews_all || used_all),
      .data (renews_all),
      // status
      .value(all_valid),
      .fault(all_fault)
  );

endmodule

`default_nettype wire
