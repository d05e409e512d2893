// Exponential of a negated FP16 number, pipelined: g = 2^-E or e^-E, FP16 (docs/reference/arithmetic.md).
//
// Fixed point, one table with linear interpolation, one rounding; error below 0.73 ulp, monotone, exactly 1 for E = 0.
// Results below the smallest normal number are +0; so is the result of a set sign bit or a NaN.
// Multiply by log2(e) (not in base 2) | align | interpolate, round.
//
// Stages registers (= latency): 0 none, 1 at the output, 2 also at the second bar above, 3 at both bars (not in base 2). Registers load while
// en_i is high and are not reset.
module flk_exp_neg_pipe #(
  parameter bit          Base2  = 1'b1,  // 2^-E, else e^-E
  parameter int unsigned Stages = 2
) (
  input  logic        clk_i,
  input  logic        en_i,
  input  logic [15:0] e_i,
  output logic [15:0] g_o
);

  if (Stages > (Base2 ? 2 : 3)) begin : gen_check_stages
    $error("flk_exp_neg_pipe: Stages must be 0 to 3, 0 to 2 in base 2");
  end

  import flk_table_pkg::*;

  // x in [0, 32) with the fraction bits of the table package.
  localparam int unsigned FixedBits = 5 + EXP_FRAC_BITS;
  // 2^-f with its fraction bits, 1 included.
  localparam int unsigned ValueBits = EXP_VALUE_BITS + 1;
  // 2^-f >= 1/2 is rounded to 11 fraction bits: 10 and the hidden one.
  localparam int unsigned DropBits = EXP_VALUE_BITS - 11;

  // Unpack

  logic       sign;
  logic [4:0] exponent;
  logic [9:0] mantissa;

  assign {sign, exponent, mantissa} = e_i;

  // Special cases: 16 and more, which includes infinity and NaN; the result of 2^-16 is 0

  logic is_big;

  assign is_big = (exponent > 5'd18);

  // Multiply by log2(e) and place as if E were in [8, 16). A subnormal gets a hidden bit it does
  // not have: it lies below the last bit of x either way.

  logic [FixedBits-1:0] placed;

  if (Base2) begin : gen_base2
    assign placed = {1'b0, 1'b1, mantissa, {FixedBits - 12{1'b0}}};
  end else begin : gen_natural
    // 11 bits of significand and those of the constant.
    localparam int unsigned ProductBits = 11 + EXP_LOG2E_BITS + 1;
    // The product has 7 + EXP_LOG2E_BITS fraction bits when E is in [8, 16).
    localparam int unsigned ProductDrop = 7 + EXP_LOG2E_BITS - EXP_FRAC_BITS;
    logic [ProductBits-1:0] product;
    logic                   unused_product;
    assign product        = ProductBits'({1'b1, mantissa}) * ProductBits'(EXP_LOG2E);
    assign placed         = product[ProductDrop+:FixedBits];
    assign unused_product = ^product[ProductDrop-1:0];
  end

  logic                 zero, zero_q1, zero_q2;
  logic [          4:0] exponent_q1;
  logic [FixedBits-1:0] placed_q1;

  assign zero = sign || is_big;

  flk_delay #(
    .Width(1 + 5 + FixedBits),
    .Depth(32'(Stages >= 3))
  ) i_placed (
    .clk_i,
    .en_i,
    .d_i({zero, exponent, placed}),
    .q_o({zero_q1, exponent_q1, placed_q1})
  );

  // Align: integer part, table index and position in the segment

  logic [4:0]           shift;
  logic [FixedBits-1:0] aligned;
  logic [4:0]                  whole;
  logic [EXP_INDEX_BITS-1:0]   index;
  logic [EXP_DELTA_BITS-1:0]   delta;

  assign shift   = 5'd18 - exponent_q1;
  assign aligned = placed_q1 >> shift;

  flk_delay #(
    .Width(1 + FixedBits),
    .Depth(32'(Stages >= 2))
  ) i_aligned (
    .clk_i,
    .en_i,
    .d_i({zero_q1, aligned}),
    .q_o({zero_q2, whole, index, delta})
  );

  // Interpolate and round

  logic [ValueBits-1:0] value;
  logic [         11:0] rounded;  // 1.0 in the top bit, else the hidden bit below it
  logic                 unused_value;

  assign value = {EXP_VALUE[index], {EXP_VALUE_BITS - EXP_BASE_BITS{1'b0}}}
               - ValueBits'(EXP_SLOPE[index] * (EXP_SLOPE_BITS + EXP_DELTA_BITS)'(delta))
               + ValueBits'(1 << (DropBits - 1));
  assign rounded      = value[ValueBits-1:DropBits];
  assign unused_value = ^{rounded[10], value[DropBits-1:0]};

  // Pack: the exponent is 14 - whole, one more for 1.0

  logic        one, is_small;
  logic [ 3:0] result_exp;
  logic [15:0] result;

  assign one        = rounded[11];
  assign is_small   = whole[4] || (whole[3:0] == 4'd15) || (whole[3:0] == 4'd14 && !one);
  assign result_exp = (one ? 4'd15 : 4'd14) - whole[3:0];
  assign result     = (zero_q2 || is_small) ? 16'd0 : {2'b00, result_exp, rounded[9:0]};

  flk_delay #(
    .Width(16),
    .Depth(32'(Stages >= 1))
  ) i_result (
    .clk_i,
    .en_i,
    .d_i(result),
    .q_o(g_o)
  );

endmodule
