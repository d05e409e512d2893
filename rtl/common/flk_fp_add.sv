// Floating-point adder, round to nearest even, subnormals supported (docs/arithmetic.md).
//
// Combinational. One path: swap, align, add, normalise, round.
// There is no subtract input: flip the sign bit of b_i outside.
module flk_fp_add #(
  parameter  int unsigned ExpBits  = 5,
  parameter  int unsigned ManBits  = 10,
  parameter  bit          Fn       = 1'b0,  // no infinity, NaN is all ones
  parameter  bit          Saturate = 1'b0,  // infinite results become the largest finite number
  localparam int unsigned Width    = 1 + ExpBits + ManBits
) (
  input  logic [Width-1:0] a_i,
  input  logic [Width-1:0] b_i,
  output logic [Width-1:0] sum_o
);

  if (ExpBits < 2 || ManBits < 1) begin : gen_check_size
    $error("flk_fp_add: ExpBits must be at least 2, ManBits at least 1");
  end
  if (Fn && !Saturate) begin : gen_check_saturate
    $error("flk_fp_add: Fn has no infinity, so Saturate must be set");
  end

  typedef logic [ExpBits-1:0] exp_t;
  typedef logic [Width-2:0] mag_t;

  localparam mag_t Inf = {{ExpBits{1'b1}}, {ManBits{1'b0}}};
  localparam mag_t Nan = Fn ? '1 : Inf | (mag_t'(1) << (ManBits - 1));
  localparam mag_t Limit = !Saturate ? Inf : (Fn ? Nan - 1'b1 : Inf - 1'b1);

  // Hidden bit, mantissa, guard, round and sticky bit.
  localparam int unsigned AlignBits = ManBits + 4;
  // A shift by AlignBits leaves the sticky bit alone.
  localparam int unsigned ShiftBits = $clog2(AlignBits + 1);
  // The difference of two exponents, or the shift amount if that is wider.
  localparam int unsigned DiffBits = (ExpBits > ShiftBits) ? ExpBits : ShiftBits;
  // The aligned number and a carry.
  localparam int unsigned SumBits = AlignBits + 1;
  localparam int unsigned LzBits = $clog2(SumBits);
  // Signed difference of exponent and leading zeros.
  localparam int unsigned SignedBits = ((ExpBits > LzBits) ? ExpBits : LzBits) + 1;

  // Unpack: the larger magnitude first

  logic swap, subtract, sign;
  mag_t greater, lesser;
  logic greater_normal, lesser_normal;
  exp_t greater_exp, lesser_exp;

  // The highest bit that differs decides.
  always_comb begin
    swap = 1'b0;
    for (int k = 0; k < int'(Width) - 1; k++) begin
      if (a_i[k] != b_i[k]) begin
        swap = b_i[k];
      end
    end
  end

  assign greater        = swap ? b_i[Width-2:0] : a_i[Width-2:0];
  assign lesser         = a_i[Width-2:0] ^ b_i[Width-2:0] ^ greater;
  assign sign           = swap ? b_i[Width-1] : a_i[Width-1];
  assign subtract       = a_i[Width-1] ^ b_i[Width-1];
  assign greater_normal = |greater[Width-2:ManBits];
  assign lesser_normal  = |lesser[Width-2:ManBits];
  // Subnormals have the exponent of the smallest normal numbers.
  assign greater_exp    = {greater[Width-2:ManBits+1], greater[ManBits] | !greater_normal};
  assign lesser_exp     = {lesser[Width-2:ManBits+1], lesser[ManBits] | !lesser_normal};

  // Special cases: a NaN or an infinity is the larger magnitude

  logic is_nan, is_inf;

  if (Fn) begin : gen_special_fn
    assign is_nan = (greater == Nan);
    assign is_inf = 1'b0;
  end else begin : gen_special
    assign is_inf = &greater[Width-2:ManBits];
    assign is_nan = is_inf
                 && (greater[ManBits-1:0] != '0 || (subtract && &lesser[Width-2:ManBits]));
  end

  // Exponent

  logic [ DiffBits-1:0] diff;
  logic [ShiftBits-1:0] distance;

  // Any distance of AlignBits or more leaves nothing but the sticky bit.
  assign diff     = DiffBits'(greater_exp - lesser_exp);
  assign distance = diff[ShiftBits-1:0] | {ShiftBits{(diff >> ShiftBits) != '0}};

  // Align

  logic [AlignBits-1:0] aligned;

  always_comb begin
    aligned = {lesser_normal, lesser[ManBits-1:0], 3'b000};
    for (int k = 0; k < int'(ShiftBits); k++) begin
      if (distance[k]) begin
        aligned = (aligned >> (1 << k))
                | AlignBits'((aligned & ((AlignBits'(1) << (1 << k)) - 1'b1)) != '0);
      end
    end
  end

  // Add

  // The larger operand has no bits in the three lowest places: a short sum, then the others.
  logic [        3:0] sum_low;
  logic [ManBits+1:0] sum_high;
  logic [SumBits-1:0] sum;

  assign sum_low  = {1'b0, aligned[2:0] ^ {3{subtract}}} + 4'(subtract);
  assign sum_high = {1'b0, greater_normal, greater[ManBits-1:0]}
                  + ({1'b0, aligned[AlignBits-1:3]} ^ {ManBits + 2{subtract}})
                  + (ManBits + 2)'(sum_low[3]);
  assign sum      = {sum_high, sum_low[2:0]};

  // Normalise: the highest one to the top, unless the exponent would fall below 1

  // The count of an empty vector does not matter.
  function automatic logic [LzBits-1:0] leading_zeros(input logic [SumBits-1:0] value);
    leading_zeros = '1;
    for (int k = 0; k < int'(SumBits); k++) begin
      if (value[k]) begin
        leading_zeros = LzBits'(int'(SumBits) - 1 - k);
      end
    end
  endfunction

  logic                   zero, low;
  logic [     LzBits-1:0] zeros, shift;
  logic [ SignedBits-1:0] spare;
  logic [    SumBits-1:0] norm;
  logic [    ExpBits-1:0] exponent;  // less 1 if norm has a hidden bit

  assign zeros = leading_zeros(sum);
  assign zero  = (sum == '0);
  assign low   = spare[SignedBits-1];
  assign shift = low ? LzBits'(greater_exp) : zeros;

  // greater_exp - zeros, one carry chain.
  always_comb begin
    automatic logic [SignedBits-1:0] minuend, inverse;
    automatic logic carry;
    minuend = SignedBits'(greater_exp);
    inverse = ~SignedBits'(zeros);
    carry   = 1'b1;
    for (int k = 0; k < int'(SignedBits); k++) begin
      spare[k] = minuend[k] ^ inverse[k] ^ carry;
      carry    = (minuend[k] & inverse[k]) | (carry & (minuend[k] | inverse[k]));
    end
  end

  always_comb begin
    norm = sum;
    for (int k = int'(LzBits) - 1; k >= 0; k--) begin
      if (shift[k]) begin
        norm = norm << (1 << k);
      end
    end
  end

  // Its top bit is the carry of the sum: an exponent of greater_exp + 1 before the shift.
  assign exponent = (low || zero) ? '0 : spare[ExpBits-1:0];

  // Round: mantissa, then exponent with the mantissa's carry and the hidden bit

  logic                     round_up;
  logic [ExpBits+ManBits:0] rounded;

  assign round_up = norm[3] && (norm[4] || norm[2:0] != '0);

  always_comb begin
    automatic logic carry;
    carry = round_up;
    for (int k = 0; k < int'(ManBits); k++) begin
      rounded[k] = norm[k+4] ^ carry;
      carry      = norm[k+4] & carry;
    end
    rounded[ManBits] = exponent[0] ^ norm[SumBits-1] ^ carry;
    carry            = (norm[SumBits-1] & carry) | (exponent[0] & (norm[SumBits-1] | carry));
    for (int k = 1; k < int'(ExpBits); k++) begin
      rounded[k+ManBits] = exponent[k] ^ carry;
      carry              = exponent[k] & carry;
    end
    rounded[ExpBits+ManBits] = carry;
  end

  // Pack

  logic overflow;

  assign overflow = is_inf || is_nan || rounded[ExpBits+ManBits]
                 || (Fn ? &rounded[Width-2:0] : &rounded[Width-2:ManBits]);
  assign sum_o    = {sign && !(subtract && zero) && !is_nan,
                     overflow ? (is_nan ? Nan : Limit) : rounded[Width-2:0]};

endmodule
