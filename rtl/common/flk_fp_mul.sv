// Floating-point multiplier, combinational: round to nearest even, subnormals, parameterised format.
//
// Fn: no infinity, NaN is all ones (E4M3). Saturate: an infinite result becomes the largest finite number.
// Subnormal operands are not normalised first: their leading zeros show up in the product, which is shifted once, left or right, to its
// place.
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

  if (ExpBits < 2 || ManBits < 1) begin : gen_check_size
    $error("flk_fp_mul: ExpBits must be at least 2, ManBits at least 1");
  end
  if (Fn && !Saturate) begin : gen_check_saturate
    $error("flk_fp_mul: Fn has no infinity, so Saturate must be set");
  end

  // ---- Unpack --------------------------------------------------------------------------------------

  localparam int unsigned SigBits = ManBits + 1;  // with the leading bit
  localparam int unsigned ProdBits = 2 * SigBits;
  localparam int unsigned BIAS = 2 ** (ExpBits - 1) - 1;
  // Leading zeros of the product: up to ProdBits.
  localparam int unsigned ZeroBits = $clog2(ProdBits + 1);
  // Sum of two exponents less the bias, or that less the leading zeros; signed.
  localparam int unsigned SumBits = ((ExpBits > ZeroBits) ? ExpBits : ZeroBits) + 2;

  logic a_sign, b_sign, sign;
  logic [ExpBits-1:0] a_exp, b_exp;
  logic [ManBits-1:0] a_man, b_man;

  assign {a_sign, a_exp, a_man} = a_i;
  assign {b_sign, b_exp, b_man} = b_i;
  assign sign = a_sign ^ b_sign;

  // ---- Exponent and product --------------------------------------------------------------------------

  logic signed [SumBits-1:0] exp_top;  // exponent if the product's top bit (weight 2) is set
  logic [ProdBits-1:0] product;

  // A subnormal number has the exponent of the smallest normal one and no leading bit.
  assign exp_top = SumBits'(a_exp | ExpBits'(a_exp == '0)) + SumBits'(b_exp | ExpBits'(b_exp == '0))
                 - SumBits'(BIAS - 1);
  assign product = {a_exp != '0, a_man} * {b_exp != '0, b_man};

  // ---- Normalise -------------------------------------------------------------------------------------

  // Left shift of the product within a field that begins RightMax places to the right: shifts below RightMax are to the right.
  // A right shift by more than SigBits + 1 leaves sticky bits only.
  localparam int unsigned RightMax = SigBits + 1;
  localparam int unsigned FieldBits = ProdBits + RightMax;
  localparam int unsigned ShiftBits = $clog2(FieldBits + 1);

  logic [ShiftBits-1:0] zeros, shift;
  logic signed [SumBits:0] room;  // left shift down to the smallest exponent, negative: right shift
  logic [FieldBits-1:0] field;
  logic [SigBits-1:0] sig;
  logic guard, sticky;
  logic [ExpBits:0] exp;

  always_comb begin
    zeros = ShiftBits'(ProdBits);
    for (int unsigned i = 0; i < ProdBits; i++) begin
      if (product[i]) begin
        zeros = ShiftBits'(ProdBits - 1 - i);
      end
    end
  end

  assign room = (SumBits + 1)'(exp_top) - (SumBits + 1)'(1);

  always_comb begin
    if (room < -$signed((SumBits + 1)'(RightMax))) begin
      shift = '0;
    end else if (room < $signed((SumBits + 1)'(zeros))) begin
      shift = ShiftBits'(RightMax) + ShiftBits'(room);
    end else begin
      shift = ShiftBits'(RightMax) + zeros;
    end
  end

  assign field = FieldBits'(product) << shift;
  assign sig = field[FieldBits-1-:SigBits];
  assign guard = field[FieldBits-1-SigBits];
  // With shift 0 nothing has left the field to the right.
  assign sticky = |field[FieldBits-2-SigBits:0];
  // No leading bit: subnormal.
  assign exp = sig[SigBits-1] ? (ExpBits + 1)'(exp_top) - (ExpBits + 1)'(zeros) : '0;

  // ---- Round to nearest even -------------------------------------------------------------------------

  logic [ExpBits+ManBits:0] rounded;  // a carry out of the mantissa raises the exponent

  assign rounded = {exp, sig[ManBits-1:0]}
                 + (ExpBits + ManBits + 1)'(guard && (sticky || sig[0]));

  // ---- Special cases and pack ------------------------------------------------------------------------

  localparam logic [ExpBits+ManBits-1:0] INF_CODE = {{ExpBits{1'b1}}, {ManBits{1'b0}}};
  localparam logic [ExpBits+ManBits-1:0] NAN_CODE =
      Fn ? '1 : INF_CODE | ((ExpBits + ManBits)'(1) << (ManBits - 1));
  // First code that is not a finite number.
  localparam logic [ExpBits+ManBits-1:0] LIMIT = Fn ? '1 : INF_CODE;
  localparam logic [ExpBits+ManBits-1:0] OVERFLOW = Saturate ? LIMIT - 1'b1 : INF_CODE;

  logic nan, infinite;

  if (Fn) begin : gen_fn
    assign nan = (&{a_exp, a_man}) || (&{b_exp, b_man});
    assign infinite = 1'b0;
  end else begin : gen_ieee
    assign nan = (&a_exp && (a_man != '0 || {b_exp, b_man} == '0))
              || (&b_exp && (b_man != '0 || {a_exp, a_man} == '0));
    assign infinite = &a_exp || &b_exp;
  end

  always_comb begin
    if (nan) begin
      prod_o = {1'b0, NAN_CODE};
    end else if (infinite || (rounded >= {1'b0, LIMIT})) begin
      prod_o = {sign, OVERFLOW};
    end else begin
      prod_o = {sign, rounded[ExpBits+ManBits-1:0]};
    end
  end

endmodule
