// Stand-in of flk_exp_neg for proofs of control: the result is not driven, so the solver may choose
// it.
module flk_exp_neg #(
  parameter bit Base2 = 1'b1
) (
  input  logic [15:0] e_i,
  output logic [15:0] g_o
);
endmodule
