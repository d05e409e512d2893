// Power of two of a fixed-point number to an ff number, pipelined (docs/reference/ff.md).
//
// l_i is in two's complement with FracBits fraction bits. Too large a result is the largest number, one below 2^-126 is 0.
// Exponent beside flk_ff_poly; pack.
//
// Stages registers (= latency): 0 none, 1 at the output, more also inside of flk_ff_poly, 4 at most. Registers load while en_i is high and are not
// reset.
module flk_ff_exp2
  import flk_ff_table_pkg::*;
#(
  parameter  int unsigned ManBits  = 19,
  parameter  int unsigned IntBits  = 7,  // with the sign
  parameter  int unsigned FracBits = 12,
  parameter  int unsigned Stages   = 3,
  localparam int unsigned Width    = 9 + ManBits
) (
  input  logic                        clk_i,
  input  logic                        en_i,
  input  logic [IntBits+FracBits-1:0] l_i,
  output logic [           Width-1:0] y_o
);

  if (IntBits < 2 || IntBits > 16 || FracBits < 1 || FracBits > 14) begin : gen_check_size
    $error("flk_ff_exp2: IntBits must be 2 to 16, FracBits 1 to 14");
  end

  localparam int unsigned Group = (ManBits <= 11) ? 0 : (ManBits - 8) / 4;
  localparam int unsigned ArgBits = 32'(ARG_BITS[EXP2][Group]);
  localparam int unsigned ExpBits = ((IntBits > 8) ? IntBits : 8) + 2;  // signed

  logic [IntBits-1:0] whole;
  logic [FracBits-1:0] fraction;
  logic [ManBits+1:0] value;

  assign {whole, fraction} = l_i;

  flk_ff_poly #(
    .Function(EXP2),
    .ManBits (ManBits),
    .Stages  (Stages)
  ) i_poly (
    .clk_i,
    .en_i,
    .odd_i  (1'b0),
    .arg_i  (ArgBits'(fraction) << (ArgBits - FracBits)),
    .value_o(value)
  );

  logic [IntBits-1:0] whole_q;

  flk_delay #(
    .Width(IntBits),
    .Depth((Stages >= 2) ? Stages - 1 : 0)
  ) i_side (
    .clk_i,
    .en_i,
    .d_i({whole}),
    .q_o({whole_q})
  );

  // value is in [1, 2]; 2 by rounding.
  logic signed [ExpBits-1:0] exp;
  logic [Width-1:0] result;

  assign exp = ExpBits'($signed(whole_q)) + ExpBits'(127) + ExpBits'(value[ManBits+1]);

  always_comb begin
    if (exp <= 0) begin
      result = '0;
    end else if (exp > 254) begin
      result = {1'b0, 8'd254, {ManBits{1'b1}}};
    end else begin
      result = {1'b0, exp[7:0], value[ManBits-1:0]};
    end
  end

  logic unused_value;
  assign unused_value = value[ManBits];  // the leading bit

  flk_delay #(
    .Width(Width),
    .Depth(32'(Stages >= 1))
  ) i_y (
    .clk_i,
    .en_i,
    .d_i(result),
    .q_o(y_o)
  );

endmodule
