// Finite FP16 number to an ff number, exact (docs/reference/ff.md). Combinational.
module flk_ff_from_fp16 #(
  parameter  int unsigned ManBits = 19,
  localparam int unsigned Width   = 9 + ManBits
) (
  input  logic [     15:0] x_i,
  output logic [Width-1:0] y_o
);

  if (ManBits < 10) begin : gen_check
    $error("flk_ff_from_fp16: ManBits must be at least 10");
  end

  logic sign;
  logic [4:0] exp;
  logic [9:0] man, normal, leading;
  logic [3:0] zeros;

  assign {sign, exp, man} = x_i;

  flk_lzc #(
    .Width(10)
  ) i_zeros (
    .value_i(man),
    .count_o(zeros)
  );

  // A subnormal number is man 2^-24: its leading bit goes off the top.
  assign normal = man << (zeros + 4'd1);

  assign leading = exp == '0 ? normal : man;

  always_comb begin
    if (exp == '0 && man == '0) begin
      y_o = '0;
    end else begin
      y_o = {sign, exp == '0 ? 8'd112 - 8'(zeros) : 8'(exp) + 8'd112,
             ManBits'(leading) << (ManBits - 10)};
    end
  end

endmodule
