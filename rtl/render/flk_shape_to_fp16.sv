// Shape number of a record to FP16: 5 bits of exponent (bias 30) above 9 of mantissa, 0 for exponent 0
// (docs/reference/front_end.md). Exact from 2^-15 on; below it FP16 has fewer bits, and the nearest number is
// taken, ties to even. Exponent 0 needs no case of its own: shifted that far, any mantissa is 0.
// Combinational.
module flk_shape_to_fp16
  import flk_pkg::*;
(
  input  logic         negative_i,
  input  logic  [13:0] code_i,
  output fp16_t        shape_o
);

  localparam int unsigned MAN_BITS = 9;
  // Code of the exponents from 2^-15 on: the last place of such a number is FP16's smallest step.
  localparam int unsigned LOWEST = 15;
  localparam int unsigned MAX_DROP = LOWEST - 1;

  logic [4:0] exp;
  logic [MAN_BITS-1:0] man;
  logic [3:0] drop;
  // Mantissa with its leading one, above what a shift to the right drops: a guard bit, the others below it.
  logic [MAN_BITS+MAX_DROP:0] full, shifted;
  logic [MAN_BITS:0] subnormal;
  logic round_up;

  assign {exp, man} = code_i;
  assign drop       = 4'(LOWEST) - exp[3:0];
  assign full       = {1'b1, man, {MAX_DROP{1'b0}}};
  assign shifted    = full >> drop;
  assign round_up   = shifted[MAX_DROP-1] && ((|shifted[MAX_DROP-2:0]) || shifted[MAX_DROP]);
  assign subnormal  = shifted[MAN_BITS+MAX_DROP:MAX_DROP] + (MAN_BITS + 1)'(round_up);

  assign shape_o = {
    negative_i, (exp > 5'(LOWEST)) ? {exp - 5'(LOWEST), man, 1'b0} : {5'd0, subnormal}
  };

endmodule
