// Rendering stage: four mask generators and rendering cores, together one 16x16 tile, with performance counters.
// 32 VRUs, or 16 or 64 with VrusPerChannel 1 or 4; the picture is the same.
//
// Core k takes the sorted lists of the sub-tiles in column k % 2, row k / 2 of each tile, one stream per core; each list ends with a
// token that carries the sub-tile's position. The cores run independently: no barrier between tiles.
// Finished pixels leave on one stream per core.
//
// Frames. idle_o: every list taken is complete and all its pixels have left. While the stage is idle it follows mode_i, from the first
// element on it keeps the mode that the element came with. An element that comes together with a new mode waits one cycle.
// clear_i (any number of cycles) aborts: nothing is taken while it is high, pixels that have not left are gone, and in the cycle after it the
// stage is as after reset, except for the counters.
//
// finished_o: of each core, about the sub-tile of the element that in_* takes: its splats change no picture any more, up to the token
// they need not come. It rises some cycles after the last pixel has finished, and is low in the cycle after the token was taken until it
// holds for the next sub-tile. In the automatic mode of the CTU it stays low: all splats of a list count in its decisions.
//
// Counters: one is read at a time, COUNTER_LATENCY cycles after its address (core, then index CNT_*). They stand still while
// hold_counters_i is high.
//
// Combinational paths: in_ready_o depends on in_elem_i, in_valid_i of the same core, mode_i, clear_i and, in some builds, on nothing else;
// out_valid_o, out_data_o, idle_o, finished_o and counter_data_o come from registers.
module flk_render_stage
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form           = FORM_FACTORED,
  parameter int unsigned Precision      = PRECISION_FIXED,
  parameter int unsigned FifoDepth      = FIFO_DEPTH,
  parameter int unsigned CtuFifoDepth   = CTU_FIFO_DEPTH,
  parameter int unsigned VrusPerChannel = VRUS_PER_CHANNEL,  // 1, 2 or 4
  parameter int unsigned MaskGenerator  = MASK_GENERATOR_CTU
) (
  input  logic                    clk_i,
  input  logic                    rst_ni,
  input  logic                    clear_i,
  output logic                    idle_o,
  input  logic              [2:0] mode_i,  // CAT_*
  // sorted lists
  input  logic        [CORES-1:0] in_valid_i,
  output logic        [CORES-1:0] in_ready_o,
  input  splat_elem_t [CORES-1:0] in_elem_i,
  output logic        [CORES-1:0] finished_o,
  // finished pixels
  output logic        [CORES-1:0] out_valid_o,
  input  logic        [CORES-1:0] out_ready_i,
  output core_pixel_t [CORES-1:0] out_data_o,
  // counters
  input  logic                         clear_counters_i,
  input  logic                         hold_counters_i,
  input  logic [COUNTER_ADDR_BITS-1:0] counter_addr_i,
  output logic      [COUNTER_BITS-1:0] counter_data_o
);

  if (Form > FORM_FACTORED) begin : gen_check_form
    $error("flk_render_stage: Form must be FORM_CONIC or FORM_FACTORED");
  end
  if (Precision > PRECISION_FIXED) begin : gen_check_precision
    $error("flk_render_stage: Precision must be one of PRECISION_*, 0 to 3");
  end
  if (FifoDepth < 1 || FifoDepth > 128) begin : gen_check_depth
    $error("flk_render_stage: FifoDepth must be 1 to 128");
  end
  if (CtuFifoDepth > 128) begin : gen_check_ctu_depth
    $error("flk_render_stage: CtuFifoDepth must be 0 (no output FIFO) to 128");
  end
  if (VrusPerChannel != 1 && VrusPerChannel != 2 && VrusPerChannel != 4) begin : gen_check_vrus
    $error("flk_render_stage: VrusPerChannel must be 1, 2 or 4");
  end
  if (MaskGenerator >= MASK_GENERATORS) begin : gen_check_generator
    $error("flk_render_stage: MaskGenerator must be one of MASK_GENERATOR_*");
  end

  localparam int unsigned MaskBits = 32'(MASK_BITS[MaskGenerator]);
  localparam int unsigned MaskedElemBits = MaskBits + FEATURE_ELEM_BITS;
  // Tokens in a mask generator: the CTU's pipeline holds one, its FIFO any number; a register slice two.
  localparam int unsigned TokenBits = $clog2(CtuFifoDepth + 4);

  logic [2:0] mode;
  logic all_count;  // splats of a finished sub-tile count in what becomes of later ones

  assign all_count = MaskGenerator == MASK_GENERATOR_CTU && mode == CAT_AUTO;

  logic [CORES-1:0] valid, ready, core_idle, in_eos;
  logic [CORES-1:0][COUNTER_BITS-1:0] counter;

  flk_stage_control i_control (
    .clk_i,
    .rst_ni,
    .clear_i,
    .mode_i,
    .mode_o        (mode),
    .idle_o,
    .in_valid_i,
    .in_ready_o,
    .in_eos_i      (in_eos),
    .valid_o       (valid),
    .ready_i       (ready),
    .idle_i        (core_idle),
    .counter_core_i(counter_addr_i[COUNTER_ADDR_BITS-1:COUNTER_INDEX_BITS]),
    .counter_i     (counter),
    .counter_data_o
  );

  for (genvar k = 0; k < CORES; k++) begin : gen_core
    logic masked_valid, masked_ready, stall;
    logic generator_idle, rendering_idle;
    logic [MaskedElemBits-1:0] masked;
    generator_events_t generator_events;
    dispatch_events_t dispatch_events;
    channel_events_t [CHANNELS-1:0] channel_events;
    logic core_finished, token_in, token_out;
    logic [TokenBits-1:0] tokens_q;  // in the mask generator

    assign in_eos[k]    = in_elem_i[k].eos;
    assign core_idle[k] = generator_idle && rendering_idle;

    // The core speaks of the sub-tile at its own input, which is that of in_* when no token lies between.
    assign token_in      = valid[k] && ready[k] && in_elem_i[k].eos;
    assign token_out     = masked_valid && masked_ready && masked[FEATURE_ELEM_BITS-1];  // eos
    assign finished_o[k] = core_finished && tokens_q == '0 && !all_count;

    always_ff @(posedge clk_i or negedge rst_ni) begin
      if (!rst_ni) begin
        tokens_q <= '0;
      end else if (clear_i) begin
        tokens_q <= '0;
      end else begin
        tokens_q <= tokens_q + TokenBits'(token_in) - TokenBits'(token_out);
      end
    end

    flk_mask_generator #(
      .MaskGenerator(MaskGenerator),
      .Form         (Form),
      .Precision    (Precision),
      .VruCycles    (MINITILE * MINITILE / VrusPerChannel),
      .CtuFifoDepth (CtuFifoDepth)
    ) i_generator (
      .clk_i,
      .rst_ni,
      .clear_i,
      .idle_o     (generator_idle),
      .mode_i     (mode),
      .stall_i    (stall),
      .in_valid_i (valid[k]),
      .in_ready_o (ready[k]),
      .in_elem_i  (in_elem_i[k]),
      .out_valid_o(masked_valid),
      .out_ready_i(masked_ready),
      .out_data_o (masked),
      .events_o   (generator_events)
    );

    flk_rendering_core #(
      .Form          (Form),
      .FifoDepth     (FifoDepth),
      .VrusPerChannel(VrusPerChannel),
      .MaskBits      (MaskBits)
    ) i_core (
      .clk_i,
      .rst_ni,
      .clear_i,
      .idle_o           (rendering_idle),
      .in_valid_i       (masked_valid),
      .in_ready_o       (masked_ready),
      .in_data_i        (masked),
      .stall_o          (stall),
      .finished_o       (core_finished),
      .out_valid_o      (out_valid_o[k]),
      .out_ready_i      (out_ready_i[k]),
      .out_data_o       (out_data_o[k]),
      .dispatch_events_o(dispatch_events),
      .channel_events_o (channel_events)
    );

    flk_perf_counters i_counters (
      .clk_i,
      .rst_ni,
      .clear_i           (clear_counters_i),
      .hold_i            (hold_counters_i),
      .generator_events_i(generator_events),
      .dispatch_events_i (dispatch_events),
      .channel_events_i  (channel_events),
      .addr_i            (counter_addr_i[COUNTER_INDEX_BITS-1:0]),
      .data_o            (counter[k])
    );

`ifndef SYNTHESIS
    assert property (@(posedge clk_i) disable iff (!rst_ni)
        in_valid_i[k] && !in_ready_o[k] && !clear_i |=>
        clear_i || (in_valid_i[k] && $stable(in_elem_i[k])))
    else $error("flk_render_stage: element changed before its transfer");

    assert property (@(posedge clk_i) disable iff (!rst_ni)
        !clear_i |-> (tokens_q != '0 || !token_out) && (!(&tokens_q) || !token_in || token_out))
    else $error("flk_render_stage: number of tokens");
`endif
  end

endmodule
