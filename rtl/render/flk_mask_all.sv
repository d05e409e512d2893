// Mask generator without a test: every splat goes to all mini-tiles, or with MaskBits 64 to all pixels.
//
// in  splat_elem_t, one list per sub-tile, each closed by a token (eos).
// out the same elements in the same order, as feature_elem_t below a mask of ones.
// Latency 1, throughput 1 per cycle: one register slice. `stall_i` (a feature FIFO is full) stops acceptance, not the output.
// in_ready_o depends combinationally on stall_i and out_ready_i; out_valid_o, out_data_o and idle_o come from registers.
//
// One of the mask generators of flk_mask_generator, whose ports these are (docs/reference/mask_generators.md); it knows one mode, CAT_OFF.
module flk_mask_all
  import flk_pkg::*;
  import flk_param_pkg::*;
#(
  parameter  int unsigned MaskBits       = CHANNELS,  // CHANNELS, or the pixels of a sub-tile
  localparam int unsigned MaskedElemBits = MaskBits + FEATURE_ELEM_BITS
) (
  input  logic                      clk_i,
  input  logic                      rst_ni,
  input  logic                      clear_i,
  output logic                      idle_o,       // nothing inside
  input  logic [2:0]                mode_i,
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

  if (MaskBits != CHANNELS && MaskBits != SUBTILE * SUBTILE) begin : gen_check_mask
    $error("flk_mask_all: MaskBits must be 4 (mini-tiles) or 64 (pixels)");
  end

  typedef struct packed {
    logic [MaskBits-1:0] mask;
    feature_elem_t       elem;
  } masked_elem_t;

  logic slice_ready, accept;
  feature_elem_t elem;
  masked_elem_t masked;

  assign in_ready_o = slice_ready && !stall_i;
  assign accept     = in_valid_i && in_ready_o;

  flk_pipe_reg #(
    .Width(FEATURE_ELEM_BITS)
  ) i_slice (
    .clk_i,
    .rst_ni,
    .clear_i,
    .in_valid_i (in_valid_i && !stall_i),
    .in_ready_o (slice_ready),
    .in_data_i  ({in_elem_i.eos, in_elem_i.splat.feature}),
    .out_valid_o,
    .out_ready_i,
    .out_data_o (elem)
  );

  assign masked.mask = '1;
  assign masked.elem = elem;
  assign out_data_o  = masked;
  assign idle_o      = !out_valid_o;

  // ---- Counters: "tested" are the mini-tiles of the mask ------------------------------------------------

  always_comb begin
    events_o = '0;
    events_o.busy    = accept;
    events_o.stalled = in_valid_i && !accept;
    events_o.idle    = !in_valid_i;
    events_o.token   = accept && in_elem_i.eos;
    events_o.splat   = accept && !in_elem_i.eos;
    events_o.tested  = events_o.splat ? 3'(CHANNELS) : '0;
  end

  // No test: neither the mode nor the shape of a splat matters.
  logic unused;
  assign unused = ^{mode_i, in_elem_i.splat.spiky};

endmodule
