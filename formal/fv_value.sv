// What the bits of a floating-point number mean, as an integer: the magnitude in units of the
// smallest subnormal number. Infinity counts as the power of two that would follow.
module fv_value #(
  parameter  int unsigned ExpBits   = 5,
  parameter  int unsigned ManBits   = 10,
  localparam int unsigned MagBits   = ExpBits + ManBits,
  // Hidden bit and mantissa, shifted by the largest exponent less 1.
  localparam int unsigned ValueBits = ManBits + 1 + (1 << ExpBits) - 2
) (
  input  logic [  MagBits-1:0] mag_i,
  output logic [ValueBits-1:0] value_o
);

  logic [ExpBits-1:0] exponent;
  logic [ManBits-1:0] mantissa;

  assign {exponent, mantissa} = mag_i;
  assign value_o = exponent == '0 ? ValueBits'(mantissa)
                                  : ValueBits'({1'b1, mantissa}) << (exponent - 1'b1);

endmodule
