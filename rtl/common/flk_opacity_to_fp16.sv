// Opacity code / 255 to FP16, nearest (docs/reference/record_to_splat.md). Combinational.
//
// The quotient is the eight bits of the code, repeated without end behind the point. What follows the rounding bit is
// never 0, so that bit alone decides.
module flk_opacity_to_fp16
  import flk_pkg::*;
(
  input  logic  [7:0] code_i,
  output fp16_t       opacity_o
);

  logic [3:0] zeros;
  logic [10:0] normal;  // behind the leading one: mantissa and rounding bit
  logic [14:0] rounded;

  flk_lzc #(
    .Width(8)
  ) i_zeros (
    .value_i(code_i),
    .count_o(zeros)
  );

  assign normal    = 11'(({3{code_i}} << zeros) >> 12);
  assign rounded   = {5'd14 - 5'(zeros), normal[10:1]} + 15'(normal[0]);
  assign opacity_o = (code_i == '0) ? '0 : {1'b0, rounded};

endmodule
