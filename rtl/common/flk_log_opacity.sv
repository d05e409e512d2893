// Threshold of the contribution test, combinational: `flk_log_opacity_pipe` without registers.
module flk_log_opacity #(
  parameter  bit          Base2    = 1'b1,  // log2, else ln
  parameter  int unsigned ExpBits  = 5,
  parameter  int unsigned ManBits  = 10,
  parameter  bit          Fn       = 1'b0,  // no infinity, NaN is all ones
  parameter  bit          Saturate = 1'b0,  // of no effect: the result is always finite
  localparam int unsigned Width    = 1 + ExpBits + ManBits
) (
  input  logic [     15:0] opacity_i,
  output logic [Width-1:0] log_o
);

  flk_log_opacity_pipe #(
    .Base2   (Base2),
    .ExpBits (ExpBits),
    .ManBits (ManBits),
    .Fn      (Fn),
    .Saturate(Saturate),
    .Stages  (0)
  ) i_log (
    .clk_i(1'b0),
    .en_i (1'b0),
    .opacity_i,
    .log_o
  );

endmodule
