// Stand-in of flk_exp_neg_pipe for proofs of control: the result is not driven, so the solver may choose it.
module flk_exp_neg_pipe #(
  parameter bit          Base2  = 1'b1,
  parameter int unsigned Stages = 2
) (
  input  logic        clk_i,
  input  logic        en_i,
  input  logic [15:0] e_i,
  output logic [15:0] g_o
);
endmodule
