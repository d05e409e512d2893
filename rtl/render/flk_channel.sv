// Channel: feature FIFO and two VRUs, together one 4x4 mini-tile.
//
// Each splat is issued to both VRUs in lockstep, pixel by pixel: 8 cycles. Once all 16 pixels of the sub-tile are finished,
// splats up to the token are dropped, one per cycle. A token is issued when both VRUs' output buffers are free; the
// next sub-tile follows at once.
//
// `finished_o` says that all pixels are finished and no token lies between the FIFO's input and the pixels, so that what is
// written now would be dropped: the dispatch need not write it.
// in_ready_o comes from a register; finished_o from registers.
module flk_channel
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form      = FORM_FACTORED,
  parameter int unsigned FifoDepth = FIFO_DEPTH,
  parameter int unsigned MiniTile  = 0
) (
  input  logic            clk_i,
  input  logic            rst_ni,
  // features
  input  logic            in_valid_i,
  output logic            in_ready_o,
  input  feature_elem_t   in_elem_i,
  output logic            finished_o,
  // finished pixels
  output logic            out_valid_o,
  input  logic            out_ready_i,
  output channel_pixel_t  out_data_o,
  // counters
  output channel_events_t events_o
);

  if (MiniTile >= CHANNELS) begin : gen_check_minitile
    $error("flk_channel: MiniTile must be 0 to 3");
  end

  localparam int unsigned PixelW = $clog2(PIXELS_PER_VRU);

  // ---- Feature FIFO ------------------------------------------------------------------------------------

  logic head_valid, pop, unused_full, unused_empty;
  logic [$clog2(FifoDepth + 1)-1:0] unused_usage;
  feature_elem_t head;

  flk_fifo #(
    .Width(FEATURE_ELEM_BITS),
    .Depth(FifoDepth)
  ) i_fifo (
    .clk_i,
    .rst_ni,
    .in_valid_i,
    .in_ready_o,
    .in_data_i  (in_elem_i),
    .out_valid_o(head_valid),
    .out_ready_i(pop),
    .out_data_o (head),
    .usage_o    (unused_usage),
    .full_o     (unused_full),
    .empty_o    (unused_empty)
  );

  // ---- Issue ---------------------------------------------------------------------------------------------

  logic [VRUS_PER_CHANNEL-1:0] eos_ready, blend_valid, blend_eos, finish;
  logic [VRUS_PER_CHANNEL-1:0][PixelW-1:0] blend_pixel;
  logic [VRUS_PER_CHANNEL-1:0][PIXELS_PER_VRU-1:0] finished;
  logic all_finished, drop, issue, issue_eos;
  logic [PixelW-1:0] pixel_d, pixel_q;
  logic eos_in_vru_d, eos_in_vru_q;
  subtile_t subtile_q;

  // The flags belong to the sub-tile at the head only when no token is on its way through the VRUs.
  assign all_finished = (&finished) && !eos_in_vru_q;
  assign drop         = head_valid && !head.eos && all_finished;
  assign issue_eos    = head_valid && head.eos && (&eos_ready);
  assign issue        = head_valid && !head.eos && !all_finished;
  assign pop          = drop || issue_eos || (issue && (pixel_q == PixelW'(PIXELS_PER_VRU - 1)));

  always_comb begin
    pixel_d = pixel_q;
    if (issue) begin
      pixel_d = pixel_q + PixelW'(1);
    end
    if (drop) begin
      pixel_d = '0;
    end
    eos_in_vru_d = eos_in_vru_q;
    if (blend_eos[0]) begin
      eos_in_vru_d = 1'b0;
    end
    if (issue_eos) begin
      eos_in_vru_d = 1'b1;
    end
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      pixel_q      <= '0;
      eos_in_vru_q <= 1'b0;
    end else begin
      pixel_q      <= pixel_d;
      eos_in_vru_q <= eos_in_vru_d;
    end
  end

  // Held until the sub-tile's pixels have left: the next token waits for that.
  always_ff @(posedge clk_i) begin
    if (issue_eos) begin
      subtile_q <= subtile_t'(head.feature[$bits(subtile_t)-1:0]);
    end
  end

  // ---- Tokens on their way: written, not yet at the pixels -----------------------------------------------

  localparam int unsigned TokenW = $clog2(FifoDepth + 2);  // FIFO and VRUs
  logic [TokenW-1:0] tokens_d, tokens_q;
  logic token_in;

  assign token_in = in_valid_i && in_ready_o && in_elem_i.eos;
  assign tokens_d = tokens_q + TokenW'(token_in) - TokenW'(blend_eos[0]);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      tokens_q <= '0;
    end else begin
      tokens_q <= tokens_d;
    end
  end

  assign finished_o = (&finished) && (tokens_q == '0);

  // ---- VRUs ------------------------------------------------------------------------------------------------

  logic [VRUS_PER_CHANNEL-1:0] vru_valid, vru_ready;
  vru_pixel_t [VRUS_PER_CHANNEL-1:0] vru_pixel;
  vru_pixel_t out_pixel;
  logic out_vru;

  for (genvar v = 0; v < VRUS_PER_CHANNEL; v++) begin : gen_vru
    flk_vru #(
      .Form(Form)
    ) i_vru (
      .clk_i,
      .rst_ni,
      .col_i        (1'(MiniTile % 2)),
      .row_i        (2'((MiniTile / 2) * VRUS_PER_CHANNEL + v)),
      .op_valid_i   (issue || issue_eos),
      .op_eos_i     (issue_eos),
      .op_pixel_i   (pixel_q),
      .op_feature_i (head.feature),
      .eos_ready_o  (eos_ready[v]),
      .blend_valid_o(blend_valid[v]),
      .blend_pixel_o(blend_pixel[v]),
      .blend_eos_o  (blend_eos[v]),
      .finished_o   (finished[v]),
      .finish_o     (finish[v]),
      .out_valid_o  (vru_valid[v]),
      .out_ready_i  (vru_ready[v]),
      .out_data_o   (vru_pixel[v])
    );
  end

  flk_stream_arbiter #(
    .Inputs(VRUS_PER_CHANNEL),
    .Width ($bits(vru_pixel_t))
  ) i_arbiter (
    .clk_i,
    .rst_ni,
    .in_valid_i (vru_valid),
    .in_ready_o (vru_ready),
    .in_data_i  (vru_pixel),
    .out_valid_o,
    .out_ready_i,
    .out_data_o (out_pixel),
    .out_index_o(out_vru)
  );

  assign out_data_o = '{
    subtile: subtile_q,
    index: {out_vru, out_pixel.index},
    pixel: out_pixel.pixel
  };

  // ---- Counters ------------------------------------------------------------------------------------------------

  // Program order: flags before the first pixel of a splat, both VRUs being in step.
  always_comb begin
    events_o.fifo_full = !in_ready_o;
    events_o.vru_busy  = issue;
    events_o.sent      = blend_valid[0] && (blend_pixel[0] == '0) && !(&finished);
    events_o.discarded = drop;
    events_o.finished  = 2'(finish[0]) + 2'(finish[1]);
  end

  // Both VRUs are in step: VRU 1's copies carry nothing new.
  logic unused_step;
  assign unused_step = ^{blend_valid[1], blend_pixel[1], blend_eos[1]};

endmodule
