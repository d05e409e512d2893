// Simulation top of the rendering stage: stream elements padded to whole 32-bit words for the C++ harness.
module flk_render_sim_top
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter int unsigned Form           = FORM_FACTORED,
  parameter int unsigned Precision      = PRECISION_FIXED,
  parameter int unsigned FifoDepth      = FIFO_DEPTH,
  parameter int unsigned CtuFifoDepth   = CTU_FIFO_DEPTH,
  parameter int unsigned VrusPerChannel = VRUS_PER_CHANNEL  // 1, 2 or 4
) (
  input  logic                   clk_i,
  input  logic                   rst_ni,
  input  logic [2:0]             mode_i,
  input  logic [CORES-1:0]       in_valid_i,
  output logic [CORES-1:0]       in_ready_o,
  // word 0..4: feature_t (144 bits) in the low bits, bit 144 spiky, bit 145 end of sub-tile
  input  logic [CORES-1:0][159:0] in_elem_i,
  output logic [CORES-1:0]       out_valid_o,
  input  logic [CORES-1:0]       out_ready_i,
  // core_pixel_t in the low bits
  output logic [CORES-1:0][95:0] out_data_o,
  output logic [CORES-1:0][COUNTERS_PER_CORE-1:0][COUNTER_BITS-1:0] counters_o
);

  splat_elem_t [CORES-1:0] elem;
  core_pixel_t [CORES-1:0] pixel;
  logic [CORES-1:0][159-SPLAT_ELEM_BITS:0] unused_elem;

  for (genvar k = 0; k < CORES; k++) begin : gen_words
    assign {unused_elem[k], elem[k]} = in_elem_i[k];
    assign out_data_o[k] = 96'(pixel[k]);
  end

  flk_render_stage #(
    .Form          (Form),
    .Precision     (Precision),
    .FifoDepth     (FifoDepth),
    .CtuFifoDepth  (CtuFifoDepth),
    .VrusPerChannel(VrusPerChannel)
  ) i_stage (
    .clk_i,
    .rst_ni,
    .mode_i,
    .clear_counters_i(1'b0),
    .in_valid_i,
    .in_ready_o,
    .in_elem_i       (elem),
    .out_valid_o,
    .out_ready_i,
    .out_data_o      (pixel),
    .counters_o
  );

endmodule
