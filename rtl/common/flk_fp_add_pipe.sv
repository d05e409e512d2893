// Floating-point adder, pipelined: round to nearest even, subnormals, parameterised format.
//
// A difference is a sum with the sign bit of b_i inverted by the user.
// Fn: no infinity, NaN is all ones (E4M3). Saturate: an infinite result becomes the largest finite number.
// Single path: order by magnitude, align with guard, round and sticky bit | add or subtract, count leading zeros | normalise, round.
//
// Cancel 0: operands of equal sign only (squares, colours), so that the sum cannot lose leading bits; saves the normalisation.
// Stages registers (= latency): 0 none, 1 at the output, 2 also at the first bar above, 3 at both. Registers load while en_i is high and are
// not reset.
module flk_fp_add_pipe #(
  parameter int unsigned ExpBits  = 5,
  parameter int unsigned ManBits  = 10,
  parameter bit          Fn       = 1'b0,
  parameter bit          Saturate = 1'b0,
  parameter bit          Cancel   = 1'b1,
  parameter int unsigned Stages   = 3,
  localparam int unsigned Width   = 1 + ExpBits + ManBits
) (
  input  logic             clk_i,
  input  logic             en_i,
  input  logic [Width-1:0] a_i,
  input  logic [Width-1:0] b_i,
  output logic [Width-1:0] sum_o
);

  if (ExpBits < 2 || ManBits < 1) begin : gen_check_size
    $error("flk_fp_add_pipe: ExpBits must be at least 2, ManBits at least 1");
  end
  if (Fn && !Saturate) begin : gen_check_saturate
    $error("flk_fp_add_pipe: Fn has no infinity, so Saturate must be set");
  end
  if (Stages > 3) begin : gen_check_stages
    $error("flk_fp_add_pipe: Stages must be 0 to 3");
  end

  localparam int unsigned SigBits = ManBits + 1;  // with the leading bit
  localparam int unsigned AddBits = SigBits + 3;  // guard, round, sticky below
  localparam int unsigned SumBits = AddBits + 1;  // one carry bit
  localparam int unsigned ShiftBits = $clog2(AddBits + 1);  // 0 to AddBits

  // ---- Order by magnitude and align ----------------------------------------------------------------

  typedef struct packed {
    logic               sign;
    logic               sub;
    logic               nan;
    logic               infinite;
    logic [ExpBits-1:0] exp;    // of the larger operand
    logic [AddBits-1:0] big;
    logic [AddBits-1:0] addend;  // the smaller operand, inverted for a subtraction
  } aligned_t;

  aligned_t aligned_q;
  logic swap, sub, big_sign, small_sign, nan, infinite;
  logic [ExpBits-1:0] big_exp, small_exp, big_eff, small_eff, diff;
  logic [ManBits-1:0] big_man, small_man;
  logic [ShiftBits-1:0] align;
  logic [AddBits-1:0] shifted, lost;

  assign swap = b_i[Width-2:0] > a_i[Width-2:0];
  assign {big_sign, big_exp, big_man} = swap ? b_i : a_i;
  assign {small_sign, small_exp, small_man} = swap ? a_i : b_i;
  assign sub = Cancel && (big_sign ^ small_sign);
  // A subnormal number has the exponent of the smallest normal one and no leading bit.
  assign big_eff = big_exp | ExpBits'(big_exp == '0);
  assign small_eff = small_exp | ExpBits'(small_exp == '0);
  assign diff = big_eff - small_eff;
  assign align = (32'(diff) > AddBits) ? ShiftBits'(AddBits) : ShiftBits'(diff);
  assign {shifted, lost} = {small_exp != '0, small_man, 3'b0, AddBits'(0)} >> align;

  // The operand of larger magnitude tells: NaN codes lie above all others.
  if (Fn) begin : gen_fn
    assign nan = &{big_exp, big_man};
    assign infinite = 1'b0;
  end else begin : gen_ieee
    assign nan = (&big_exp && (big_man != '0)) || (&big_exp && &small_exp && sub);
    assign infinite = &big_exp;
  end

  flk_delay #(
    .Width($bits(aligned_t)),
    .Depth(32'(Stages >= 2))
  ) i_aligned (
    .clk_i,
    .en_i,
    .d_i({
      big_sign, sub, nan, infinite, big_eff, {big_exp != '0, big_man, 3'b0},
      (shifted | AddBits'(|lost)) ^ {AddBits{sub}}
    }),
    .q_o(aligned_q)
  );

  // ---- Add and count leading zeros -------------------------------------------------------------------

  typedef struct packed {
    logic                 sign;
    logic                 nan;
    logic                 infinite;
    logic                 zero;
    logic [ExpBits-1:0]   exp;
    logic [ShiftBits-1:0] zeros;
    logic [SumBits-1:0]   sum;
  } added_t;

  added_t added_q;
  logic [SumBits-1:0] sum;
  logic [ShiftBits-1:0] zeros;
  logic zero, unused_carry;

  assign {sum, unused_carry} = {1'b0, aligned_q.big, 1'b1}
                             + {aligned_q.sub, aligned_q.addend, aligned_q.sub};

  if (Cancel) begin : gen_zeros
    logic [SumBits-1:0] marked;
    logic unused_marked;
    // Normalisation ends where the leading bit has the smallest exponent: what remains is subnormal.
    assign marked = sum | ({1'b1, AddBits'(0)} >> aligned_q.exp);
    // The lowest bit does not matter: where none above it is set, it is the leading one or the sum is zero.
    assign unused_marked = marked[0];
    flk_lzc #(
      .Width(AddBits)
    ) i_zeros (
      .value_i(marked[SumBits-1:1]),
      .count_o(zeros)
    );
  end else begin : gen_carry
    assign zeros = ShiftBits'(!sum[SumBits-1]);
  end

  assign zero = (sum == '0);

  flk_delay #(
    .Width($bits(added_t)),
    .Depth(32'(Stages >= 3))
  ) i_added (
    .clk_i,
    .en_i,
    // x - x is +0.
    .d_i({
      aligned_q.sign && !(aligned_q.sub && zero), aligned_q.nan, aligned_q.infinite, zero,
      aligned_q.exp, zeros, sum
    }),
    .q_o(added_q)
  );

  // ---- Normalise and round to nearest even -------------------------------------------------------------

  localparam int unsigned CodeBits = ExpBits + ManBits;
  localparam logic [CodeBits-1:0] INF_CODE = {{ExpBits{1'b1}}, {ManBits{1'b0}}};
  localparam logic [CodeBits-1:0] NAN_CODE = Fn ? '1 : INF_CODE | (CodeBits'(1) << (ManBits - 1));
  // First code that is not a finite number.
  localparam logic [CodeBits-1:0] LIMIT = Fn ? '1 : INF_CODE;
  localparam logic [CodeBits-1:0] OVERFLOW = Saturate ? LIMIT - 1'b1 : INF_CODE;

  logic [SumBits-1:0] normal;
  logic [ExpBits:0] exp;  // one bit more: the carry may lead beyond the largest exponent
  logic [CodeBits:0] truncated;
  logic [CodeBits-1:0] rounded;
  logic round_up, overflow;
  logic [Width-1:0] packed_sum;

  assign normal = added_q.sum << added_q.zeros;
  assign exp = added_q.zero ? '0 : (ExpBits + 1)'(added_q.exp) - (ExpBits + 1)'(added_q.zeros)
                                 + (ExpBits + 1)'(normal[SumBits-1]);
  assign truncated = {exp, normal[SumBits-2-:ManBits]};
  assign round_up = normal[3] && (normal[4] || (|normal[2:0]));
  // A carry out of the mantissa raises the exponent; from the largest number it leads to infinity.
  assign rounded = truncated[CodeBits-1:0] + CodeBits'(round_up);
  assign overflow = added_q.infinite || (truncated >= {1'b0, LIMIT})
                 || (Saturate && round_up && (truncated == {1'b0, LIMIT - 1'b1}));

  always_comb begin
    if (added_q.nan) begin
      packed_sum = {1'b0, NAN_CODE};
    end else if (overflow) begin
      packed_sum = {added_q.sign, OVERFLOW};
    end else begin
      packed_sum = {added_q.sign, rounded};
    end
  end

  flk_delay #(
    .Width(Width),
    .Depth(32'(Stages >= 1))
  ) i_sum (
    .clk_i,
    .en_i,
    .d_i(packed_sum),
    .q_o(sum_o)
  );

endmodule
