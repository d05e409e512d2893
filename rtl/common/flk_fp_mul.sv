// Floating-point multiplier, combinational: `flk_fp_mul_pipe` without registers.
module flk_fp_mul #(
  parameter int unsigned ExpBits  = 5,
  parameter int unsigned ManBits  = 10,
  parameter bit          Fn       = 1'b0,
  parameter bit          Saturate = 1'b0,
  localparam int unsigned Width   = 1 + ExpBits + ManBits
) (
  input  logic [Width-1:0] a_i,
  input  logic [Width-1:0] b_i,
  output logic [Width-1:0] prod_o
);

  flk_fp_mul_pipe #(
    .ExpBits (ExpBits),
    .ManBits (ManBits),
    .Fn      (Fn),
    .Saturate(Saturate),
    .Stages  (0)
  ) i_mul (
    .clk_i(1'b0),
    .en_i (1'b0),
    .a_i,
    .b_i,
    .prod_o
  );

endmodule
