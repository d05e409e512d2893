// Rendering core: four channels (one 8x8 sub-tile), FIFO monitor, pixel arbiter.
//
// in  splats with mini-tile masks and tokens, from a contribution test.
// out finished pixels, one per cycle, with sub-tile, mini-tile and pixel index. Pixels of a mini-tile come together in order within each
//     VRU; mini-tiles and sub-tiles interleave, since channels run independently.
// stall_o (to the CTU) is high while any feature FIFO is full. in_ready_o depends combinationally on mask and token.
module flk_rendering_core
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form           = FORM_FACTORED,
  parameter int unsigned FifoDepth      = FIFO_DEPTH,
  parameter int unsigned VrusPerChannel = VRUS_PER_CHANNEL  // 1, 2 or 4
) (
  input  logic                           clk_i,
  input  logic                           rst_ni,
  // splats
  input  logic                           in_valid_i,
  output logic                           in_ready_o,
  input  feature_elem_t                  in_elem_i,
  input  logic            [CHANNELS-1:0] in_mask_i,
  output logic                           stall_o,
  // finished pixels
  output logic                           out_valid_o,
  input  logic                           out_ready_i,
  output core_pixel_t                    out_data_o,
  // counters
  output dispatch_events_t               dispatch_events_o,
  output channel_events_t [CHANNELS-1:0] channel_events_o
);

  logic [CHANNELS-1:0] write, ready, finished;
  logic [CHANNELS-1:0] pixel_valid, pixel_ready;
  channel_pixel_t [CHANNELS-1:0] pixel;
  channel_pixel_t out_pixel;
  logic [$clog2(CHANNELS)-1:0] out_channel;

  flk_fifo_monitor i_monitor (
    .in_valid_i,
    .in_ready_o,
    .in_eos_i  (in_elem_i.eos),
    .in_mask_i,
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
      .in_valid_i (write[c]),
      .in_ready_o (ready[c]),
      .in_elem_i,
      .finished_o (finished[c]),
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

endmodule
