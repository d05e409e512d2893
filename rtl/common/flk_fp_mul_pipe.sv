// Floating-point multiplier, pipelined: round to nearest even, subnormals, parameterised format.
//
// Fn: no infinity, NaN is all ones (E4M3). Saturate: an infinite result becomes the largest finite number.
// Multiply; beside it find the shift from the exponents (and, see EARLY, the leading zeros of a subnormal operand) | shift once, then left by
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

  // With few mantissa bits subnormal operands are normalised before they are multiplied, which takes a few gates and leaves only right shifts
  // of the product; with many it would take two large shifters, and the product is shifted to the left instead.
  localparam bit EARLY = (ManBits <= 4);
  localparam int unsigned SigBits = ManBits + 1;  // with the leading bit
  localparam int unsigned ProdBits = 2 * SigBits;
  localparam int unsigned BIAS = 2 ** (ExpBits - 1) - 1;
  // A right shift by more leaves sticky bits only.
  localparam int unsigned RightMax = SigBits + 1;
  localparam int unsigned LeftMax = EARLY ? 0 : ManBits;
  localparam int unsigned FieldBits = ProdBits + RightMax;
  localparam int unsigned ShiftBits = $clog2(RightMax + LeftMax + 1);
  localparam int unsigned ZeroBits = $clog2(SigBits + 1);
  // Sum of two exponents less the bias, and that less the leading zeros; signed.
  localparam int unsigned RoomBits = ((ExpBits > ZeroBits) ? ExpBits : ZeroBits) + 2;

  typedef logic signed [RoomBits-1:0] room_t;

  // ---- Product and shift -----------------------------------------------------------------------------

  typedef struct packed {
    logic                 sign;
    logic                 nan;
    logic                 infinite;
    // Of the result if the shifted product's top bit is set, less 1; 0 if it cannot be more.
    logic [ExpBits:0]     exp;
    logic [ShiftBits-1:0] shift;  // to the right, from LeftMax places to the left
    logic [ProdBits-1:0]  product;
  } product_t;

  product_t product_q;
  logic a_sign, b_sign, zero, nan, infinite;
  logic [ProdBits-1:0] product;
  logic [ExpBits:0] exp_top;
  logic [ExpBits-1:0] a_exp, b_exp;
  logic [ManBits-1:0] a_man, b_man;
  room_t room, want, left;  // places to the left

  localparam room_t LEFT_MIN = -room_t'(RightMax);

  assign {a_sign, a_exp, a_man} = a_i;
  assign {b_sign, b_exp, b_man} = b_i;
  assign zero = ({a_exp, a_man} == '0) || ({b_exp, b_man} == '0);

  if (EARLY) begin : gen_early
    typedef struct packed {
      room_t              exp;
      logic [ManBits-1:0] man;  // behind a leading one
    } normal_t;
    normal_t a, b;

    for (genvar k = 0; k < 2; k++) begin : gen_operand
      logic [ExpBits-1:0] exp;
      logic [ManBits-1:0] man;
      normal_t normal;

      assign {exp, man} = (k == 0) ? {a_exp, a_man} : {b_exp, b_man};
      // 0 becomes any number. At most four places for the leading one: chosen directly, which is smaller than a count and a shift by it.
      always_comb begin
        normal = '{exp: room_t'({1'b0, exp}), man: man};
        if (exp == '0) begin
          normal = '{exp: room_t'(1) - room_t'(ManBits), man: '0};
          for (int i = 1; i < ManBits; i++) begin
            if (man[i]) begin
              normal = '{exp: room_t'(1 + i) - room_t'(ManBits), man: man << (int'(ManBits) - i)};
            end
          end
        end
      end
    end

    assign a = gen_operand[0].normal;
    assign b = gen_operand[1].normal;
    // (1 + x) (1 + y) = (1 + x) + y + x y: smaller than the product of the significands.
    assign product = (ProdBits'({1'b1, a.man}) << ManBits) + (ProdBits'(b.man) << ManBits)
                   + ProdBits'(a.man) * ProdBits'(b.man);
    assign room = a.exp + b.exp - room_t'(BIAS);
    assign want = '0;
    // Zero is shifted out.
    assign left = (zero || room < LEFT_MIN) ? LEFT_MIN : (room < 0) ? room : '0;
  end else begin : gen_late
    logic [ManBits-1:0] small_man;
    logic [ZeroBits-1:0] zeros;

    assign product = {a_exp != '0, a_man} * {b_exp != '0, b_man};
    // A subnormal number has the exponent of the smallest normal one.
    assign room = room_t'({1'b0, a_exp | ExpBits'(a_exp == '0)})
                + room_t'({1'b0, b_exp | ExpBits'(b_exp == '0)}) - room_t'(BIAS);
    // Leading zeros of a subnormal operand. If both are, the product is below half the smallest number and shifted right anyway.
    assign small_man = (a_exp == '0) ? a_man : b_man;
    flk_lzc #(
      .Width(SigBits)
    ) i_zeros (
      .value_i({a_exp != '0 && b_exp != '0, small_man}),
      .count_o(zeros)
    );
    assign want = room_t'({1'b0, zeros});
    assign left = (room < LEFT_MIN) ? LEFT_MIN : (room < want) ? room : want;
  end

  // Left shift down to the smallest exponent is `room`, negative: right shift.
  assign exp_top = (room < want || zero) ? '0 : (ExpBits + 1)'(room - want);

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
    .d_i({a_sign ^ b_sign, nan, infinite, exp_top, ShiftBits'(room_t'(LeftMax) - left), product}),
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
  logic [SigBits-1:0] sig;
  logic [CodeBits:0] truncated;
  logic [CodeBits-1:0] rounded;
  logic [Width-1:0] packed_prod;

  assign field = FieldBits'({product_q.product, (RightMax + LeftMax)'(0)} >> product_q.shift);
  assign top = field[FieldBits-1];
  assign more = !top && (product_q.exp != '0);
  assign {man, guard} = more ? field[FieldBits-3-:SigBits] : field[FieldBits-2-:SigBits];
  assign sticky = (|field[FieldBits-3-SigBits:0]) || (!more && field[FieldBits-2-SigBits]);
  assign round_up = guard && (sticky || man[0]);
  // The top bit or a carry out of the mantissa raises the exponent, never both: no product comes within an ulp of 4.
  // From the largest number a carry leads to infinity.
  assign sig = {top, man} + SigBits'(round_up);
  assign rounded = CodeBits'({product_q.exp + (ExpBits + 1)'(sig[ManBits]), sig[ManBits-1:0]});
  assign truncated = {product_q.exp + (ExpBits + 1)'(top), man};
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
