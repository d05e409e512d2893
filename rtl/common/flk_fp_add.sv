// Floating-point adder, combinational: round to nearest even, subnormals, parameterised format.
//
// A difference is a sum with the sign bit of b_i inverted by the user.
// Fn: no infinity, NaN is all ones (E4M3). Saturate: an infinite result becomes the largest finite number.
// Single path: order by magnitude, align with guard, round and sticky bit, add or subtract, normalise, round.
module flk_fp_add #(
  parameter int unsigned ExpBits  = 5,
  parameter int unsigned ManBits  = 10,
  parameter bit          Fn       = 1'b0,
  parameter bit          Saturate = 1'b0,
  localparam int unsigned Width   = 1 + ExpBits + ManBits
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

  // ---- Unpack: the operand of larger magnitude first -----------------------------------------------

  localparam int unsigned SigBits = ManBits + 1;  // with the leading bit
  localparam int unsigned SumBits = SigBits + 3;  // guard, round, sticky below
  localparam int unsigned ShiftBits = $clog2(SumBits + 1);  // 0 to SumBits

  logic swap, sub;
  logic big_sign, small_sign;
  logic [ExpBits-1:0] big_exp, small_exp, big_eff, small_eff;
  logic [ManBits-1:0] big_man, small_man;

  assign swap = b_i[Width-2:0] > a_i[Width-2:0];
  assign {big_sign, big_exp, big_man} = swap ? b_i : a_i;
  assign {small_sign, small_exp, small_man} = swap ? a_i : b_i;
  assign sub = big_sign ^ small_sign;
  // A subnormal number has the exponent of the smallest normal one and no leading bit.
  assign big_eff = big_exp | ExpBits'(big_exp == '0);
  assign small_eff = small_exp | ExpBits'(small_exp == '0);

  // ---- Align ---------------------------------------------------------------------------------------

  logic [ExpBits-1:0] diff;
  logic [ShiftBits-1:0] align;
  logic [SumBits-1:0] big_sig, small_sig, small_aligned, lost;
  logic sticky;

  assign diff = big_eff - small_eff;
  assign align = (32'(diff) > SumBits) ? ShiftBits'(SumBits) : ShiftBits'(diff);
  assign big_sig = {big_exp != '0, big_man, 3'b0};
  assign small_sig = {small_exp != '0, small_man, 3'b0};
  assign {small_aligned, lost} = {small_sig, SumBits'(0)} >> align;
  assign sticky = |lost;

  // ---- Add -----------------------------------------------------------------------------------------

  logic [SumBits:0] sum;  // one carry bit
  logic [SumBits-1:0] addend;

  assign addend = small_aligned | SumBits'(sticky);
  assign sum = sub ? {1'b0, big_sig} - {1'b0, addend} : {1'b0, big_sig} + {1'b0, addend};

  // ---- Normalise -----------------------------------------------------------------------------------

  logic [ShiftBits-1:0] zeros, shift;
  logic [SumBits-1:0] normal;
  logic [ExpBits-1:0] max_shift;
  logic [ExpBits:0] exp;  // one bit more: the carry may lead beyond the largest exponent

  always_comb begin
    zeros = ShiftBits'(SumBits);
    for (int unsigned i = 0; i < SumBits; i++) begin
      if (sum[i]) begin
        zeros = ShiftBits'(SumBits - 1 - i);
      end
    end
  end

  // Not below the smallest exponent: what remains is subnormal.
  assign max_shift = big_eff - ExpBits'(1);
  assign shift = (32'(zeros) > 32'(max_shift)) ? ShiftBits'(max_shift) : zeros;

  always_comb begin
    if (sum[SumBits]) begin
      normal = {sum[SumBits:2], |sum[1:0]};
      exp = (ExpBits + 1)'(big_eff) + (ExpBits + 1)'(1);
    end else begin
      normal = sum[SumBits-1:0] << shift;
      exp = normal[SumBits-1] ? (ExpBits + 1)'(big_eff) - (ExpBits + 1)'(shift) : '0;
    end
  end

  // ---- Round to nearest even -------------------------------------------------------------------------

  logic round_up;
  logic [ExpBits+ManBits:0] rounded;  // a carry out of the mantissa raises the exponent

  assign round_up = normal[2] && (normal[1] || normal[0] || normal[3]);
  assign rounded = {exp, normal[SumBits-2:3]} + (ExpBits + ManBits + 1)'(round_up);

  // ---- Special cases and pack ------------------------------------------------------------------------

  localparam logic [ExpBits+ManBits-1:0] INF_CODE = {{ExpBits{1'b1}}, {ManBits{1'b0}}};
  localparam logic [ExpBits+ManBits-1:0] NAN_CODE =
      Fn ? '1 : INF_CODE | ((ExpBits + ManBits)'(1) << (ManBits - 1));
  // First code that is not a finite number.
  localparam logic [ExpBits+ManBits-1:0] LIMIT = Fn ? '1 : INF_CODE;
  localparam logic [ExpBits+ManBits-1:0] OVERFLOW = Saturate ? LIMIT - 1'b1 : INF_CODE;

  logic nan, infinite, sign;

  // The operand of larger magnitude tells: NaN codes lie above all others.
  if (Fn) begin : gen_fn
    assign nan = &{big_exp, big_man};
    assign infinite = 1'b0;
  end else begin : gen_ieee
    assign nan = (&big_exp && (big_man != '0)) || (&big_exp && &small_exp && sub);
    assign infinite = &big_exp;
  end
  // x - x is +0.
  assign sign = big_sign && !(sub && (sum == '0));

  always_comb begin
    if (nan) begin
      sum_o = {1'b0, NAN_CODE};
    end else if (infinite || (rounded >= {1'b0, LIMIT})) begin
      sum_o = {sign, OVERFLOW};
    end else begin
      sum_o = {sign, rounded[ExpBits+ManBits-1:0]};
    end
  end

endmodule
