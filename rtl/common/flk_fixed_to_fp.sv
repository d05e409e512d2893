// Fixed point (sign and magnitude) to a floating-point format, round to nearest even (docs/reference/arithmetic.md).
//
// Combinational. mag_i has FracBits fraction bits. Fn: no infinity, NaN is all ones (E4M3). Saturate: what is too large becomes the
// largest finite number, else infinity. Zero is +0 whatever the sign.
module flk_fixed_to_fp #(
  parameter  int unsigned MagBits  = 18,
  parameter  int unsigned FracBits = 8,
  parameter  int unsigned ExpBits  = 4,
  parameter  int unsigned ManBits  = 3,
  parameter  bit          Fn       = 1'b1,
  parameter  bit          Saturate = 1'b1,
  localparam int unsigned Width    = 1 + ExpBits + ManBits
) (
  input  logic               sign_i,
  input  logic [MagBits-1:0] mag_i,
  output logic [Width-1:0]   dst_o
);

  localparam int unsigned BIAS = 2 ** (ExpBits - 1) - 1;
  // Biased exponent of the top bit.
  localparam int unsigned TOP_EXP = BIAS + MagBits - 1 - FracBits;
  // Normalisation ends at the smallest exponent: what remains is subnormal.
  localparam int unsigned MAX_SHIFT = (TOP_EXP - 1 < MagBits - 1) ? TOP_EXP - 1 : MagBits - 1;
  localparam int unsigned ShiftBits = $clog2(MAX_SHIFT + 1);
  localparam int unsigned CodeBits = ExpBits + ManBits;

  if (Fn && !Saturate) begin : gen_check_saturate
    $error("flk_fixed_to_fp: Fn has no infinity, so Saturate must be set");
  end
  if (MagBits < ManBits + 3 || BIAS + MagBits < FracBits + 2) begin : gen_check_size
    $error("flk_fixed_to_fp: the format must be coarser than the fixed-point number at its top");
  end

  localparam logic [CodeBits-1:0] INF_CODE = {{ExpBits{1'b1}}, {ManBits{1'b0}}};
  // First code that is not a finite number.
  localparam logic [CodeBits-1:0] LIMIT = Fn ? '1 : INF_CODE;
  localparam logic [CodeBits-1:0] OVERFLOW = Saturate ? LIMIT - 1'b1 : INF_CODE;

  logic [ShiftBits-1:0] shift;
  logic [MagBits-1:0] normal;
  logic [ExpBits:0] exp;
  logic [CodeBits:0] truncated, rounded;
  logic round_up;

  flk_lzc #(
    .Width(MAX_SHIFT)
  ) i_shift (
    .value_i(mag_i[MagBits-1-:MAX_SHIFT]),
    .count_o(shift)
  );

  assign normal = mag_i << shift;
  assign exp = normal[MagBits-1] ? (ExpBits + 1)'(TOP_EXP) - (ExpBits + 1)'(shift) : '0;
  assign truncated = {exp, normal[MagBits-2-:ManBits]};
  assign round_up = normal[MagBits-2-ManBits]
                 && ((|normal[MagBits-3-ManBits:0]) || normal[MagBits-1-ManBits]);
  assign rounded = truncated + (CodeBits + 1)'(round_up);
  assign dst_o = (rounded >= {1'b0, LIMIT}) ? {sign_i, OVERFLOW}
               : {sign_i && (mag_i != '0), rounded[CodeBits-1:0]};

endmodule
