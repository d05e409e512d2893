// Shape number of a record: 5 bits of exponent (bias 30) above 9 of mantissa, rounded to nearest even
// from the magnitude of an ff number; too small is 0, too large the largest (docs/reference/front_end.md).
// Combinational.
module flk_shape_field #(
  parameter int unsigned ManBits = 11
) (
  input  logic [ManBits+8:0] x_i,
  output logic [13:0]        field_o
);

  localparam int unsigned FIELD_MAN_BITS = 9;
  localparam int unsigned BIAS = 127 - 30;

  if (ManBits <= FIELD_MAN_BITS) begin : gen_check
    $error("flk_shape_field: ManBits must be more than 9");
  end

  logic [FIELD_MAN_BITS+8:0] narrow;
  logic [7:0] exp;
  logic [FIELD_MAN_BITS-1:0] man;
  logic unused_sign;

  flk_ff_narrow #(
    .FromBits(ManBits),
    .ManBits (FIELD_MAN_BITS)
  ) i_narrow (
    .x_i,
    .y_o(narrow)
  );

  assign {unused_sign, exp, man} = narrow;

  always_comb begin
    if (exp <= 8'(BIAS)) begin
      field_o = '0;
    end else if (exp > 8'(BIAS + 31)) begin
      field_o = '1;
    end else begin
      field_o = {5'(exp - 8'(BIAS)), man};
    end
  end

endmodule
