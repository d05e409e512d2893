// Comparison of ff numbers (docs/reference/ff.md). Combinational.
module flk_ff_cmp #(
  parameter  int unsigned ManBits = 19,
  localparam int unsigned Width   = 9 + ManBits
) (
  input  logic [Width-1:0] a_i,
  input  logic [Width-1:0] b_i,
  output logic             lt_o
);

  logic signed [Width-1:0] a_key, b_key;

  // Magnitudes of negative numbers inverted: two's-complement order.
  assign a_key = {a_i[Width-1], a_i[Width-2:0] ^ {Width - 1{a_i[Width-1]}}};
  assign b_key = {b_i[Width-1], b_i[Width-2:0] ^ {Width - 1{b_i[Width-1]}}};
  assign lt_o  = a_key < b_key;

endmodule
