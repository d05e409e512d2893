// FP16 to fixed point: sign and magnitude with IntBits.FracBits, round to nearest even (docs/reference/arithmetic.md).
//
// Combinational. What is too large, infinity and NaN included, becomes the largest magnitude. The sign of zero is kept.
module flk_fp_to_fixed #(
  parameter  int unsigned IntBits  = 9,
  parameter  int unsigned FracBits = 8,
  localparam int unsigned MagBits  = IntBits + FracBits
) (
  input  logic [       15:0] src_i,
  output logic               sign_o,
  output logic [MagBits-1:0] mag_o
);

  if (FracBits < 1 || FracBits > 14 || IntBits < 1 || IntBits > 14) begin : gen_check_size
    $error("flk_fp_to_fixed: IntBits and FracBits must be 1 to 14");
  end

  // The significand is a multiple of 2^-24: that many bits less FracBits are dropped after a left shift by exponent - 1.
  localparam int unsigned DropBits = 24 - FracBits;
  localparam int unsigned FieldBits = MagBits + DropBits;
  // The first exponent of a number that does not fit.
  localparam logic [4:0] BIG = 5'(15 + IntBits);

  logic [4:0] exponent, effective;
  logic [9:0] mantissa;
  logic [FieldBits-1:0] field;
  logic [MagBits:0] rounded;
  logic round_up;

  assign {sign_o, exponent, mantissa} = src_i;
  assign effective = exponent | 5'(exponent == '0);
  assign field = FieldBits'({exponent != '0, mantissa}) << (effective - 5'd1);
  assign round_up = field[DropBits-1] && ((|field[DropBits-2:0]) || field[DropBits]);
  assign rounded = (MagBits + 1)'(field[FieldBits-1:DropBits]) + (MagBits + 1)'(round_up);
  assign mag_o = (exponent >= BIG || rounded[MagBits]) ? '1 : rounded[MagBits-1:0];

endmodule
