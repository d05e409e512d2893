// Contribution test unit (CTU): gives each splat of a sub-tile's sorted list the mask of mini-tiles it may contribute to.
//
// in  splat_elem_t, one list per sub-tile, each closed by a token (eos).
// out the same elements in the same order with a 4-bit mask; splats with an empty mask are taken out and counted,
//     tokens pass with mask 1111.
// Throughput one splat per cycle with sparse, one per two cycles with dense sampling. Latency from acceptance to out_valid_o
// is PRTU_LATENCY + 1 cycles.
//
// No stall reaches the PRTUs. An element is written into the internal FIFO when it is accepted and waits there for its mask;
// nothing is accepted while that FIFO is full, so every result has its place and nothing in flight can be lost. `stall_i` (a
// feature FIFO is full) stops acceptance, not the output.
// in_ready_o depends combinationally on in_elem_i and stall_i; outputs come from registers.
//
// This stream interface is all that the neighbours know of the test: another test with the same ports can take its place.
module flk_ctu
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form         = FORM_FACTORED,
  parameter int unsigned Precision    = PRECISION_MIXED,
  parameter int unsigned CtuFifoDepth = CTU_FIFO_DEPTH
) (
  input  logic          clk_i,
  input  logic          rst_ni,
  input  logic [2:0]    mode_i,       // CAT_*; constant during a frame
  input  logic          stall_i,
  // sorted list
  input  logic          in_valid_i,
  output logic          in_ready_o,
  input  splat_elem_t   in_elem_i,
  // to the rendering core
  output logic          out_valid_o,
  input  logic          out_ready_i,
  output feature_elem_t out_elem_o,
  output logic [3:0]    out_mask_o,
  // counters
  output ctu_events_t   events_o
);

  // ---- Control ---------------------------------------------------------------------------------------

  typedef struct packed {
    logic dense;
    logic batch;
    logic all;
    logic eos;
    logic base_dense;
  } tag_t;

  logic issue, issue_batch, issue_dense, issue_all, issue_base_dense;
  logic space, accept;
  logic result_valid;
  logic [3:0] result_mask;
  logic unused_fallen;
  logic [PRTU_LATENCY-1:0] tag_valid_q;
  tag_t [PRTU_LATENCY-1:0] tag_q;
  tag_t tag_in, tag_out;

  flk_ctu_controller i_controller (
    .clk_i,
    .rst_ni,
    .mode_i,
    .valid_i            (in_valid_i),
    .ready_o            (in_ready_o),
    .eos_i              (in_elem_i.eos),
    .spiky_i            (in_elem_i.splat.spiky),
    .space_i            (space),
    .stall_i,
    .issue_o            (issue),
    .issue_batch_o      (issue_batch),
    .issue_dense_o      (issue_dense),
    .issue_all_o        (issue_all),
    .issue_base_dense_o (issue_base_dense),
    .result_valid_i     (result_valid),
    .result_eos_i       (tag_out.eos),
    .result_base_dense_i(tag_out.base_dense),
    .result_mask_i      (result_mask),
    .fallen_o           (unused_fallen)
  );

  assign accept = in_valid_i && in_ready_o;

  // ---- Test pipeline ---------------------------------------------------------------------------------

  localparam bit Wide = (Precision == PRECISION_FP16);
  localparam int unsigned QuadBits = Wide ? 16 : 8;

  feature_t feature;
  logic [QuadBits-1:0] threshold;
  // Leader pixels of the two rectangles: columns and rows, top and bottom.
  logic [2:0] a_x0, a_x1, a_y0, a_y1, b_x0, b_x1, b_y0, b_y1;
  logic [3:0] pass_a, pass_b;
  logic [3:0][QuadBits-1:0] unused_weight_a, unused_weight_b;

  assign feature = in_elem_i.splat.feature;

  flk_log_opacity #(
    .Base2  (Form == FORM_FACTORED),
    .ExpBits(Wide ? 5 : 4),
    .ManBits(Wide ? 10 : 3)
  ) i_log (
    .opacity_i(feature.opacity),
    .log_o    (threshold)
  );

  // Dense: rectangles are the corners of mini-tiles 0 and 1, then 2 and 3. Sparse: top-left pixels, bottom-right pixels.
  always_comb begin
    {a_x0, a_x1} = {3'd0, 3'd4};
    {a_y0, a_y1} = {3'd0, 3'd4};
    {b_x0, b_x1} = {3'd3, 3'd7};
    {b_y0, b_y1} = {3'd3, 3'd7};
    if (issue_dense) begin
      {a_x0, a_x1} = {3'd0, 3'd3};
      {b_x0, b_x1} = {3'd4, 3'd7};
      {a_y0, a_y1} = issue_batch ? {3'd4, 3'd7} : {3'd0, 3'd3};
      {b_y0, b_y1} = {a_y0, a_y1};
    end
  end

  flk_prtu #(
    .Form     (Form),
    .Precision(Precision)
  ) i_prtu_a (
    .clk_i,
    .x_top_i    (a_x0),
    .x_bot_i    (a_x1),
    .y_top_i    (a_y0),
    .y_bot_i    (a_y1),
    .mean_x_i   (feature.mean_x),
    .mean_y_i   (feature.mean_y),
    .shape0_i   (feature.shape0),
    .shape1_i   (feature.shape1),
    .shape2_i   (feature.shape2),
    .threshold_i(threshold),
    .pass_o     (pass_a),
    .weight_o   (unused_weight_a)
  );

  flk_prtu #(
    .Form     (Form),
    .Precision(Precision)
  ) i_prtu_b (
    .clk_i,
    .x_top_i    (b_x0),
    .x_bot_i    (b_x1),
    .y_top_i    (b_y0),
    .y_bot_i    (b_y1),
    .mean_x_i   (feature.mean_x),
    .mean_y_i   (feature.mean_y),
    .shape0_i   (feature.shape0),
    .shape1_i   (feature.shape1),
    .shape2_i   (feature.shape2),
    .threshold_i(threshold),
    .pass_o     (pass_b),
    .weight_o   (unused_weight_b)
  );

  assign tag_in = '{
    dense: issue_dense,
    batch: issue_batch,
    all: issue_all,
    eos: in_elem_i.eos,
    base_dense: issue_base_dense
  };
  assign tag_out = tag_q[PRTU_LATENCY-1];

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      tag_valid_q <= '0;
    end else begin
      tag_valid_q <= {tag_valid_q[PRTU_LATENCY-2:0], issue};
    end
  end

  always_ff @(posedge clk_i) begin
    tag_q <= {tag_q[PRTU_LATENCY-2:0], tag_in};
  end

  flk_mmu i_mmu (
    .clk_i,
    .valid_i (tag_valid_q[PRTU_LATENCY-1]),
    .dense_i (tag_out.dense),
    .batch_i (tag_out.batch),
    .all_i   (tag_out.all),
    .pass_a_i(pass_a),
    .pass_b_i(pass_b),
    .valid_o (result_valid),
    .mask_o  (result_mask)
  );

  // ---- Internal FIFOs: elements from acceptance, masks from the MMU ------------------------------------

  feature_elem_t elem_in;
  logic unused_elem_valid, unused_mask_ready, mask_valid, pop, empty_mask;
  logic [$clog2(CtuFifoDepth + 1)-1:0] unused_elem_usage, unused_mask_usage;
  logic unused_elem_full, unused_elem_empty, unused_mask_full, unused_mask_empty;

  assign elem_in = '{eos: in_elem_i.eos, feature: feature};

  flk_fifo #(
    .Width(FEATURE_ELEM_BITS),
    .Depth(CtuFifoDepth)
  ) i_elem_fifo (
    .clk_i,
    .rst_ni,
    .in_valid_i (accept),
    .in_ready_o (space),
    .in_data_i  (elem_in),
    .out_valid_o(unused_elem_valid),
    .out_ready_i(pop),
    .out_data_o (out_elem_o),
    .usage_o    (unused_elem_usage),
    .full_o     (unused_elem_full),
    .empty_o    (unused_elem_empty)
  );

  // Never full before the element FIFO is: an element enters that one first and both are popped together.
  flk_fifo #(
    .Width(4),
    .Depth(CtuFifoDepth)
  ) i_mask_fifo (
    .clk_i,
    .rst_ni,
    .in_valid_i (result_valid),
    .in_ready_o (unused_mask_ready),
    .in_data_i  (result_mask),
    .out_valid_o(mask_valid),
    .out_ready_i(pop),
    .out_data_o (out_mask_o),
    .usage_o    (unused_mask_usage),
    .full_o     (unused_mask_full),
    .empty_o    (unused_mask_empty)
  );

  assign empty_mask  = (out_mask_o == '0);
  assign out_valid_o = mask_valid && !empty_mask;
  assign pop         = mask_valid && (empty_mask || out_ready_i);

  // ---- Counters ----------------------------------------------------------------------------------------

  always_comb begin
    events_o = '0;
    events_o.busy    = issue;
    events_o.stalled = in_valid_i && !issue;
    events_o.idle    = !in_valid_i;
    events_o.token   = accept && in_elem_i.eos;
    events_o.splat   = accept && !in_elem_i.eos;
    if (result_valid && !tag_out.eos) begin
      events_o.rejected = (result_mask == '0);
      events_o.tested   = 3'(result_mask[0]) + 3'(result_mask[1])
                        + 3'(result_mask[2]) + 3'(result_mask[3]);
    end
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni) result_valid |-> unused_mask_ready)
  else $error("flk_ctu: a mask has no place");
  assert property (@(posedge clk_i) disable iff (!rst_ni) mask_valid |-> unused_elem_valid)
  else $error("flk_ctu: a mask without its element");
`endif

endmodule
