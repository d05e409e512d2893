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
  typedef logic [ManBits-1:0] man_t;
  typedef logic [Width-2:0] mag_t;

  localparam mag_t Inf = {{ExpBits{1'b1}}, {ManBits{1'b0}}};
  localparam mag_t Nan = Fn ? '1 : Inf | (mag_t'(1) << (ManBits - 1));
  localparam mag_t Finite = Fn ? Nan - 1'b1 : Inf - 1'b1;
  localparam mag_t Limit = Saturate ? Finite : Inf;

  // Hidden bit, mantissa, guard, round and sticky bit.
  localparam int unsigned AlignBits = ManBits + 4;
  // A shift by AlignBits leaves the sticky bit alone.
  localparam int unsigned ShiftBits = $clog2(AlignBits + 1);
  // The difference of two exponents, or the shift amount if that is wider.
  localparam int unsigned DiffBits = (ExpBits > ShiftBits) ? ExpBits : ShiftBits;
  // The aligned number and a carry.
  localparam int unsigned SumBits = AlignBits + 1;
  localparam int unsigned LzBits = $clog2(SumBits);
  // The shift to normalise is limited by the exponent: compare in the wider of the two.
  localparam int unsigned LimitBits = (ExpBits > LzBits) ? ExpBits : LzBits;

  // Unpack: the larger magnitude first

  logic swap, subtract, sign;
  mag_t greater, lesser;
  logic greater_normal, lesser_normal;
  exp_t greater_exp, lesser_exp;

  assign swap         = a_i[Width-2:0] < b_i[Width-2:0];
  assign greater        = swap ? b_i[Width-2:0] : a_i[Width-2:0];
  assign lesser        = swap ? a_i[Width-2:0] : b_i[Width-2:0];
  assign sign         = swap ? b_i[Width-1] : a_i[Width-1];
  assign subtract     = a_i[Width-1] ^ b_i[Width-1];
  assign greater_normal = |greater[Width-2:ManBits];
  assign lesser_normal = |lesser[Width-2:ManBits];
  // Subnormals have the exponent of the smallest normal numbers.
  assign greater_exp    = {greater[Width-2:ManBits+1], greater[ManBits] | !greater_normal};
  assign lesser_exp    = {lesser[Width-2:ManBits+1], lesser[ManBits] | !lesser_normal};

  // Special cases: a NaN or an infinity is the larger magnitude

  logic is_nan, is_inf;

  if (Fn) begin : gen_special_fn
    assign is_nan = (greater == Nan);
    assign is_inf = 1'b0;
  end else begin : gen_special
    assign is_inf = &greater[Width-2:ManBits];
    assign is_nan = is_inf && (greater[ManBits-1:0] != '0 || (subtract && greater == lesser));
  end

  // Exponent

  logic [DiffBits-1:0] diff;
  logic                far;  // nothing but the sticky bit remains

  assign diff = DiffBits'(greater_exp - lesser_exp);
  assign far  = (diff >> ShiftBits) != '0;

  // Align

  logic [AlignBits-1:0] aligned;

  always_comb begin
    aligned = {lesser_normal, lesser[ManBits-1:0], 3'b000};
    if (far) begin
      aligned = AlignBits'(lesser != '0);
    end
    for (int k = int'(ShiftBits) - 1; k >= 0; k--) begin
      if (diff[k]) begin
        aligned = (aligned >> (1 << k))
                | AlignBits'((aligned & ((AlignBits'(1) << (1 << k)) - 1'b1)) != '0);
      end
    end
  end

  // Add

  logic [SumBits-1:0] sum;

  assign sum = {1'b0, greater_normal, greater[ManBits-1:0], 3'b000}
             + ({1'b0, aligned} ^ {SumBits{subtract}}) + SumBits'(subtract);

  // Normalise: the highest one to the top, unless the exponent would fall below 1

  // Halves the vector, filled up to a power of two; the count of an empty one does not matter.
  function automatic logic [LzBits-1:0] leading_zeros(input logic [SumBits-1:0] value);
    logic [(1<<LzBits)-1:0] rest;
    rest          = (1 << LzBits)'(value) << ((1 << LzBits) - SumBits);
    leading_zeros = '0;
    for (int k = int'(LzBits) - 1; k >= 0; k--) begin
      if ((rest >> ((1 << LzBits) - (1 << k))) == '0) begin
        leading_zeros[k] = 1'b1;
        rest             = rest << (1 << k);
      end
    end
  endfunction

  logic [   LzBits-1:0] zeros;
  logic [LimitBits-1:0] shift;
  logic [  SumBits-1:0] norm;
  logic [    ExpBits:0] exponent;

  assign zeros    = leading_zeros(sum);
  assign shift    = (LimitBits'(zeros) > LimitBits'(greater_exp)) ? LimitBits'(greater_exp)
                                                                : LimitBits'(zeros);
  assign norm     = sum << shift;
  // The top bit is the carry, so it counts one more than greater_exp. Without it: subnormal or 0.
  assign exponent = norm[SumBits-1] ? {1'b0, greater_exp} + 1'b1 - (ExpBits + 1)'(shift) : '0;

  // Round

  logic                     round_up;
  logic [ExpBits+ManBits:0] rounded;

  assign round_up = norm[3] && (norm[4] || norm[2:0] != '0);
  assign rounded  = {exponent, norm[SumBits-2:4]} + (ExpBits + ManBits + 1)'(round_up);

  // Pack

  logic overflow, zero;

  assign overflow = is_inf || rounded > {1'b0, Finite};
  assign zero     = (sum == '0);

  always_comb begin
    sum_o = {sign && !(subtract && zero), overflow ? Limit : rounded[Width-2:0]};
    if (is_nan) begin
      sum_o = {1'b0, Nan};
    end
  end

endmodule
