// Rendering stage: four CTUs and rendering cores, together one 16x16 tile, with performance counters.
// 32 VRUs, or 16 or 64 with VrusPerChannel 1 or 4; the picture is the same.
//
// Core k takes the sorted lists of the sub-tiles in column k % 2, row k / 2 of each tile, one stream per core; each list ends with a
// token that carries the sub-tile's position. The cores run independently: no barrier between tiles.
// Finished pixels leave on one stream per core.
module flk_render_stage
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form           = FORM_FACTORED,
  parameter int unsigned Precision      = PRECISION_FIXED,
  parameter int unsigned FifoDepth      = FIFO_DEPTH,
  parameter int unsigned CtuFifoDepth   = CTU_FIFO_DEPTH,
  parameter int unsigned VrusPerChannel = VRUS_PER_CHANNEL  // 1, 2 or 4
) (
  input  logic                    clk_i,
  input  logic                    rst_ni,
  input  logic        [2:0]       mode_i,            // CAT_*; constant during a frame
  input  logic                    clear_counters_i,
  // sorted lists
  input  logic        [CORES-1:0] in_valid_i,
  output logic        [CORES-1:0] in_ready_o,
  input  splat_elem_t [CORES-1:0] in_elem_i,
  // finished pixels
  output logic        [CORES-1:0] out_valid_o,
  input  logic        [CORES-1:0] out_ready_i,
  output core_pixel_t [CORES-1:0] out_data_o,
  // counters, read at any time
  output logic        [CORES-1:0][COUNTERS_PER_CORE-1:0][COUNTER_BITS-1:0] counters_o
);

  for (genvar k = 0; k < CORES; k++) begin : gen_core
    logic ctu_valid, ctu_ready, stall;
    feature_elem_t ctu_elem;
    logic [CHANNELS-1:0] ctu_mask;
    ctu_events_t ctu_events;
    dispatch_events_t dispatch_events;
    channel_events_t [CHANNELS-1:0] channel_events;

    flk_ctu #(
      .Form        (Form),
      .Precision   (Precision),
      .VruCycles   (MINITILE * MINITILE / VrusPerChannel),
      .CtuFifoDepth(CtuFifoDepth)
    ) i_ctu (
      .clk_i,
      .rst_ni,
      .mode_i,
      .stall_i    (stall),
      .in_valid_i (in_valid_i[k]),
      .in_ready_o (in_ready_o[k]),
      .in_elem_i  (in_elem_i[k]),
      .out_valid_o(ctu_valid),
      .out_ready_i(ctu_ready),
      .out_elem_o (ctu_elem),
      .out_mask_o (ctu_mask),
      .events_o   (ctu_events)
    );

    flk_rendering_core #(
      .Form          (Form),
      .FifoDepth     (FifoDepth),
      .VrusPerChannel(VrusPerChannel)
    ) i_core (
      .clk_i,
      .rst_ni,
      .in_valid_i       (ctu_valid),
      .in_ready_o       (ctu_ready),
      .in_elem_i        (ctu_elem),
      .in_mask_i        (ctu_mask),
      .stall_o          (stall),
      .out_valid_o      (out_valid_o[k]),
      .out_ready_i      (out_ready_i[k]),
      .out_data_o       (out_data_o[k]),
      .dispatch_events_o(dispatch_events),
      .channel_events_o (channel_events)
    );

    flk_perf_counters i_counters (
      .clk_i,
      .rst_ni,
      .clear_i          (clear_counters_i),
      .ctu_events_i     (ctu_events),
      .dispatch_events_i(dispatch_events),
      .channel_events_i (channel_events),
      .counters_o       (counters_o[k])
    );
  end

endmodule
