// Rendering core: four channels (one 8x8 sub-tile), FIFO monitor, pixel arbiter.
//
// in  a mask generator's stream: splats with their mask (MaskBits 4: mini-tiles, or 64: pixels, of which a mini-tile needs one) and tokens.
// out finished pixels, one per cycle, with sub-tile, mini-tile and pixel index. Pixels of a mini-tile come together in order within each
//     VRU; mini-tiles and sub-tiles interleave, since channels run independently.
// stall_o (to the mask generator) is high while any feature FIFO is full. in_ready_o depends combinationally on mask and token.
// clear_i forgets everything: in the next cycle the core is as after reset. idle_o: no element and no pixel is inside.
// finished_o is about the sub-tile of the element that in_* takes: all its pixels are finished, so that its splats change no pixel any
// more. It comes from a register, rises some cycles late and is low in the cycle after a token was taken.
module flk_rendering_core
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form           = FORM_FACTORED,
  parameter int unsigned FifoDepth      = FIFO_DEPTH,
  parameter int unsigned VrusPerChannel = VRUS_PER_CHANNEL,  // 1, 2 or 4
  parameter int unsigned MaskBits       = CHANNELS,  // 4 or 64
  localparam int unsigned MaskedElemBits = MaskBits + FEATURE_ELEM_BITS
) (
  input  logic                           clk_i,
  input  logic                           rst_ni,
  input  logic                           clear_i,
  output logic                           idle_o,
  // splats
  input  logic                           in_valid_i,
  output logic                           in_ready_o,
  input  logic      [MaskedElemBits-1:0] in_data_i,  // masked_elem_t
  output logic                           stall_o,
  output logic                           finished_o,
  // finished pixels
  output logic                           out_valid_o,
  input  logic                           out_ready_i,
  output core_pixel_t                    out_data_o,
  // counters
  output dispatch_events_t               dispatch_events_o,
  output channel_events_t [CHANNELS-1:0] channel_events_o
);

  if (FifoDepth < 1 || FifoDepth > 128) begin : gen_check_depth
    $error("flk_rendering_core: FifoDepth must be 1 to 128");
  end
  if (VrusPerChannel != 1 && VrusPerChannel != 2 && VrusPerChannel != 4) begin : gen_check_vrus
    $error("flk_rendering_core: VrusPerChannel must be 1, 2 or 4");
  end
  if (MaskBits != CHANNELS && MaskBits != SUBTILE * SUBTILE) begin : gen_check_mask
    $error("flk_rendering_core: MaskBits must be 4 (mini-tiles) or 64 (pixels)");
  end
  if (Form > FORM_FACTORED) begin : gen_check_form
    $error("flk_rendering_core: Form must be FORM_CONIC or FORM_FACTORED");
  end

  typedef struct packed {
    logic [MaskBits-1:0] mask;
    feature_elem_t       elem;
  } masked_elem_t;

  masked_elem_t in_masked;
  assign in_masked = masked_elem_t'(in_data_i);

  logic [CHANNELS-1:0] write, ready, finished, idle;
  logic [CHANNELS-1:0] pixel_valid, pixel_ready;
  channel_pixel_t [CHANNELS-1:0] pixel;
  channel_pixel_t out_pixel;
  logic [$clog2(CHANNELS)-1:0] out_channel;

  assign idle_o = &idle;

  // Each channel says it of the sub-tile at its own input: the one at in_*, for a token goes to all of them at once.
  logic finished_q, token_in;

  assign token_in   = in_valid_i && in_ready_o && in_masked.elem.eos;
  assign finished_o = finished_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      finished_q <= 1'b0;
    end else begin
      finished_q <= (&finished) && !token_in && !clear_i;
    end
  end

  flk_fifo_monitor #(
    .MaskBits(MaskBits)
  ) i_monitor (
    .in_valid_i,
    .in_ready_o,
    .in_eos_i  (in_masked.elem.eos),
    .in_mask_i (in_masked.mask),
    .stall_o,
    .write_o   (write),
    .ready_i   (ready),
    .finished_i(finished),
    .events_o  (dispatch_events_o)
  );

  for (genvar c = 0; c < CHANNELS; c++) begin : gen_channel
    flk_channel #(
      .Form          (Form),
      .FifoDepth     (FifoDepth),
      .VrusPerChannel(VrusPerChannel),
      .MiniTile      (c)
    ) i_channel (
      .clk_i,
      .rst_ni,
      .clear_i,
      .in_valid_i (write[c]),
      .in_ready_o (ready[c]),
      .in_elem_i  (in_masked.elem),
      .finished_o (finished[c]),
      .idle_o     (idle[c]),
      .out_valid_o(pixel_valid[c]),
      .out_ready_i(pixel_ready[c]),
      .out_data_o (pixel[c]),
      .events_o   (channel_events_o[c])
    );
  end

  flk_stream_arbiter #(
    .Inputs(CHANNELS),
    .Width (CHANNEL_PIXEL_BITS)
  ) i_arbiter (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (pixel_valid),
    .in_ready_o (pixel_ready),
    .in_data_i  (pixel),
    .out_valid_o,
    .out_ready_i,
    .out_data_o (out_pixel),
    .out_index_o(out_channel)
  );

  assign out_data_o = '{
    subtile: out_pixel.subtile,
    minitile: out_channel,
    index: out_pixel.index,
    pixel: out_pixel.pixel
  };

`ifndef SYNTHESIS
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      in_valid_i && !in_ready_o && !clear_i |=> in_valid_i && $stable(in_data_i))
  else $error("flk_rendering_core: element changed before its transfer");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      in_valid_i |-> in_masked.elem.eos ? (&in_masked.mask) : (|in_masked.mask))
  else $error("flk_rendering_core: empty mask, or a token not for all channels");

  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_rendering_core: pixel changed before its transfer");
`endif

endmodule
