// Ff number to a shorter mantissa: round to nearest even, saturating (docs/reference/ff.md). Combinational.
module flk_ff_narrow #(
  parameter  int unsigned FromBits = 23,
  parameter  int unsigned ManBits  = 13
) (
  input  logic [FromBits+8:0] x_i,
  output logic [ ManBits+8:0] y_o
);

  if (ManBits >= FromBits) begin : gen_check
    $error("flk_ff_narrow: ManBits must be less than FromBits");
  end

  localparam int unsigned Drop = FromBits - ManBits;
  localparam logic [ManBits+7:0] TOP = {8'd254, {ManBits{1'b1}}};

  logic [ManBits+7:0] code;
  logic half, rest, round_up;

  assign code = x_i[FromBits+7:Drop];
  assign half = x_i[Drop-1];
  assign round_up = half && (rest || code[0]);

  if (Drop > 1) begin : gen_rest
    assign rest = |x_i[Drop-2:0];
  end else begin : gen_no_rest
    assign rest = 1'b0;
  end

  // A carry out of the mantissa raises the exponent; it must not from the largest number.
  assign y_o = {x_i[FromBits+8], (round_up && code == TOP) ? TOP : code + (ManBits + 8)'(round_up)};

endmodule
