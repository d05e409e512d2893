// Exponential of a negated FP16 number, combinational: `flk_exp_neg_pipe` without registers.
module flk_exp_neg #(
  parameter bit Base2 = 1'b1  // 2^-E, else e^-E
) (
  input  logic [15:0] e_i,
  output logic [15:0] g_o
);

  flk_exp_neg_pipe #(
    .Base2 (Base2),
    .Stages(0)
  ) i_exp (
    .clk_i(1'b0),
    .en_i (1'b0),
    .e_i,
    .g_o
  );

endmodule
