// Stand-in of flk_fp_convert for proofs of control: hands on the lowest bits.
module flk_fp_convert #(
  parameter  int unsigned SrcExpBits  = 5,
  parameter  int unsigned SrcManBits  = 10,
  parameter  bit          SrcFn       = 1'b0,
  parameter  int unsigned DstExpBits  = 4,
  parameter  int unsigned DstManBits  = 3,
  parameter  bit          DstFn       = 1'b1,
  parameter  bit          DstSaturate = 1'b1,
  localparam int unsigned SrcWidth    = 1 + SrcExpBits + SrcManBits,
  localparam int unsigned DstWidth    = 1 + DstExpBits + DstManBits
) (
  input  logic [SrcWidth-1:0] src_i,
  output logic [DstWidth-1:0] dst_o
);
  assign dst_o = DstWidth'(src_i);
endmodule
