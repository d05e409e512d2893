// Floating-point less-than (docs/reference/arithmetic.md).
//
// Combinational. lt_o is a_i < b_i; -0 equals +0, and a NaN is neither less nor greater.
module flk_fp_cmp #(
  parameter  int unsigned ExpBits = 5,
  parameter  int unsigned ManBits = 10,
  parameter  bit          Fn      = 1'b0,  // no infinity, NaN is all ones
  localparam int unsigned Width   = 1 + ExpBits + ManBits
) (
  input  logic [Width-1:0] a_i,
  input  logic [Width-1:0] b_i,
  output logic             lt_o
);

  if (ExpBits < 2 || ManBits < 1) begin : gen_check_size
    $error("flk_fp_cmp: ExpBits must be at least 2, ManBits at least 1");
  end

  typedef logic [Width-2:0] mag_t;

  // Largest bit pattern that is a number.
  localparam mag_t Top = Fn ? mag_t'(-2) : {{ExpBits{1'b1}}, {ManBits{1'b0}}};

  mag_t a_mag, b_mag;
  logic unordered, both_zero;
  logic signed [Width-1:0] a_key, b_key;

  assign a_mag     = a_i[Width-2:0];
  assign b_mag     = b_i[Width-2:0];
  assign unordered = (a_mag > Top) || (b_mag > Top);
  assign both_zero = (a_mag == '0) && (b_mag == '0);
  // Magnitudes of negative numbers inverted: two's-complement order, -0 just below +0.
  assign a_key     = {a_i[Width-1], a_mag ^ {Width - 1{a_i[Width-1]}}};
  assign b_key     = {b_i[Width-1], b_mag ^ {Width - 1{b_i[Width-1]}}};
  assign lt_o      = (a_key < b_key) && !both_zero && !unordered;

endmodule
