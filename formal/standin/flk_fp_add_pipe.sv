// Stand-in of flk_fp_add_pipe for proofs of control: the result is not driven, so the solver may choose it.
module flk_fp_add_pipe #(
  parameter  int unsigned ExpBits  = 5,
  parameter  int unsigned ManBits  = 10,
  parameter  bit          Fn       = 1'b0,
  parameter  bit          Saturate = 1'b0,
  parameter  bit          Cancel   = 1'b1,
  parameter  int unsigned Stages   = 2,
  localparam int unsigned Width    = 1 + ExpBits + ManBits
) (
  input  logic             clk_i,
  input  logic             en_i,
  input  logic [Width-1:0] a_i,
  input  logic [Width-1:0] b_i,
  output logic [Width-1:0] sum_o
);
endmodule
