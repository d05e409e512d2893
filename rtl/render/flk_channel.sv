// Channel: feature FIFO and VRUs, two unless VrusPerChannel says otherwise, together one 4x4 mini-tile.
//
// The VRUs divide the mini-tile row by row. Each splat is issued to all of them in lockstep, pixel by pixel: 8 cycles with two VRUs.
// Once all 16 pixels of the sub-tile are finished, splats up to the token are dropped, one per cycle. A token is issued when the output
// buffers of all VRUs are free; the next sub-tile follows at once.
//
// `finished_o` says that all pixels are finished and no token lies between the FIFO's input and the pixels, so that what is
// written now would be dropped: the dispatch need not write it.
// clear_i forgets everything: in the next cycle the channel is as after reset. idle_o: it holds no element and no pixel that waits to leave;
// what the splats of an unfinished list have left in the pixels it does not know.
// in_ready_o comes from a register; finished_o and idle_o from registers.
module flk_channel
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form           = FORM_FACTORED,
  parameter int unsigned FifoDepth      = FIFO_DEPTH,
  parameter int unsigned VrusPerChannel = VRUS_PER_CHANNEL,  // 1, 2 or 4
  parameter int unsigned MiniTile       = 0
) (
  input  logic            clk_i,
  input  logic            rst_ni,
  input  logic            clear_i,
  // features
  input  logic            in_valid_i,
  output logic            in_ready_o,
  input  feature_elem_t   in_elem_i,
  output logic            finished_o,
  output logic            idle_o,
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
  if (VrusPerChannel != 1 && VrusPerChannel != 2 && VrusPerChannel != 4) begin : gen_check_vrus
    $error("flk_channel: VrusPerChannel must be 1, 2 or 4");
  end

  localparam int unsigned Pixels = MINITILE * MINITILE / VrusPerChannel;  // of a VRU
  localparam int unsigned PixelW = $clog2(Pixels);
  // A sub-tile has 8 rows; a VRU has Pixels / 4 of them: blocks of rows 0 to 2^RowW - 1.
  localparam int unsigned RowW = 5 - PixelW;

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
    .clear_i,
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

  logic [VrusPerChannel-1:0] eos_ready, blend_valid, blend_eos, finish;
  logic [VrusPerChannel-1:0][PixelW-1:0] blend_pixel;
  logic [VrusPerChannel-1:0][Pixels-1:0] finished;
  logic all_finished, drop, issue, issue_eos;
  logic [PixelW-1:0] pixel_d, pixel_q;
  logic eos_in_vru_d, eos_in_vru_q;
  subtile_t subtile_q;

  // The flags belong to the sub-tile at the head only when no token is on its way through the VRUs.
  assign all_finished = (&finished) && !eos_in_vru_q;
  assign drop         = head_valid && !head.eos && all_finished;
  assign issue_eos    = head_valid && head.eos && (&eos_ready);
  assign issue        = head_valid && !head.eos && !all_finished;
  assign pop          = drop || issue_eos || (issue && (pixel_q == PixelW'(Pixels - 1)));

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
    if (clear_i) begin
      pixel_d      = '0;
      eos_in_vru_d = 1'b0;
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

  // 0 to FifoDepth + 1: those in the FIFO, one in the VRUs.
  localparam int unsigned TokenW = $clog2(FifoDepth + 2);
  logic [TokenW-1:0] tokens_d, tokens_q;
  logic token_in;

  assign token_in = in_valid_i && in_ready_o && in_elem_i.eos;
  assign tokens_d = clear_i ? '0 : tokens_q + TokenW'(token_in) - TokenW'(blend_eos[0]);

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      tokens_q <= '0;
    end else begin
      tokens_q <= tokens_d;
    end
  end

  assign finished_o = (&finished) && (tokens_q == '0);
  assign idle_o     = !head_valid && (&eos_ready);

  // ---- VRUs ------------------------------------------------------------------------------------------------

  // Index within the VRU and state of a finished pixel.
  localparam int unsigned VruPixelBits = PixelW + $bits(pixel_t);

  logic [VrusPerChannel-1:0] vru_valid, vru_ready;
  logic [VrusPerChannel-1:0][VruPixelBits-1:0] vru_data;
  logic [3:0] out_index;
  pixel_t out_pixel;

  for (genvar v = 0; v < VrusPerChannel; v++) begin : gen_vru
    flk_vru #(
      .Form  (Form),
      .Pixels(Pixels)
    ) i_vru (
      .clk_i,
      .rst_ni,
      .clear_i,
      // Mini-tiles 0 and 1 lie above 2 and 3; a mini-tile is VrusPerChannel blocks of rows high.
      .col_i        (1'(MiniTile % 2)),
      .row_i        (RowW'((MiniTile / 2) * VrusPerChannel + v)),
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
      .out_index_o  (vru_data[v][VruPixelBits-1:$bits(pixel_t)]),
      .out_pixel_o  (vru_data[v][$bits(pixel_t)-1:0])
    );
  end

  if (VrusPerChannel == 1) begin : gen_one
    assign out_valid_o            = vru_valid[0];
    assign vru_ready[0]           = out_ready_i;
    assign {out_index, out_pixel} = vru_data[0];
  end else begin : gen_several
    logic [$clog2(VrusPerChannel)-1:0] out_vru;
    logic [VruPixelBits-1:0] out_vru_data;

    flk_stream_arbiter #(
      .Inputs(VrusPerChannel),
      .Width (VruPixelBits)
    ) i_arbiter (
      .clk_i,
      .rst_ni,
      .clear_i,
      .in_valid_i (vru_valid),
      .in_ready_o (vru_ready),
      .in_data_i  (vru_data),
      .out_valid_o,
      .out_ready_i,
      .out_data_o (out_vru_data),
      .out_index_o(out_vru)
    );

    assign {out_index, out_pixel} = {out_vru, out_vru_data};
  end

  assign out_data_o = '{
    subtile: subtile_q,
    index: out_index,
    pixel: out_pixel
  };

  // ---- Counters ------------------------------------------------------------------------------------------------

  // Program order: flags before the first pixel of a splat, the VRUs being in step.
  always_comb begin
    events_o.fifo_full = !in_ready_o;
    events_o.vru_busy  = issue;
    events_o.sent      = blend_valid[0] && (blend_pixel[0] == '0) && !(&finished);
    events_o.discarded = drop;
    events_o.finished  = '0;
    for (int unsigned v = 0; v < VrusPerChannel; v++) begin
      events_o.finished += 3'(finish[v]);
    end
  end

  // The VRUs are in step: the copies of all but VRU 0 carry nothing new.
  logic unused_step;
  assign unused_step = ^{blend_valid, blend_pixel, blend_eos};

`ifndef SYNTHESIS
  // The stream of pixels; the arbiter holds its choice, the VRUs hold their pixels.
  assert property (@(posedge clk_i) disable iff (!rst_ni)
      out_valid_o && !out_ready_i && !clear_i |=> out_valid_o && $stable(out_data_o))
  else $error("flk_channel: pixel changed before its transfer");
`endif

endmodule
