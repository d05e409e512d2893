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

  typedef logic [ExpBits-1:0] exp_t;
  typedef logic [ManBits-1:0] man_t;
  typedef logic [Width-2:0] mag_t;

  localparam mag_t Inf = {{ExpBits{1'b1}}, {ManBits{1'b0}}};
  localparam mag_t Nan = Fn ? '1 : Inf | (mag_t'(1) << (ManBits - 1));
  localparam mag_t Limit = !Saturate ? Inf : (Fn ? Nan - 1'b1 : Inf - 1'b1);
  localparam int unsigned Bias = (1 << (ExpBits - 1)) - 1;

  // Two significands, each with its hidden bit.
  localparam int unsigned ProdBits = 2 * ManBits + 2;
  // Leading zeros of a subnormal significand: at most ManBits.
  localparam int unsigned LzBits = $clog2(ManBits + 1);
  // The product is shifted right by Offset less its leading zeros or less a negative exponent;
  // all ones, so that the difference is an inversion.
  localparam int unsigned Offset = (1 << LzBits) - 1;
  // The product and as many zeros below as put its guard bit into place by that shift.
  localparam int unsigned WindowBits = ProdBits + 1 + Offset - ManBits;
  // Largest shift: two subnormals, Offset + Bias - 1.
  localparam int unsigned ShiftBits = $clog2(Offset + Bias);
  // Signed exponent, from 1 - Bias to twice the largest.
  localparam int unsigned SignedBits = ((ExpBits > LzBits) ? ExpBits : LzBits) + 2;

  typedef logic [SignedBits-1:0] signed_t;

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

  // Exponent: of the product less 1 (at least 0 in a normal result), less leading zeros

  exp_t a_exp, b_exp;
  logic [ExpBits:0] exp_sum;
  logic [LzBits-1:0] zeros;
  signed_t base, spare;
  logic below;  // the product's exponent would fall below 1

  // Subnormals have the exponent of the smallest normal numbers.
  assign a_exp   = {a_mag[Width-2:ManBits+1], a_mag[ManBits] | !a_normal};
  assign b_exp   = {b_mag[Width-2:ManBits+1], b_mag[ManBits] | !b_normal};
  assign exp_sum = {1'b0, a_exp} + {1'b0, b_exp};
  // Less Bias + 1, which is 2^(ExpBits - 1): the two upper bits less 1.
  assign base    = {{SignedBits - ExpBits - 1{exp_sum[ExpBits:ExpBits-1] == 2'd0}},
                    exp_sum[ExpBits] == exp_sum[ExpBits-1], !exp_sum[ExpBits-1],
                    exp_sum[ExpBits-2:0]};

  // Leading zeros of a subnormal significand; the count of an empty vector does not matter.
  function automatic logic [LzBits-1:0] leading_zeros(input logic [ManBits:0] value);
    logic [Offset:0] rest;
    rest          = (Offset + 1)'(value) << (Offset - ManBits);
    leading_zeros = '0;
    for (int k = int'(LzBits) - 1; k >= 0; k--) begin
      if ((rest >> (Offset + 1 - (1 << k))) == '0) begin
        leading_zeros[k] = 1'b1;
        rest             = rest << (1 << k);
      end
    end
  endfunction

  // If both operands are subnormal the base is so low that the zeros don't matter.
  assign zeros = leading_zeros({a_normal && b_normal, a_normal ? b_man : a_man});
  assign spare = base - signed_t'(zeros);
  assign below = spare[SignedBits-1];

  // Multiply

  logic [ProdBits-1:0] product;

  assign product = {{ManBits + 1{1'b0}}, a_normal, a_man} * {{ManBits + 1{1'b0}}, b_normal, b_man};

  // Normalise: carry, hidden bit, mantissa and guard bit go to the bottom of the window

  logic [ ShiftBits-1:0] shift;
  logic [WindowBits-1:0] placed, window;
  logic                  sticky, carry, hidden;
  logic [     ManBits:0] significand;  // mantissa and guard bit
  logic [   ExpBits-1:0] exponent;  // less 1 if there is a hidden bit

  assign placed = {product, {WindowBits - ProdBits{1'b0}}};
  assign shift  = ShiftBits'(Offset) - (below ? ShiftBits'(base) : ShiftBits'(zeros));

  assign sticky = (placed & ((WindowBits'(1) << shift) - 1'b1)) != '0;

  always_comb begin
    window = placed;
    for (int k = int'(ShiftBits) - 1; k >= 0; k--) begin
      if (shift[k]) begin
        window = window >> (1 << k);
      end
    end
  end

  assign carry       = window[ManBits+2];
  assign hidden      = window[ManBits+2] || window[ManBits+1];
  assign significand = carry ? window[ManBits+1:1] : window[ManBits:0];
  // Without a hidden bit: subnormal or 0.
  assign exponent    = (below || !hidden) ? '0 : spare[ExpBits-1:0];

  // Round: mantissa, then exponent with the mantissa's carry and the hidden bit

  logic                     round_up;
  logic [ExpBits+ManBits:0] rounded;

  assign round_up = significand[0] && (significand[1] || sticky || (carry && window[0]));

  always_comb begin
    automatic logic chain;
    chain = round_up;
    for (int k = 0; k < int'(ManBits); k++) begin
      rounded[k] = significand[k+1] ^ chain;
      chain      = significand[k+1] & chain;
    end
    // Hidden bit and carry together add 1 or 2.
    rounded[ManBits]   = exponent[0] ^ (hidden && !carry) ^ chain;
    chain              = (hidden && !carry) ? exponent[0] || chain : exponent[0] && chain;
    rounded[ManBits+1] = exponent[1] ^ carry ^ chain;
    chain              = carry ? exponent[1] || chain : exponent[1] && chain;
    for (int k = 2; k < int'(ExpBits); k++) begin
      rounded[k+ManBits] = exponent[k] ^ chain;
      chain              = exponent[k] & chain;
    end
    rounded[ExpBits+ManBits] = chain;
  end

  // Pack

  logic overflow;

  assign overflow = is_inf || is_nan || (!below && spare[SignedBits-2:ExpBits] != '0)
                 || rounded[ExpBits+ManBits]
                 || (Fn ? &rounded[Width-2:0] : &rounded[Width-2:ManBits]);
  assign prod_o   = {sign && !is_nan, overflow ? (is_nan ? Nan : Limit) : rounded[Width-2:0]};

endmodule
