// Floating-point multiplier, round to nearest even, subnormals supported (docs/arithmetic.md).
//
// Combinational. One shift after the product serves subnormal operands and subnormal results; its
// amount comes from the operands, not from the product.
module flk_fp_mul #(
  parameter  int unsigned ExpBits  = 5,
  parameter  int unsigned ManBits  = 10,
  parameter  bit          Fn       = 1'b0,  // no infinity, NaN is all ones
  parameter  bit          Saturate = 1'b0,  // infinite results become the largest finite number
  localparam int unsigned Width    = 1 + ExpBits + ManBits
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

  typedef logic [ManBits-1:0] man_t;
  typedef logic [Width-2:0] mag_t;

  localparam mag_t Inf = {{ExpBits{1'b1}}, {ManBits{1'b0}}};
  localparam mag_t Nan = Fn ? '1 : Inf | (mag_t'(1) << (ManBits - 1));
  localparam mag_t Finite = Fn ? Nan - 1'b1 : Inf - 1'b1;
  localparam mag_t Limit = Saturate ? Finite : Inf;
  localparam int unsigned Bias = (1 << (ExpBits - 1)) - 1;

  // Two significands, each with its hidden bit.
  localparam int unsigned ProdBits = 2 * ManBits + 2;
  // Leading zeros of a subnormal significand: at most ManBits.
  localparam int unsigned LzBits = $clog2(ManBits + 1);
  // Largest shift: two subnormals, ManBits + Bias - 1.
  localparam int unsigned ShiftBits = $clog2(ManBits + Bias);
  // Signed exponent, from 1 - Bias to twice the largest.
  localparam int unsigned SignedBits = ((ExpBits > LzBits) ? ExpBits : LzBits) + 2;

  typedef logic signed [SignedBits-1:0] signed_t;

  // Unpack

  mag_t a_mag, b_mag;
  man_t a_man, b_man;
  logic a_normal, b_normal, sign;

  assign {a_mag, a_man} = {a_i[Width-2:0], a_i[ManBits-1:0]};
  assign {b_mag, b_man} = {b_i[Width-2:0], b_i[ManBits-1:0]};
  assign a_normal       = |a_mag[Width-2:ManBits];
  assign b_normal       = |b_mag[Width-2:ManBits];
  assign sign           = a_i[Width-1] ^ b_i[Width-1];

  // Special cases

  logic is_nan, is_inf;

  if (Fn) begin : gen_special_fn
    assign is_nan = (a_mag == Nan) || (b_mag == Nan);
    assign is_inf = 1'b0;
  end else begin : gen_special
    logic a_top, b_top;
    assign a_top  = &a_mag[Width-2:ManBits];
    assign b_top  = &b_mag[Width-2:ManBits];
    assign is_inf = a_top || b_top;
    assign is_nan = (a_top && (a_man != '0 || b_mag == '0))
                 || (b_top && (b_man != '0 || a_mag == '0));
  end

  // Exponent: of the product less 1 (at least 0 in a normal result), and leading zeros

  // Halves the vector, filled up to a power of two; the count of an empty one does not matter.
  function automatic logic [LzBits-1:0] leading_zeros(input logic [ManBits:0] value);
    logic [(1<<LzBits)-1:0] rest;
    rest          = (1 << LzBits)'(value) << ((1 << LzBits) - ManBits - 1);
    leading_zeros = '0;
    for (int k = int'(LzBits) - 1; k >= 0; k--) begin
      if ((rest >> ((1 << LzBits) - (1 << k))) == '0) begin
        leading_zeros[k] = 1'b1;
        rest             = rest << (1 << k);
      end
    end
  endfunction

  signed_t base, spare;
  logic [LzBits-1:0] zeros;
  logic below;  // the product's exponent would fall below 1

  // The leading zeros of the subnormal operand. If both are subnormal the base is so low that
  // the zeros don't matter.
  assign zeros = leading_zeros({a_normal && b_normal,
                                (a_normal ? '0 : a_man) | (b_normal ? '0 : b_man)});
  assign base  = signed_t'(a_mag[Width-2:ManBits]) + signed_t'(b_mag[Width-2:ManBits])
               + signed_t'(!a_normal) + signed_t'(!b_normal) - signed_t'(Bias + 1);
  assign spare = base - signed_t'(zeros);
  assign below = spare[SignedBits-1];

  // Multiply

  logic [ProdBits-1:0] product;

  assign product = {{ManBits + 1{1'b0}}, a_normal, a_man} * {{ManBits + 1{1'b0}}, b_normal, b_man};

  // Normalise: carry, hidden bit, mantissa, guard bit at the bottom of the vector; the rest is sticky

  logic [ShiftBits-1:0] shift;
  logic [   ProdBits:0] window;
  logic                 sticky, carry;
  logic [    ManBits:0] significand;  // mantissa and guard bit
  logic [    ExpBits:0] exponent;

  assign shift = ShiftBits'(ManBits) - (below ? ShiftBits'(base) : ShiftBits'(zeros));

  always_comb begin
    window = {product, 1'b0};
    sticky = 1'b0;
    for (int k = int'(ShiftBits) - 1; k >= 0; k--) begin
      if (shift[k]) begin
        sticky = sticky || ((window & (((ProdBits + 1)'(1) << (1 << k)) - 1'b1)) != '0);
        window = window >> (1 << k);
      end
    end
  end

  assign carry       = window[ManBits+2];
  assign significand = carry ? window[ManBits+1:1] : window[ManBits:0];

  always_comb begin
    exponent = below ? '0 : spare[ExpBits:0];
    if (carry) begin
      exponent = exponent + (ExpBits + 1)'(2);
    end else if (window[ManBits+1]) begin
      exponent = exponent + 1'b1;
    end else begin
      exponent = '0;
    end
  end

  // Round

  logic                     round_up;
  logic [ExpBits+ManBits:0] rounded;

  assign round_up = significand[0] && (significand[1] || sticky || (carry && window[0]));
  assign rounded  = {exponent, significand[ManBits:1]} + (ExpBits + ManBits + 1)'(round_up);

  // Pack

  logic overflow;

  assign overflow = is_inf || rounded > {1'b0, Finite};

  always_comb begin
    prod_o = {sign, overflow ? Limit : rounded[Width-2:0]};
    if (is_nan) begin
      prod_o = {1'b0, Nan};
    end
  end

endmodule
