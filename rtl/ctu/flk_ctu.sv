// Contribution test unit (CTU): gives each splat of a sub-tile's sorted list the mask of mini-tiles it may contribute to.
//
// in  splat_elem_t, one list per sub-tile, each closed by a token (eos).
// out the same elements in the same order, as feature_elem_t below a 4-bit mask; splats with an empty mask are taken out and counted,
//     tokens pass with mask 1111.
// Throughput one splat per cycle with sparse, one per two cycles with dense sampling.
//
// Elements travel beside their test in one pipeline of LATENCY stages; the last one is the output. Nothing in flight can be lost:
// CtuFifoDepth 0: the whole pipeline stands still while its last element waits for out_ready_i. An element comes out LATENCY cycles after
//   it was accepted.
// CtuFifoDepth > 0: the pipeline never stands still, its results go into an output FIFO (paper, Sec. IV-C), one cycle later; an element is
//   accepted only if it has a place there.
// `stall_i` (a feature FIFO is full) stops acceptance, not the output. in_ready_o depends combinationally on in_elem_i, stall_i and, without
// FIFO, on out_ready_i; out_valid_o, out_data_o and idle_o do not depend on inputs.
// clear_i forgets everything, the sums of the automatic mode too: in the next cycle the unit is as after reset.
//
// One of the mask generators of flk_mask_generator, whose ports these are (docs/reference/mask_generators.md).
module flk_ctu
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form         = FORM_FACTORED,
  parameter int unsigned Precision    = PRECISION_FIXED,
  parameter int unsigned VruCycles    = PIXELS_PER_VRU,  // that a splat takes in a channel
  parameter int unsigned CtuFifoDepth = CTU_FIFO_DEPTH,
  localparam int unsigned MaskBits = CHANNELS,
  localparam int unsigned MaskedElemBits = MaskBits + FEATURE_ELEM_BITS
) (
  input  logic                      clk_i,
  input  logic                      rst_ni,
  input  logic                      clear_i,
  output logic                      idle_o,       // nothing inside
  input  logic [2:0]                mode_i,       // CAT_*; constant while something is inside
  input  logic                      stall_i,
  // sorted list
  input  logic                      in_valid_i,
  output logic                      in_ready_o,
  input  splat_elem_t               in_elem_i,
  // to the rendering core
  output logic                      out_valid_o,
  input  logic                      out_ready_i,
  output logic [MaskedElemBits-1:0] out_data_o,   // masked_elem_t
  // counters
  output generator_events_t         events_o
);

  if (Form > FORM_FACTORED) begin : gen_check_form
    $error("flk_ctu: Form must be FORM_CONIC or FORM_FACTORED");
  end
  if (Precision > PRECISION_FIXED) begin : gen_check_precision
    $error("flk_ctu: Precision must be one of PRECISION_*, 0 to 3");
  end
  if (CtuFifoDepth > 128) begin : gen_check_depth
    $error("flk_ctu: CtuFifoDepth must be 0 (no output FIFO) to 128");
  end

  typedef struct packed {
    logic [MaskBits-1:0] mask;
    feature_elem_t       elem;
  } masked_elem_t;

  // ---- Control ---------------------------------------------------------------------------------------

  typedef struct packed {
    logic dense;
    logic batch;
    logic all;
    logic eos;
    logic base_dense;
  } tag_t;

  localparam int unsigned LATENCY = 32'(PRTU_LATENCY[Form][Precision]);
  localparam int unsigned MEAN_DELAY = 32'(PRTU_MEAN_DELAY[Precision]);
  localparam int unsigned SHAPE_DELAY = 32'(PRTU_SHAPE_DELAY[Precision]);

  logic issue, issue_batch, issue_dense, issue_all, issue_base_dense;
  logic advance, space, accept;
  logic result_valid, mask_valid;
  logic [3:0] result_mask;
  logic unused_fallen;
  // Stage i of these is what entered i + 1 steps ago.
  logic [LATENCY-1:0] tag_valid_q;
  tag_t [LATENCY-1:0] tag_q;
  feature_t [LATENCY-1:0] feature_q;
  tag_t tag_in, tag_out;

  flk_ctu_controller #(
    .VruCycles(VruCycles)
  ) i_controller (
    .clk_i,
    .rst_ni,
    .clear_i,
    .mode_i,
    .valid_i            (in_valid_i),
    .ready_o            (in_ready_o),
    .eos_i              (in_elem_i.eos),
    .spiky_i            (in_elem_i.splat.spiky),
    .space_i            (space && advance),
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

  // ---- Pipeline ----------------------------------------------------------------------------------------

  assign tag_in = '{
    dense: issue_dense,
    batch: issue_batch,
    all: issue_all,
    eos: in_elem_i.eos,
    base_dense: issue_base_dense
  };
  assign tag_out = tag_q[LATENCY-1];

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      tag_valid_q <= '0;
    end else if (clear_i) begin
      tag_valid_q <= '0;
    end else if (advance) begin
      tag_valid_q <= {tag_valid_q[LATENCY-2:0], issue};
    end
  end

  always_ff @(posedge clk_i) begin
    if (advance) begin
      tag_q <= {tag_q[LATENCY-2:0], tag_in};
      feature_q <= {feature_q[LATENCY-2:0], in_elem_i.splat.feature};
    end
  end

  // ---- Test ----------------------------------------------------------------------------------------------

  localparam bit Wide = (Precision == PRECISION_FP16);
  localparam int unsigned QuadBits = Wide ? 16 : 8;

  // Mean, shape and threshold are taken from the pipeline where the PRTUs need them.
  fp16_t mean_x, mean_y;
  logic [2:0][QuadBits-1:0] shape_q;
  logic [QuadBits-1:0] threshold_q;
  // Leader pixels of the two rectangles: columns and rows.
  logic [1:0][2:0] a_x, a_y, b_x, b_y;
  logic [3:0] pass_a, pass_b;

  if (MEAN_DELAY == 0) begin : gen_mean
    assign mean_x = in_elem_i.splat.feature.mean_x;
    assign mean_y = in_elem_i.splat.feature.mean_y;
  end else begin : gen_mean_late
    assign mean_x = feature_q[MEAN_DELAY-1].mean_x;
    assign mean_y = feature_q[MEAN_DELAY-1].mean_y;
  end

  if (Wide) begin : gen_shape16
    assign shape_q = {
      feature_q[SHAPE_DELAY-1].shape2,
      feature_q[SHAPE_DELAY-1].shape1,
      feature_q[SHAPE_DELAY-1].shape0
    };
  end else begin : gen_shape8
    fp16_t [2:0] shape16;
    logic [2:0][7:0] shape8;
    assign shape16 = {
      feature_q[SHAPE_DELAY-2].shape2,
      feature_q[SHAPE_DELAY-2].shape1,
      feature_q[SHAPE_DELAY-2].shape0
    };
    for (genvar i = 0; i < 3; i++) begin : gen_convert
      flk_fp_convert i_shape (
        .src_i(shape16[i]),
        .dst_o(shape8[i])
      );
    end
    always_ff @(posedge clk_i) begin
      if (advance) begin
        shape_q <= shape8;
      end
    end
  end

  flk_log_opacity_pipe #(
    .Base2   (Form == FORM_FACTORED),
    .ExpBits (Wide ? 5 : 4),
    .ManBits (Wide ? 10 : 3),
    .Fn      (!Wide),
    .Saturate(!Wide),
    .Stages  (LOG_STAGES)
  ) i_log (
    .clk_i,
    .en_i     (advance),
    .opacity_i(feature_q[LATENCY-2-LOG_STAGES].opacity),
    .log_o    (threshold_q)
  );

  // Dense: rectangles are the corners of mini-tiles 0 and 1, then 2 and 3. Sparse: top-left pixels, bottom-right pixels.
  always_comb begin
    a_x = {3'd4, 3'd0};
    a_y = {3'd4, 3'd0};
    b_x = {3'd7, 3'd3};
    b_y = {3'd7, 3'd3};
    if (issue_dense) begin
      a_x = {3'd3, 3'd0};
      b_x = {3'd7, 3'd4};
      a_y = issue_batch ? {3'd7, 3'd4} : {3'd3, 3'd0};
      b_y = a_y;
    end
  end

  flk_prtu #(
    .Form     (Form),
    .Precision(Precision)
  ) i_prtu_a (
    .clk_i,
    .en_i       (advance),
    .x_i        (a_x),
    .y_i        (a_y),
    .mean_x_i   (mean_x),
    .mean_y_i   (mean_y),
    .shape_i    (shape_q),
    .threshold_i(threshold_q),
    .pass_o     (pass_a)
  );

  flk_prtu #(
    .Form     (Form),
    .Precision(Precision)
  ) i_prtu_b (
    .clk_i,
    .en_i       (advance),
    .x_i        (b_x),
    .y_i        (b_y),
    .mean_x_i   (mean_x),
    .mean_y_i   (mean_y),
    .shape_i    (shape_q),
    .threshold_i(threshold_q),
    .pass_o     (pass_b)
  );

  flk_mmu i_mmu (
    .clk_i,
    .valid_i (tag_valid_q[LATENCY-1] && advance),
    .dense_i (tag_out.dense),
    .batch_i (tag_out.batch),
    .all_i   (tag_out.all),
    .pass_a_i(pass_a),
    .pass_b_i(pass_b),
    .valid_o (result_valid),
    .mask_o  (result_mask)
  );

  // ---- Output --------------------------------------------------------------------------------------------

  masked_elem_t masked;

  assign masked.mask = result_mask;
  assign masked.elem = '{eos: tag_out.eos, feature: feature_q[LATENCY-1]};
  // A mask at the end of the pipeline, whether it moves or not.
  assign mask_valid = tag_valid_q[LATENCY-1] && (!tag_out.dense || tag_out.batch);

  if (CtuFifoDepth == 0) begin : gen_hold
    assign space       = 1'b1;
    assign out_valid_o = mask_valid && (result_mask != '0);
    assign out_data_o  = masked;
    assign advance     = !out_valid_o || out_ready_i;
    assign idle_o      = (tag_valid_q == '0);
  end else begin : gen_fifo
    // Places taken: elements accepted that have neither left the FIFO nor been rejected.
    localparam int unsigned UsageBits = $clog2(CtuFifoDepth + 1);
    logic [UsageBits-1:0] taken_d, taken_q, unused_usage;
    logic fifo_ready, unused_full, unused_empty, leaves, rejects;

    assign idle_o  = (tag_valid_q == '0) && !out_valid_o;

    assign advance = 1'b1;
    assign space   = (taken_q != UsageBits'(CtuFifoDepth));
    assign leaves  = out_valid_o && out_ready_i;
    assign rejects = mask_valid && (result_mask == '0);
    assign taken_d = clear_i ? '0
                   : taken_q + UsageBits'(accept) - UsageBits'(leaves) - UsageBits'(rejects);

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        taken_q <= '0;
      end else begin
        taken_q <= taken_d;
      end
    end

    flk_fifo #(
      .Width(MaskedElemBits),
      .Depth(CtuFifoDepth)
    ) i_fifo (
      .clk_i,
      .rst_ni,
      .clear_i,
      .in_valid_i (mask_valid && (result_mask != '0)),
      .in_ready_o (fifo_ready),
      .in_data_i  (masked),
      .out_valid_o,
      .out_ready_i,
      .out_data_o,
      .usage_o    (unused_usage),
      .full_o     (unused_full),
      .empty_o    (unused_empty)
    );

`ifdef SYNTHESIS
    logic unused_ready;
    assign unused_ready = fifo_ready;
`else
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        mask_valid && (result_mask != '0) |-> fifo_ready)
    else $error("flk_ctu: a result has no place");
`endif
  end

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_ctu: element changed before its transfer");

  assert property (@(posedge clk_i) disable iff (!rst_ni) !idle_o && !clear_i |=> $stable(mode_i))
  else $error("flk_ctu: mode_i changed while something is inside");
`endif

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

endmodule
