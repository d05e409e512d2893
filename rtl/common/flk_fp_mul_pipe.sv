// Floating-point multiplier, pipelined: round to nearest even, subnormals, parameterised format.
//
// Fn: no infinity, NaN is all ones (E4M3). Saturate: an infinite result becomes the largest finite number.
// Multiply; beside it find the shift from the leading zeros of a subnormal operand and the exponents | shift once, left or right, then by
// one more place if the product's top bit is clear; round.
//
// Stages registers (= latency): 0 none, 1 at the output, 2 also at the bar above. Registers load while en_i is high and are not reset.
module flk_fp_mul_pipe #(
  parameter int unsigned ExpBits  = 5,
  parameter int unsigned ManBits  = 10,
  parameter bit          Fn       = 1'b0,
  parameter bit          Saturate = 1'b0,
  parameter int unsigned Stages   = 2,
  localparam int unsigned Width   = 1 + ExpBits + ManBits
) (
  input  logic             clk_i,
  input  logic             en_i,
  input  logic [Width-1:0] a_i,
  input  logic [Width-1:0] b_i,
  output logic [Width-1:0] prod_o
);

  if (ExpBits < 2 || ManBits < 1) begin : gen_check_size
    $error("flk_fp_mul_pipe: ExpBits must be at least 2, ManBits at least 1");
  end
  if (Fn && !Saturate) begin : gen_check_saturate
    $error("flk_fp_mul_pipe: Fn has no infinity, so Saturate must be set");
  end
  if (Stages > 2) begin : gen_check_stages
    $error("flk_fp_mul_pipe: Stages must be 0 to 2");
  end

  localparam int unsigned SigBits = ManBits + 1;  // with the leading bit
  localparam int unsigned ProdBits = 2 * SigBits;
  localparam int unsigned BIAS = 2 ** (ExpBits - 1) - 1;
  // A right shift by more leaves sticky bits only.
  localparam int unsigned RightMax = SigBits + 1;
  localparam int unsigned FieldBits = ProdBits + RightMax;
  // Right by RightMax to left by ManBits.
  localparam int unsigned ShiftBits = $clog2(RightMax + SigBits);
  localparam int unsigned ZeroBits = $clog2(SigBits + 1);
  // Sum of two exponents less the bias, and that less the leading zeros; signed.
  localparam int unsigned RoomBits = ((ExpBits > ZeroBits) ? ExpBits : ZeroBits) + 2;

  // ---- Product and shift -----------------------------------------------------------------------------

  typedef struct packed {
    logic                 sign;
    logic                 nan;
    logic                 infinite;
    // Of the result if the shifted product's top bit is set, less 1; 0 if it cannot be more.
    logic [ExpBits:0]     exp;
    logic [ShiftBits-1:0] shift;  // left, in a field that begins RightMax places to the right
    logic [ProdBits-1:0]  product;
  } product_t;

  product_t product_q;
  logic a_sign, b_sign, subnormal, nan, infinite;
  logic [ProdBits-1:0] product;
  logic [ExpBits:0] exp_top;
  logic [ExpBits-1:0] a_exp, b_exp;
  logic [ManBits-1:0] a_man, b_man, small_man;
  logic [ZeroBits-1:0] zeros;
  logic signed [RoomBits-1:0] room, limit, left, want;  // places to the left

  localparam logic signed [RoomBits-1:0] LEFT_MIN = -RoomBits'(RightMax);

  assign {a_sign, a_exp, a_man} = a_i;
  assign {b_sign, b_exp, b_man} = b_i;
  assign product = {a_exp != '0, a_man} * {b_exp != '0, b_man};

  // Leading zeros of a subnormal operand. If both are, the product is below half the smallest number and shifted right anyway.
  assign subnormal = (a_exp == '0) || (b_exp == '0);
  assign small_man = (a_exp == '0) ? a_man : b_man;
  always_comb begin
    zeros = ZeroBits'(SigBits);
    for (int unsigned i = 0; i < ManBits; i++) begin
      if (small_man[i]) begin
        zeros = ZeroBits'(ManBits - i);
      end
    end
    if (!subnormal) begin
      zeros = '0;
    end
  end

  // Left shift down to the smallest exponent, negative: right shift. A subnormal number has the exponent of the smallest normal one.
  assign room = RoomBits'(a_exp | ExpBits'(a_exp == '0)) + RoomBits'(b_exp | ExpBits'(b_exp == '0))
              - RoomBits'(BIAS);
  assign want = $signed(RoomBits'(zeros));
  assign limit = (room < LEFT_MIN) ? LEFT_MIN : room;
  assign left = (limit < want) ? limit : want;
  // A product of 0 has exponent 0, too.
  assign exp_top = (room < want || (subnormal && small_man == '0)) ? '0
                     : (ExpBits + 1)'(room - want);

  if (Fn) begin : gen_fn
    assign nan = (&{a_exp, a_man}) || (&{b_exp, b_man});
    assign infinite = 1'b0;
  end else begin : gen_ieee
    assign nan = (&a_exp && (a_man != '0 || {b_exp, b_man} == '0))
              || (&b_exp && (b_man != '0 || {a_exp, a_man} == '0));
    assign infinite = &a_exp || &b_exp;
  end

  flk_delay #(
    .Width($bits(product_t)),
    .Depth(32'(Stages >= 2))
  ) i_product (
    .clk_i,
    .en_i,
    .d_i({a_sign ^ b_sign, nan, infinite, exp_top, ShiftBits'(left - LEFT_MIN), product}),
    .q_o(product_q)
  );

  // ---- Normalise and round to nearest even -------------------------------------------------------------

  localparam int unsigned CodeBits = ExpBits + ManBits;
  localparam logic [CodeBits-1:0] INF_CODE = {{ExpBits{1'b1}}, {ManBits{1'b0}}};
  localparam logic [CodeBits-1:0] NAN_CODE = Fn ? '1 : INF_CODE | (CodeBits'(1) << (ManBits - 1));
  // First code that is not a finite number.
  localparam logic [CodeBits-1:0] LIMIT = Fn ? '1 : INF_CODE;
  localparam logic [CodeBits-1:0] OVERFLOW = Saturate ? LIMIT - 1'b1 : INF_CODE;

  logic [FieldBits-1:0] field;
  logic [ManBits-1:0] man;
  logic top, more, guard, sticky, round_up, overflow;
  logic [ExpBits:0] exp;
  logic [CodeBits:0] truncated;
  logic [CodeBits-1:0] rounded;
  logic [Width-1:0] packed_prod;

  assign field = FieldBits'(product_q.product) << product_q.shift;
  assign top = field[FieldBits-1];
  assign more = !top && (product_q.exp != '0);
  assign {man, guard} = more ? field[FieldBits-3-:SigBits] : field[FieldBits-2-:SigBits];
  assign sticky = (|field[FieldBits-3-SigBits:0]) || (!more && field[FieldBits-2-SigBits]);
  assign exp = product_q.exp + (ExpBits + 1)'(top);
  assign truncated = {exp, man};
  assign round_up = guard && (sticky || man[0]);
  // A carry out of the mantissa raises the exponent; from the largest number it leads to infinity.
  assign rounded = truncated[CodeBits-1:0] + CodeBits'(round_up);
  assign overflow = product_q.infinite || (truncated >= {1'b0, LIMIT})
                 || (Saturate && round_up && (truncated == {1'b0, LIMIT - 1'b1}));

  always_comb begin
    if (product_q.nan) begin
      packed_prod = {1'b0, NAN_CODE};
    end else if (overflow) begin
      packed_prod = {product_q.sign, OVERFLOW};
    end else begin
      packed_prod = {product_q.sign, rounded};
    end
  end

  flk_delay #(
    .Width(Width),
    .Depth(32'(Stages >= 1))
  ) i_prod (
    .clk_i,
    .en_i,
    .d_i(packed_prod),
    .q_o(prod_o)
  );

endmodule
